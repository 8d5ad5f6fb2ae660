#ifndef THICKLENS_TOOLS_REPORT_REJECTION_WORDS_H_
#define THICKLENS_TOOLS_REPORT_REJECTION_WORDS_H_

#include <string>
#include <vector>

#include "thicklens/calib/calibration.h"
#include "thicklens/calib/rejection_groups.h"

namespace thicklens::tools {

// Returns the text of each run of a group: the first in full; for each later one the differing
// part, with a long common ending replaced by "...", or the name of the run with the same detail
// ("as frame_003.png").
std::vector<std::string> TextsOfRuns(const std::vector<calib::FrameMeasurement>& frames,
                                     const calib::RejectionGroup& group);

// "frame_003.png", or "frame_003.png .. frame_007.png (5 frames)".
std::string RunName(const std::vector<calib::FrameMeasurement>& frames,
                    const calib::RejectionRun& run);

// Returns the printed, indented text about the rejected frames: every kind with the amounts of its
// first runs. Empty if there are none.
std::string RejectionLines(const std::vector<calib::FrameMeasurement>& frames);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_REJECTION_WORDS_H_
