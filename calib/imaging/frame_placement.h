#ifndef THICKLENS_CALIB_IMAGING_FRAME_PLACEMENT_H_
#define THICKLENS_CALIB_IMAGING_FRAME_PLACEMENT_H_

#include <cstddef>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// The image scale of a frame relative to that of ScaleModel::reference_frame: as it was registered
// or, where it was not, by the fitted law of the scale, or by the ratio of the depths. Absent:
// neither is known.
std::optional<double> ScaleOfFrame(const Calibration& calibration, std::size_t frame,
                                   model::BenchDirection direction);

// The frame to which the others are aligned: the reference of the scales or, without scales, the
// sharpest frame. Absent: no frame passed its checks.
std::optional<std::size_t> AlignmentReference(const Calibration& calibration);

// The affine map (2 x 3, CV_64F) from pixels of the reference to those of the frame, p_frame = c +
// t + s R (p_reference - c): the scale s is given, shift t and turn R are registered. Both images
// are CV_32F and of one size. Absent: the registration failed, or its scale contradicts the given
// one by more than 2 %.
std::optional<cv::Mat> PlaceFrame(const cv::Mat& reference, const cv::Mat& frame, double scale,
                                  cv::Point2d axis);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_IMAGING_FRAME_PLACEMENT_H_
