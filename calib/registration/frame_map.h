#ifndef THICKLENS_CALIB_REGISTRATION_FRAME_MAP_H_
#define THICKLENS_CALIB_REGISTRATION_FRAME_MAP_H_

#include <opencv2/core/mat.hpp>

#include "calib/registration/coarse_registration.h"
#include "calib/registration/image_scale.h"

namespace thicklens::calib {

// The map of a registration, without its cubic term.
FrameMap MapOf(const Registration& registration, cv::Point2d centre);

// ln of the light, CV_32F; a thousandth of full scale is added first.
cv::Mat LogOfLight(const cv::Mat& light);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_FRAME_MAP_H_
