#include "calib/registration/frame_map.h"

#include <cmath>
#include <opencv2/core.hpp>

namespace thicklens::calib {

FrameMap MapOf(const Registration& registration, cv::Point2d centre) {
  FrameMap map;
  map.centre = Eigen::Vector2d(centre.x, centre.y);
  const double c = std::cos(registration.rotation_rad), s = std::sin(registration.rotation_rad);
  map.linear << c, -s, s, c;
  map.linear *= registration.scale;
  map.offset = map.centre + registration.shift_px - map.linear * map.centre;
  return map;
}

cv::Mat LogOfLight(const cv::Mat& light) {
  constexpr double kDarkestLight = 1e-3;  // relative to full scale
  cv::Mat logs = cv::max(light, 0) + kDarkestLight;
  cv::log(logs, logs);
  return logs;
}

}  // namespace thicklens::calib
