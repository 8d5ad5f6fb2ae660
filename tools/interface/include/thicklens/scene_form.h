#ifndef THICKLENS_INTERFACE_SCENE_FORM_H_
#define THICKLENS_INTERFACE_SCENE_FORM_H_

#include <string>

#include "thicklens/base/export.h"
#include "thicklens/base/output_file.h"
#include "thicklens/estimator/scene_form.h"
#include "thicklens/image.h"
#include "thicklens/light_field.h"
#include "thicklens/run.h"

namespace thicklens {

// A light field as the scene that it shows: the radiance and the disparity of the points that the
// centre view shows. What LightFieldEstimate::scene is, and a folder may hold.
using SceneForm = estimator::SceneForm;

// Returns whether the folder holds a light field that is stored as its scene; false for a folder of
// another layout, and if there is none. Throws Error if its description cannot be read.
THICKLENS_EXPORT bool IsSceneForm(const std::string& folder);

// Reads a light field that is stored as its scene. ReadLightField (light_field.h) reads it as well,
// and renders all views. Throws OptionError for `run`, Error that names the file, and Interrupted.
THICKLENS_EXPORT SceneForm ReadSceneForm(const std::string& folder, const RunControl& run = {});

// Writes the scene into a folder, completely or not at all (docs/file-formats.md). Throws
// OptionError, and Error, also for a scene that is not valid.
THICKLENS_EXPORT void WriteSceneForm(const std::string& folder, const SceneForm& scene,
                                     const RunControl& run = {});
// Writes it into a claimed folder; the caller commits it. Throws Error also for a folder that is
// null.
THICKLENS_EXPORT void WriteSceneForm(OutputFolder* folder, const SceneForm& scene,
                                     const RunControl& run = {});

// Renders the view at the column u and the row v in linear light, u from 0 to U - 1 and v from 0 to
// V - 1; between them they need not be whole. To render many views, estimator::SceneRenderer
// prepares the scene once. Throws Error for another place and for a scene that is not valid.
THICKLENS_EXPORT Image RenderView(const SceneForm& scene, double u, double v);

// Renders all views. Throws OptionError, and Error for a scene that is not valid.
THICKLENS_EXPORT LightField ViewsOf(const SceneForm& scene, const RunControl& run = {});

}  // namespace thicklens

#endif  // THICKLENS_INTERFACE_SCENE_FORM_H_
