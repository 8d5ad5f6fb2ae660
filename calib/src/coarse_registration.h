#ifndef THICKLENS_CALIB_SRC_COARSE_REGISTRATION_H_
#define THICKLENS_CALIB_SRC_COARSE_REGISTRATION_H_

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>
#include <optional>

namespace thicklens::calib {

// p_frame = linear p_reference + offset + cubic |q|^2 q, q = p_frame - centre, in pixels of full
// resolution.
struct FrameMap {
  Eigen::Matrix2d linear = Eigen::Matrix2d::Identity();
  Eigen::Vector2d offset{0, 0};
  Eigen::Vector2d centre{0, 0};
  double cubic = 0;  // px^-2
};

// The upright rectangle of the frame, in px, that the reference covers entirely (small rotations,
// the cubic term left aside).
cv::Rect2d SharedField(const FrameMap& map, cv::Size reference, cv::Size frame);

// Averages over blocks of `factor` x `factor` px: pixel i stands at factor (i + 1/2) - 1/2.
cv::Mat Shrunk(const cv::Mat& picture, int factor);

// The reference in the frame's geometry: the pixels of `region` of the frame shrunk by
// `frame_factor`. `reference` is not shrunk yet. Cubic (Catmull-Rom), without rounding of the
// positions; beyond the reference its outermost pixels are repeated.
cv::Mat InFrameGeometry(const cv::Mat& reference, const FrameMap& map, int frame_factor,
                        cv::Rect region);

// Started from a scale about `centre`, a shift by phase correlation (of several that a periodic
// target allows the smallest), then ECC on pictures shrunk to at most 160 px. Nothing if that does
// not converge.
std::optional<FrameMap> RegisterCoarsely(const cv::Mat& reference, const cv::Mat& frame,
                                         double expected_scale, cv::Point2d centre);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SRC_COARSE_REGISTRATION_H_
