#ifndef THICKLENS_IO_SCENE_FORM_FILES_H_
#define THICKLENS_IO_SCENE_FORM_FILES_H_

#include <string>

#include "thicklens/base/export.h"
#include "thicklens/base/output_file.h"
#include "thicklens/estimator/scene_form.h"

namespace thicklens::io {

// Returns whether the folder holds a light field that is stored as its scene
// (docs/file-formats.md). False for a folder of another layout, and if there is no such folder.
// Throws Error if its description cannot be read.
THICKLENS_EXPORT bool IsSceneForm(const std::string& folder);

// Reads it. Throws Error that names the file and what is wrong with it.
THICKLENS_EXPORT estimator::SceneForm ReadSceneForm(const std::string& folder);

// Writes a light field as its scene below the staging path of a folder for light fields; the caller
// commits it. The light is stored as whole numbers of 16 bits where these are within 1e-5 of it (of
// full scale), and as floats otherwise, for example with highlights above full scale; disparities
// are floats. Throws Error for a scene that is not valid and for a file that cannot be written.
THICKLENS_EXPORT void WriteSceneForm(const estimator::SceneForm& scene, OutputFolder* folder);

}  // namespace thicklens::io

#endif  // THICKLENS_IO_SCENE_FORM_FILES_H_
