#ifndef THICKLENS_TOOLS_SIMULATE_SCENE_H_
#define THICKLENS_TOOLS_SIMULATE_SCENE_H_

#include <CLI/CLI.hpp>
#include <vector>

#include "commands.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::tools {

// The pictures that a scene's layers name, read from their files. Those of unknown origin are taken
// as sRGB, as a screen would show them. What a mask stores is no light. Throws Error.
std::vector<model::LayerPixels> ReadScenePixels(const model::SceneSimulationOptions& scene);

// `picture` and `light-field`, below `simulate`.
void AddSimulateSceneCommands(CLI::App* simulate, CommandAction* action);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_SIMULATE_SCENE_H_
