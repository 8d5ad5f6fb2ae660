#ifndef THICKLENS_TOOLS_SIMULATE_SCENE_H_
#define THICKLENS_TOOLS_SIMULATE_SCENE_H_

#include <CLI/CLI.hpp>
#include <vector>

#include "commands.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::tools {

// Reads the images that a scene's layers name. Images of unknown origin are read as sRGB, as a
// screen would show them. The values of a mask are not light. Throws Error.
std::vector<model::LayerPixels> ReadScenePixels(const model::SceneSimulationOptions& scene);

// Adds `picture` and `light-field` below `simulate`.
void AddSimulateSceneCommands(CLI::App* simulate, CommandAction* action);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_SIMULATE_SCENE_H_
