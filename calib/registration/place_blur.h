#ifndef THICKLENS_CALIB_REGISTRATION_PLACE_BLUR_H_
#define THICKLENS_CALIB_REGISTRATION_PLACE_BLUR_H_

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

namespace thicklens::calib {

// A Gaussian blur that depends on the place: at the distance R from the centre its variance is
// at_centre + curvature R^2 in all directions, plus astigmatism R^2 along the radius and less by it
// along the tangent. Lengths are in px of the image.
struct PlaceBlur {
  Eigen::Vector2d centre_px{0, 0};
  double at_centre_px2 = 0;
  double curvature = 0, astigmatism = 0;  // dimensionless

  // Smallest variance that any direction has at any place of an image of that size, px^2. It may be
  // negative.
  double Least(cv::Size size) const;
};

// Spreads the light of every point of an image (CV_32F) by the blur of its own place, as a lens
// does [D175]. A negative variance counts as 0. Beyond the image its outermost pixels are repeated.
cv::Mat SpreadByPlace(const cv::Mat& image, const PlaceBlur& blur);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_PLACE_BLUR_H_
