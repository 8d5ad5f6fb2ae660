#ifndef THICKLENS_CALIB_REGISTRATION_TARGET_PERIOD_H_
#define THICKLENS_CALIB_REGISTRATION_TARGET_PERIOD_H_

#include <opencv2/core/mat.hpp>
#include <optional>

namespace thicklens::calib {

// Period of a target in a frame, px, with its standard deviation.
struct PeriodEstimate {
  double period_px = 0;
  double sigma_px = 0;
};

// Measures the period of a target. The period is defined so that a stated length of it is
// unambiguous:
// - line grid, dot grid or ruling: the distance of neighbouring lines or dots, the shorter one
//   where it differs along the two directions;
// - checkerboard: two squares along their sides, the distance from a black square to the next one
//   in its row. (The shortest shift that maps it onto itself is the diagonal of one square, shorter
//   by sqrt(2).) Their harmonics distinguish a checkerboard from a square grid.
//
// `grey` is CV_32F. The pattern may have any rotation. It must have at least four periods across
// the frame's shorter side and a period of at least 2.3 px. Returns std::nullopt where there is no
// period: for an aperiodic texture, or for a pattern so defocused that it may be checkerboard or
// grid. Throws Interrupted after a request to stop.
std::optional<PeriodEstimate> MeasurePeriodPx(const cv::Mat& grey);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_TARGET_PERIOD_H_
