#ifndef THICKLENS_TOOLS_OPTIONS_SWEEP_OPTIONS_H_
#define THICKLENS_TOOLS_OPTIONS_SWEEP_OPTIONS_H_

#include <CLI/CLI.hpp>

#include "tools/options/sweep_input.h"

namespace thicklens::tools {

// Adds the options that override statements of a sweep's file: --offset-mm, --offset-sigma-mm,
// --focus-depth-mm, --working-distance-mm, --image-distance-mm, --tube-length-mm, --magnification,
// --direction, --reading-sigma-mm, --floor-px, --floor-from, --target, --target-period-mm, --roi,
// --full-scale, --raw, --dark, --flat, --defects, --distortion.
void AddSweepStatements(CLI::App* command, SweepArguments* sweep);

// Adds the options that say where the readings are: --readings, --column, --file-column, --unit,
// --reading-scale, --decimal, --reading-from, --reading-from-name.
void AddReadingOptions(CLI::App* command, SweepArguments* sweep);

// Adds the options for a video: --time-column, --time-unit, --time-offset, --reading-start,
// --reading-end, --time-start, --time-end, --every, --frames.
void AddVideoOptions(CLI::App* command, SweepArguments* sweep);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_SWEEP_OPTIONS_H_
