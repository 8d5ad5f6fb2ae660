#ifndef THICKLENS_CALIB_REGISTRATION_COARSE_REGISTRATION_H_
#define THICKLENS_CALIB_REGISTRATION_COARSE_REGISTRATION_H_

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

// What a picture, shrunk as for RegisterCoarsely, would show of where it lies, each 1 where
// gradients point everywhere alike.
struct PictureInformation {
  // Of a change of scale beside a shift and a turn: 0 where it looks like these, or like nothing (a
  // lone edge or corner, a star of spokes).
  double scale = 0;
  // Of the shift along the direction in which it shows worst, over the best: 0 for a lone edge.
  double worst_shift = 0;
};
PictureInformation InformationOf(const cv::Mat& picture);

// Below, a registration could not tell the scale.
constexpr double kLeastScaleInformation = 0.05;

// The frame shows the reference at `scale` about `centre` and shifted: by phase correlation of
// shrunk pictures, of several shifts that a periodic target allows the smallest. Good to a shrunk
// pixel. Nothing if too little of the field is shared.
std::optional<FrameMap> ShiftCoarsely(const cv::Mat& reference, const cv::Mat& frame, double scale,
                                      cv::Point2d centre);

// How well the phases of the two agree at that scale, at the best shift: from 0 to 1. Blur leaves
// it alone. Costs a tenth of a registration.
double CoarseAgreement(const cv::Mat& reference, const cv::Mat& frame, double scale,
                       cv::Point2d centre);

// Started from a scale about `centre`, a shift by phase correlation as ShiftCoarsely, then ECC on
// pictures shrunk to at most 160 px. Nothing if that does not converge.
std::optional<FrameMap> RegisterCoarsely(const cv::Mat& reference, const cv::Mat& frame,
                                         double expected_scale, cv::Point2d centre);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_COARSE_REGISTRATION_H_
