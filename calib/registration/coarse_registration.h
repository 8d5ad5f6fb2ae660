#ifndef THICKLENS_CALIB_REGISTRATION_COARSE_REGISTRATION_H_
#define THICKLENS_CALIB_REGISTRATION_COARSE_REGISTRATION_H_

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>
#include <optional>

namespace thicklens::calib {

// p_frame = linear p_reference + offset + cubic |q|^2 q, with q = p_frame - centre, in pixels of
// full resolution.
struct FrameMap {
  Eigen::Matrix2d linear = Eigen::Matrix2d::Identity();
  Eigen::Vector2d offset{0, 0};
  Eigen::Vector2d centre{0, 0};
  double cubic = 0;  // px^-2
};

// The upright rectangle of the frame, in px, that the reference covers entirely. It assumes a small
// rotation and ignores the cubic term.
cv::Rect2d SharedField(const FrameMap& map, cv::Size reference, cv::Size frame);

// Averages over blocks of `factor` x `factor` px. Pixel i of the result has the full-resolution
// coordinate factor (i + 1/2) - 1/2.
cv::Mat Shrunk(const cv::Mat& image, int factor);

// Resamples the reference in the geometry of the frame, for the pixels of `region` of the frame
// shrunk by `frame_factor`. `reference` has full resolution. The interpolation is cubic
// (Catmull-Rom), without rounding of the positions. Beyond the reference its outermost pixels are
// repeated.
cv::Mat InFrameGeometry(const cv::Mat& reference, const FrameMap& map, int frame_factor,
                        cv::Rect region);

// Information about its own position that an image, shrunk as for RegisterCoarsely, contains. Each
// value is 1 where the gradients are isotropic and evenly distributed.
struct ImageInformation {
  // Information about a change of scale in addition to a shift and a rotation. It is 0 where a
  // change of scale looks like these, or has no effect (a single edge or corner, a star of spokes).
  double scale = 0;
  // Information about the shift along the least informative direction, relative to the most
  // informative one; 0 for a single edge.
  double worst_shift = 0;
};
ImageInformation InformationOf(const cv::Mat& image);

// Minimum scale information for a registration that determines the scale.
constexpr double kMinScaleInformation = 0.05;

// Finds the shift of a frame that shows the reference at `scale` about `centre`, by phase
// correlation of shrunk images. If a periodic target allows several shifts, the smallest one is
// preferred. The result is good to one shrunk pixel. Returns std::nullopt if too little of the
// field is shared.
std::optional<FrameMap> ShiftCoarsely(const cv::Mat& reference, const cv::Mat& frame, double scale,
                                      cv::Point2d centre);

// Agreement of the phases of the two images at that scale and the best shift, from 0 to 1. Blur
// does not change it. It costs a tenth of a registration.
double CoarseAgreement(const cv::Mat& reference, const cv::Mat& frame, double scale,
                       cv::Point2d centre);

// Registers the frame from a start scale about `centre` and a shift by phase correlation as in
// ShiftCoarsely, with ECC on images shrunk to at most 160 px. Returns std::nullopt if ECC does not
// converge.
std::optional<FrameMap> RegisterCoarsely(const cv::Mat& reference, const cv::Mat& frame,
                                         double expected_scale, cv::Point2d centre);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_COARSE_REGISTRATION_H_
