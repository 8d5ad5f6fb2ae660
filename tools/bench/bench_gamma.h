#ifndef THICKLENS_TOOLS_BENCH_BENCH_GAMMA_H_
#define THICKLENS_TOOLS_BENCH_BENCH_GAMMA_H_

#include <CLI/CLI.hpp>

#include "tools/options/command_frame.h"

namespace thicklens::tools {

// Adds `thicklens bench gamma`, which reproduces section 4 of the paper: gamma from 1e-4 to 1e4 and
// toward 0, with this program's ridge and, as in the paper, without.
void AddBenchGammaCommand(CLI::App* bench, CommandAction* action);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_BENCH_GAMMA_H_
