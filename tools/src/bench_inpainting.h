#ifndef THICKLENS_TOOLS_BENCH_INPAINTING_H_
#define THICKLENS_TOOLS_BENCH_INPAINTING_H_

#include <CLI/CLI.hpp>

#include "commands.h"

namespace thicklens::tools {

// `thicklens bench inpainting`: the source's filling of what near things hide, against the
// solvers' own, in time and in PSNR around occlusions.
void AddBenchInpaintingCommand(CLI::App* bench, CommandAction* action);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_INPAINTING_H_
