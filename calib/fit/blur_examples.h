#ifndef THICKLENS_CALIB_FIT_BLUR_EXAMPLES_H_
#define THICKLENS_CALIB_FIT_BLUR_EXAMPLES_H_

#include <opencv2/core/mat.hpp>
#include <optional>

#include "calib/fit/blur_measurement.h"

namespace thicklens::calib {

// Curves of single frames with both shapes of the blur fitted, for the eye.

// The transfer of the nearest, the sharpest and the farthest frame of the spectral meter; `other`
// is the fit with the shape that is not stated (left out where it is not done, or without the
// frame).
void AddTransferExamples(model::Psf stated, const FittedRegion& other, BlurEvidence* evidence);

// The profile of a frame's strongest straight edge, with chi^2 per degree of freedom of each shape
// where it can be fitted; nothing where there is no such edge.
struct EdgeComparison {
  BlurExample curves;
  std::optional<double> gaussian_chi2, disc_chi2;
};
std::optional<EdgeComparison> EdgeExample(const cv::Mat& grey, std::size_t frame, model::Psf stated,
                                          double floor_px);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_BLUR_EXAMPLES_H_
