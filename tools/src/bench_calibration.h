#ifndef THICKLENS_TOOLS_BENCH_CALIBRATION_H_
#define THICKLENS_TOOLS_BENCH_CALIBRATION_H_

#include <CLI/CLI.hpp>

#include "commands.h"

namespace thicklens::tools {

// `thicklens bench calibration`: what each method of calibration costs and how far it is off, over
// many simulated sweeps, by the frames and the field that it is given.
void AddBenchCalibrationCommand(CLI::App* bench, CommandAction* action);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_CALIBRATION_H_
