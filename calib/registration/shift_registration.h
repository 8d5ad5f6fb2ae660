#ifndef THICKLENS_CALIB_REGISTRATION_SHIFT_REGISTRATION_H_
#define THICKLENS_CALIB_REGISTRATION_SHIFT_REGISTRATION_H_

#include <opencv2/core/mat.hpp>
#include <optional>

#include "thicklens/calib/image_scale.h"

namespace thicklens::calib {

// Whether the target looks the same at every scale, but shows where it lies along both axes: a star
// of spokes, a lone corner. Judged on a sharp frame.
bool ShowsShiftAlone(const cv::Mat& picture);

// For such targets: the frame's shift and rotation at a scale that is known. Both pictures CV_32F,
// of one size. Phase correlation on shrunk pictures, then the phases of the cross-spectra of tiles,
// with the blur matched. Nothing if these do not converge, if the shift is uncertain by more than
// 0.3 px, or the agreement (correlation) is below 0.6. `scale_sigma` is 0: nothing was measured.
std::optional<Registration> RegisterShift(const cv::Mat& reference, const cv::Mat& frame,
                                          double scale, cv::Point2d centre);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_SHIFT_REGISTRATION_H_
