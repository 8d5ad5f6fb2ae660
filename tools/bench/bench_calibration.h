#ifndef THICKLENS_TOOLS_BENCH_BENCH_CALIBRATION_H_
#define THICKLENS_TOOLS_BENCH_BENCH_CALIBRATION_H_

#include <CLI/CLI.hpp>

#include "tools/options/command_frame.h"

namespace thicklens::tools {

// Adds `thicklens bench calibration`. It measures the cost and the error of each calibration method
// over many simulated sweeps, as a function of the number of frames and of the field.
void AddBenchCalibrationCommand(CLI::App* bench, CommandAction* action);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_BENCH_CALIBRATION_H_
