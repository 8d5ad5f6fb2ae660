#ifndef THICKLENS_TOOLS_BENCH_BENCH_ACCURACY_H_
#define THICKLENS_TOOLS_BENCH_BENCH_ACCURACY_H_

#include <CLI/CLI.hpp>

#include "tools/options/command_frame.h"

namespace thicklens::tools {

// Adds `thicklens bench accuracy`. It measures the cost and the accuracy of each way to a light
// field, on scenes whose true views are known. With --save-profile it measures the profile that
// `estimate --quality`, --within and --psnr-loss choose from.
void AddBenchAccuracyCommand(CLI::App* bench, CommandAction* action);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_BENCH_ACCURACY_H_
