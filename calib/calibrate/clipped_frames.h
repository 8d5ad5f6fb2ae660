#ifndef THICKLENS_CALIB_CALIBRATE_CLIPPED_FRAMES_H_
#define THICKLENS_CALIB_CALIBRATE_CLIPPED_FRAMES_H_

#include <cstddef>
#include <functional>
#include <vector>

#include "calib/registration/image_scale.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// Frames of a texture whose brightest places are clipped. The sharpest frames have the brightest
// places: their light is not the blurred light of the target, which all frames have in common, and
// their spectra moved kappa by three times its error, in either direction.
struct ClippedFrames {
  std::vector<std::size_t> left_out;  // indices into the sweep; the other frames suffice
  std::vector<std::size_t> kept;      // without these too few frames would be left
};

// Returns the sharpest of some frames, which are indices into the sweep.
using SharpestOf = std::function<std::size_t(const std::vector<std::size_t>& frames)>;

// Leaves clipped frames out of the fit of the blur, the most clipped ones first, as long as at
// least a half of `used` and nine frames are left, with frames nearer and farther than `focus_mm`.
// `replaced_share` is the share of the pixels that the frame correction replaces: hot pixels are
// clipped in every frame, and their light is not used.
ClippedFrames ChooseClippedFrames(const std::vector<FrameMeasurement>& frames,
                                  const std::vector<std::size_t>& used, double focus_mm,
                                  double replaced_share = 0);

// Leaves these frames out, says so, and returns the other ones of `used`. A reference that is left
// out is replaced by the sharpest other registered frame, to which `scales` are converted;
// `sharpest_of` returns the sharpest one of some frames. Where no other frame is registered, the
// clipped ones stay, as `kept`.
std::vector<std::size_t> LeaveOutClipped(ClippedFrames* clipped,
                                         const std::vector<std::size_t>& used,
                                         const SharpestOf& sharpest_of, std::size_t* reference,
                                         std::vector<ScaleSample>* scales,
                                         Calibration* calibration);

// Widens the interval of kappa for clipped frames that stayed in the fit.
void WidenByClipping(const ClippedFrames& clipped, Calibration* calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATE_CLIPPED_FRAMES_H_
