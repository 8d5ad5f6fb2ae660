#ifndef THICKLENS_TOOLS_BENCH_BENCH_SOURCE_H_
#define THICKLENS_TOOLS_BENCH_BENCH_SOURCE_H_

#include <CLI/CLI.hpp>

#include "tools/options/command_frame.h"

namespace thicklens::tools {

// Adds `thicklens bench paper`, which measures tables 1 to 4 of the paper on this machine and
// shows the published values beside them.
void AddBenchSourceCommand(CLI::App* bench, CommandAction* action);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_BENCH_SOURCE_H_
