#ifndef THICKLENS_IO_SCENE_PIXELS_H_
#define THICKLENS_IO_SCENE_PIXELS_H_

#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::io {

// Reads the images that a scene's layers name. Images of unknown origin are read as sRGB, as a
// screen would show them. The values of a mask are not light. Throws Error.
THICKLENS_EXPORT std::vector<model::LayerPixels> ReadScenePixels(
    const model::SceneSimulationOptions& scene);

}  // namespace thicklens::io

#endif  // THICKLENS_IO_SCENE_PIXELS_H_
