#ifndef THICKLENS_IO_SCENE_FORM_FILES_H_
#define THICKLENS_IO_SCENE_FORM_FILES_H_

#include <functional>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/base/output_file.h"
#include "thicklens/estimator/scene_form.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/scene.h"

namespace thicklens::io {

// Returns whether the folder holds a light field that is stored as its scene
// (docs/file-formats.md). False for a folder of another layout, and if there is no such folder.
// Throws Error if its description cannot be read.
THICKLENS_EXPORT bool IsSceneForm(const std::string& folder);

// Reads it. Throws Error that names the file and what is wrong with it.
THICKLENS_EXPORT estimator::SceneForm ReadSceneForm(const std::string& folder);

// The views of such a light field, which are rendered when they are asked for.
struct SceneViews {
  model::LightField frame;  // without values
  // Renders the view (k, l); several threads may call it.
  std::function<model::LinearImage(int k, int l)> view;
};
// Reads the scene and prepares its views. Throws Error as ReadSceneForm does.
THICKLENS_EXPORT SceneViews OpenSceneViews(const std::string& folder);

// Writes a light field as its scene below the staging path of a folder for light fields; the caller
// commits it. The light is stored as views in PNG files are, encoded by the transfer curve in 16
// bits, where it lies between black and full scale, and as floats otherwise; disparities are
// floats. Throws Error for a scene that is not valid and for a file that cannot be written.
THICKLENS_EXPORT void WriteSceneForm(const estimator::SceneForm& scene, OutputFolder* folder);

}  // namespace thicklens::io

#endif  // THICKLENS_IO_SCENE_FORM_FILES_H_
