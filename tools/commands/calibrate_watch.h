#ifndef THICKLENS_TOOLS_COMMANDS_CALIBRATE_WATCH_H_
#define THICKLENS_TOOLS_COMMANDS_CALIBRATE_WATCH_H_

#include <nlohmann/json.hpp>
#include <optional>

#include "thicklens/sweep.h"
#include "tools/options/command_frame.h"
#include "tools/options/sweep_input.h"

namespace thicklens::tools {

// The sweep of a folder that was watched until it was complete, and what was seen meanwhile.
struct WatchedSweep {
  Sweep sweep;
  nlohmann::json summary;  // of the watch, for --json
};

// Prints a line for each frame that arrives in the folder, until Enter, a file `done` in the
// folder, SIGINT or, with `pause_s`, a pause ends the sweep.
WatchedSweep WatchSweep(const SweepArguments& arguments, std::optional<double> pause_s,
                        const CommonOptions& common);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_COMMANDS_CALIBRATE_WATCH_H_
