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

// What counts as the period, so that a length stated for it is one and the same:
// - a line grid, a dot grid, a ruling: the distance of neighbouring lines or dots, the shorter one
//   where it differs along the two directions;
// - a checkerboard: two squares along their sides, the way from a black square to the next one in
//   its row. (The shortest shift that maps it onto itself is the diagonal of one square, shorter by
//   sqrt(2).) A checkerboard and a square grid are told from each other by their harmonics.
//
// `grey` is CV_32F; the pattern may be turned by any angle, has to be seen four times across the
// frame's shorter side and may be no finer than 2.3 px. Nothing where there is no period: an
// aperiodic texture, or a pattern so defocused that it may be checkerboard or grid.
std::optional<PeriodEstimate> MeasurePeriodPx(const cv::Mat& grey);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_TARGET_PERIOD_H_
