#ifndef THICKLENS_CALIB_FIT_BLUR_EXAMPLES_H_
#define THICKLENS_CALIB_FIT_BLUR_EXAMPLES_H_

#include <opencv2/core/mat.hpp>
#include <optional>

#include "calib/fit/blur_measurement.h"

namespace thicklens::calib {

// Curves of single frames with both fitted shapes of the blur, for plots.

// Adds the transfer of the nearest, the sharpest and the farthest frame of the spectral estimator.
// `other` is the fit with the shape that is not stated. Its curve is omitted where this fit is not
// done or lacks the frame.
void AddTransferExamples(model::Psf stated, const FittedRegion& other, BlurEvidence* evidence);

// The profile of a frame's strongest straight edge, with chi^2 per degree of freedom of each shape
// that can be fitted. EdgeExample returns nothing where there is no such edge.
struct EdgeComparison {
  BlurExample curves;
  std::optional<double> gaussian_chi2, disc_chi2;
};
std::optional<EdgeComparison> EdgeExample(const cv::Mat& grey, std::size_t frame, model::Psf stated,
                                          double floor_px);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_BLUR_EXAMPLES_H_
