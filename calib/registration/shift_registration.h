#ifndef THICKLENS_CALIB_REGISTRATION_SHIFT_REGISTRATION_H_
#define THICKLENS_CALIB_REGISTRATION_SHIFT_REGISTRATION_H_

#include <opencv2/core/mat.hpp>
#include <optional>

#include "calib/registration/image_scale.h"

namespace thicklens::calib {

// Whether the target looks the same at every scale, but determines the position along both axes (a
// star of spokes, a single corner). The frame must be sharp.
bool IsScaleInvariant(const cv::Mat& image);

// Measures the shift and rotation of a frame of such a target at a known scale. Both images are
// CV_32F and of one size. The method is phase correlation on shrunk images, then the phases of the
// cross-spectra of tiles, with matched blur. Returns std::nullopt if these do not converge, if the
// shift is uncertain by more than 0.3 px, or if the agreement (correlation) is below 0.6.
// `scale_sigma` is 0, because the scale is not measured.
std::optional<Registration> RegisterShift(const cv::Mat& reference, const cv::Mat& frame,
                                          double scale, cv::Point2d centre);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_SHIFT_REGISTRATION_H_
