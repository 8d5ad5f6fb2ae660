#ifndef THICKLENS_CALIB_REGISTRATION_SENSOR_DEFECTS_H_
#define THICKLENS_CALIB_REGISTRATION_SENSOR_DEFECTS_H_

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "calib/registration/frame_structure.h"

namespace thicklens::calib {

// Fine structure that is fixed to the frame.
struct SensorDefects {
  bool done = false;                // true if the frames were examined
  std::string message = "not run";  // how it ended; without a result, the reason
  cv::Mat log_gain;  // ln of the relative light that passes, CV_32F; 0 where nothing is known
  cv::Mat filled;    // CV_8U, not 0 where the values cannot be used
  int specks = 0, defective_px = 0;
  double deepest_speck = 0;  // relative change of the light
  double divided_share = 0, filled_share = 0;
  double column_deviation = 0, row_deviation = 0;  // relative; 0: none

  bool Any() const {
    return specks > 0 || defective_px > 0 || column_deviation > 0 || row_deviation > 0;
  }
};

// Finds dust, defective pixels, and columns or rows of unequal gain [D134].
//
// Candidates: in the frames with the strongest blur, the target has no fine structure of its own.
// These frames form two groups of different scale. A candidate stands out of the fine structure of
// the mean ln light of both groups, with the same sign. This costs little, and a clean sweep ends
// here.
//
// Proof: around each candidate, the frames are compared with the reference, brought to their scale
// and filtered by the transfer function between the two, which is measured as the mean over all
// directions. ln I - ln (filtered reference) is the structure, without the target. It must stand
// out of its surroundings, and be the same in both groups. Because the reference shows the
// structure as well, it is divided by what was found, and this is repeated.
//
// `sharpness` is an index of sharpness of each frame of the sweep; the reference is the frame with
// scale 1.
SensorDefects FindSensorDefects(const FramePlaces& places, std::size_t reference,
                                const std::vector<double>& sharpness, int threads);

// Both findings in one, where `more` was found in frames without what `before` describes: what was
// missed, and what was taken for too deep or too shallow because it disturbed the registrations and
// the kernels. Specks are counted again in the sum.
SensorDefects WithMore(const SensorDefects& before, const SensorDefects& more);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_SENSOR_DEFECTS_H_
