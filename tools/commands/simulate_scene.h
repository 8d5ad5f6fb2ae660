#ifndef THICKLENS_TOOLS_COMMANDS_SIMULATE_SCENE_H_
#define THICKLENS_TOOLS_COMMANDS_SIMULATE_SCENE_H_

#include <CLI/CLI.hpp>

#include "tools/options/command_frame.h"

namespace thicklens::tools {

// Adds `image` and `light-field` below `simulate`.
void AddSimulateSceneCommands(CLI::App* simulate, CommandAction* action);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_COMMANDS_SIMULATE_SCENE_H_
