#include "calib/registration/change_of_reference.h"

#include <cmath>

namespace thicklens::calib {

void ReferTo(Registration base, std::vector<ScaleSample>* samples) {
  for (ScaleSample& sample : *samples) {
    Registration& r = sample.registration;
    const double ratio = r.scale / base.scale;
    const double angle = r.rotation_rad - base.rotation_rad;
    const double c = std::cos(angle), s = std::sin(angle);
    const Eigen::Vector2d turned(c * base.shift_px.x() - s * base.shift_px.y(),
                                 s * base.shift_px.x() + c * base.shift_px.y());
    r.shift_px -= ratio * turned;
    r.scale = ratio;
    r.scale_x /= base.scale_x;
    r.scale_y /= base.scale_y;
    r.rotation_rad = angle;
    sample.scale = ratio;
  }
}

}  // namespace thicklens::calib
