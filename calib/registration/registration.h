#ifndef THICKLENS_CALIB_REGISTRATION_REGISTRATION_H_
#define THICKLENS_CALIB_REGISTRATION_REGISTRATION_H_

#include <opencv2/core/mat.hpp>
#include <optional>

#include "thicklens/calib/image_scale.h"

namespace thicklens::calib {

// A registration with the cubic term left free, whose scale is that at the centre and several times
// less certain than the scale would be if the cubic term were known.
struct FreeRegistration {
  Registration free;
  // d scale/d cubic along the valley of the fit, px^2: the scale for a known cubic term c is
  // free.scale + scale_per_cubic (free.cubic - c).
  double scale_per_cubic = 0;

  // The registration for a cubic term known to be `cubic` with `cubic_sigma`; what was measured of
  // the cubic term stays as it is.
  Registration WithCubic(double cubic, double cubic_sigma) const;
};

// As Register, for those who know more about the cubic term than one pair of frames tells.
std::optional<FreeRegistration> RegisterFreely(const cv::Mat& reference, const cv::Mat& frame,
                                               double expected_scale, cv::Point2d centre);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_REGISTRATION_H_
