#ifndef THICKLENS_TOOLS_BENCH_ACCURACY_H_
#define THICKLENS_TOOLS_BENCH_ACCURACY_H_

#include <CLI/CLI.hpp>

#include "commands.h"

namespace thicklens::tools {

// `thicklens bench accuracy`: what each way to a light field costs and gives, on scenes whose true
// views are known; or, with --save-profile, what `estimate --quality`, --within and --psnr-loss
// choose from.
void AddBenchAccuracyCommand(CLI::App* bench, CommandAction* action);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_ACCURACY_H_
