#ifndef THICKLENS_TOOLS_REJECTION_GROUPS_H_
#define THICKLENS_TOOLS_REJECTION_GROUPS_H_

#include <cstddef>
#include <string>
#include <vector>

#include "thicklens/calib/calibrate.h"

namespace thicklens::tools {

// Neighbouring frames of the sweep that were rejected in the same words, numbers included.
struct RejectionRun {
  int first = 0, last = 0;  // indices into the frames
  std::string detail;       // what the reason says beyond its kind: "mean 0.003 of full scale"
  int count() const { return last - first + 1; }
};

// All frames that were rejected for one kind of reason, wherever they stand in the sweep.
struct RejectionGroup {
  std::string kind;  // "dark"
  int frames = 0;
  std::vector<RejectionRun> runs;  // in the sweep's order, none empty
};

// In the order in which the kinds appear in the sweep.
std::vector<RejectionGroup> RejectionGroups(const std::vector<calib::FrameMeasurement>& frames);

// What to say of each run below the others of its group: the first in full; of the next what
// differs, a long ending that all share left out ("..."), or whose detail it is ("as
// frame_003.png").
std::vector<std::string> TextsOfRuns(const std::vector<calib::FrameMeasurement>& frames,
                                     const RejectionGroup& group);

// "frame_003.png", or "frame_003.png .. frame_007.png (5 frames)".
std::string RunName(const std::vector<calib::FrameMeasurement>& frames, const RejectionRun& run);

// What is printed of the rejected frames, indented, every kind with the amounts of its first runs.
// Empty if there are none.
std::string RejectionLines(const std::vector<calib::FrameMeasurement>& frames);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REJECTION_GROUPS_H_
