#ifndef THICKLENS_TOOLS_BENCH_GAMMA_H_
#define THICKLENS_TOOLS_BENCH_GAMMA_H_

#include <CLI/CLI.hpp>

#include "commands.h"

namespace thicklens::tools {

// `thicklens bench gamma`: the source's section 4 as a study, gamma from 1e-4 to 1e4 and toward 0,
// with this program's ridge and without, as the source has it.
void AddBenchGammaCommand(CLI::App* bench, CommandAction* action);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_GAMMA_H_
