#ifndef THICKLENS_TOOLS_INTERFACE_SWEEP_OF_FRAMES_H_
#define THICKLENS_TOOLS_INTERFACE_SWEEP_OF_FRAMES_H_

#include <string>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/sweep.h"

namespace thicklens {

// The error of ExamineFrames for frames whose values do not show what stands for white. More frames
// may show it.
class UndecidedFullScale : public Error {
 public:
  using Error::Error;
};

// A sweep of some of a folder's images, and those of them that have no reading.
struct SweepOfFrames {
  Sweep sweep;
  std::vector<std::string> without_reading;
};

// As ReadSweepFolder, for `images` alone: images without a reading, and rows of other images, are
// left out.
SweepOfFrames ReadSweepOfFrames(const std::string& folder, const std::vector<std::string>& images,
                                const std::string& readings_csv, const SweepOverrides& overrides,
                                const RunControl& control);

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_SWEEP_OF_FRAMES_H_
