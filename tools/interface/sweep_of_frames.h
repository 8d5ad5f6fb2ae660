#ifndef THICKLENS_TOOLS_INTERFACE_SWEEP_OF_FRAMES_H_
#define THICKLENS_TOOLS_INTERFACE_SWEEP_OF_FRAMES_H_

#include <string>
#include <vector>

#include "thicklens/sweep.h"

namespace thicklens {

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
