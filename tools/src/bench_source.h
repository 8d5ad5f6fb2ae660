#ifndef THICKLENS_TOOLS_BENCH_SOURCE_H_
#define THICKLENS_TOOLS_BENCH_SOURCE_H_

#include <CLI/CLI.hpp>

#include "commands.h"

namespace thicklens::tools {

// `thicklens bench source`: the source's tables 1 to 4, measured on this machine beside what was
// published.
void AddBenchSourceCommand(CLI::App* bench, CommandAction* action);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_SOURCE_H_
