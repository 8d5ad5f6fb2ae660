#ifndef THICKLENS_TOOLS_REPORT_REJECTION_GROUPS_H_
#define THICKLENS_TOOLS_REPORT_REJECTION_GROUPS_H_

#include <cstddef>
#include <string>
#include <vector>

#include "thicklens/calib/calibrate.h"

namespace thicklens::tools {

// Neighbouring frames of the sweep that were rejected with the same text, including its numbers.
struct RejectionRun {
  int first = 0, last = 0;  // indices into the frames
  std::string detail;       // text of the reason beyond its kind: "mean 0.003 of full scale"
  int count() const { return last - first + 1; }
};

// All frames that were rejected for one kind of reason, anywhere in the sweep.
struct RejectionGroup {
  std::string kind;  // "dark"
  int frames = 0;
  std::vector<RejectionRun> runs;  // in the sweep's order, none empty
};

// Returns the groups in the order in which their kinds appear in the sweep.
std::vector<RejectionGroup> RejectionGroups(const std::vector<calib::FrameMeasurement>& frames);

// Returns the text of each run of a group: the first in full; for each later one the differing
// part, with a long common ending replaced by "...", or the name of the run with the same detail
// ("as frame_003.png").
std::vector<std::string> TextsOfRuns(const std::vector<calib::FrameMeasurement>& frames,
                                     const RejectionGroup& group);

// "frame_003.png", or "frame_003.png .. frame_007.png (5 frames)".
std::string RunName(const std::vector<calib::FrameMeasurement>& frames, const RejectionRun& run);

// Returns the printed, indented text about the rejected frames: every kind with the amounts of its
// first runs. Empty if there are none.
std::string RejectionLines(const std::vector<calib::FrameMeasurement>& frames);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_REJECTION_GROUPS_H_
