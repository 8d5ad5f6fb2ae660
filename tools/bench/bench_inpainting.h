#ifndef THICKLENS_TOOLS_BENCH_BENCH_INPAINTING_H_
#define THICKLENS_TOOLS_BENCH_BENCH_INPAINTING_H_

#include <CLI/CLI.hpp>

#include "tools/options/command_frame.h"

namespace thicklens::tools {

// Adds `thicklens bench inpainting`. It compares the paper's inpainting of occluded background with
// the solvers' own result, in time and in PSNR around occlusions.
void AddBenchInpaintingCommand(CLI::App* bench, CommandAction* action);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_BENCH_INPAINTING_H_
