#ifndef THICKLENS_CALIB_IMAGE_SCALE_H_
#define THICKLENS_CALIB_IMAGE_SCALE_H_

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/calib/calibrate.h"

namespace thicklens::calib {

// Scale of `frame` relative to `reference` about the registration's own centre: > 1 where the
// target looks larger. Both CV_32F, of one size. ECC registration of an affine map (illumination
// may differ by gain and offset), started from `expected_scale`. Nothing if it does not converge,
// or the scales along x and y differ by more than 1.5 %, or the agreement (correlation) is below
// 0.6.
std::optional<double> RegisterScale(const cv::Mat& reference, const cv::Mat& frame,
                                    double expected_scale);

// One frame's place in the law.
struct ScaleSample {
  std::size_t frame = 0;  // index into the sweep
  double reading_mm = 0;
  double scale = 0;  // relative to the reference frame
};

// Fits 1/scale = (offset + direction reading)/z_reference, the size on the sensor going as 1/z
// along the chief rays. Robust (Ceres, Cauchy loss on the readings). sigma is the larger of the
// formal one and a delete-a-block jackknife over eight runs of neighbouring readings, because the
// law's errors are not independent from frame to frame; a bias of the registration (2e-4 of scale
// from end to end) is added in quadrature. `done` is false, with the reason, where the samples are
// too few, or the scale does not follow 1/z (constant: telecentric, sensor moved, or one picture
// repeated; reversed: the direction is wrong).
ScaleLaw FitScaleLaw(const std::vector<ScaleSample>& samples, int reference_frame,
                     double reading_sigma_mm, model::BenchDirection direction);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_IMAGE_SCALE_H_
