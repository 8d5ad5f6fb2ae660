#ifndef THICKLENS_TOOLS_BENCH_BENCH_CONDITIONING_H_
#define THICKLENS_TOOLS_BENCH_BENCH_CONDITIONING_H_

#include <CLI/CLI.hpp>

#include "tools/options/command_frame.h"

namespace thicklens::tools {

void AddBenchConditioningCommand(CLI::App* bench, CommandAction* action);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_BENCH_CONDITIONING_H_
