#ifndef THICKLENS_CALIB_REJECTION_GROUPS_H_
#define THICKLENS_CALIB_REJECTION_GROUPS_H_

#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/calib/calibration.h"

namespace thicklens::calib {

// Neighbouring frames of the sweep that were rejected with the same text, including its numbers.
struct RejectionRun {
  int first = 0, last = 0;  // indices into the frames
  std::string detail;       // text of the reason beyond its kind: "mean 0.003 of full scale"
  // The number of frames.
  int count() const { return last - first + 1; }
};

// All frames that were rejected for one kind of reason, anywhere in the sweep.
struct RejectionGroup {
  std::string kind;                // "dark"
  int frames = 0;                  // number of frames in all runs
  std::vector<RejectionRun> runs;  // in the sweep's order, none empty
};

// Returns the groups in the order in which their kinds appear in the sweep.
THICKLENS_EXPORT std::vector<RejectionGroup> RejectionGroups(
    const std::vector<FrameMeasurement>& frames);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REJECTION_GROUPS_H_
