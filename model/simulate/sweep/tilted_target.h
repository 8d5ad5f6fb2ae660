#ifndef THICKLENS_MODEL_SIMULATE_SWEEP_TILTED_TARGET_H_
#define THICKLENS_MODEL_SIMULATE_SWEEP_TILTED_TARGET_H_

#include <Eigen/Core>
#include <cmath>
#include <vector>

namespace thicklens::model {

// A flat target that is turned about the vertical line in which it meets the optical axis. With a
// positive tilt its right side is nearer to the camera: z = z0 - X tan(tilt). The chief ray of an
// image position x, px from the principal point, is X = s z with s = x/scale, scale = K/p. It meets
// the target (derived here, [D43]) at
//   z = z0/(1 + s tan(tilt)), xi = s z/cos(tilt) along the target and Y = (y/scale) z down.
// Positions on the target are (xi, Y), mm from the axis. Without tilt xi is X.
class TiltedTarget {
 public:
  // `enlarged`: factor of all positions on the target relative to those of the chief rays.
  TiltedTarget(double tilt_rad, double depth_mm, double scale_px, double enlarged = 1)
      : tangent_(std::tan(tilt_rad)),
        cosine_(std::cos(tilt_rad)),
        depth_mm_(depth_mm),
        scale_px_(scale_px),
        enlarged_(enlarged) {}

  // Nearness 1 + s tan(tilt): the depth on the axis over that of the column. A ray meets the target
  // where it is above 0.
  double Nearness(double x_px) const { return 1 + x_px / scale_px_ * tangent_; }
  double DepthMm(double x_px) const { return depth_mm_ / Nearness(x_px); }
  Eigen::Vector2d At(const Eigen::Vector2d& from_axis_px) const {
    const double pixel_mm = PixelDownMm(from_axis_px.x());
    return {from_axis_px.x() * pixel_mm / cosine_, from_axis_px.y() * pixel_mm};
  }
  // Size of one px on the target: across, d xi/dx = z0/(scale cos(tilt) (1 + s tan(tilt))^2), and
  // down.
  double PixelAcrossMm(double x_px) const { return PixelDownMm(x_px) / (cosine_ * Nearness(x_px)); }
  double PixelDownMm(double x_px) const { return enlarged_ * DepthMm(x_px) / scale_px_; }
  // Derivative dY/dx on a row: other columns show the target at another scale.
  double DownPerColumnMm(const Eigen::Vector2d& from_axis_px) const {
    return -from_axis_px.y() * PixelDownMm(from_axis_px.x()) * tangent_ /
           (scale_px_ * Nearness(from_axis_px.x()));
  }

 private:
  double tangent_, cosine_, depth_mm_, scale_px_, enlarged_;
};

// Neighbouring columns of an image that show the target at one scale and one blur.
struct ColumnStrip {
  int first = 0, count = 0;

  double middle_px() const { return first + (count - 1) / 2.0; }
};

// Returns the widest strips in which blur and position change by at most 0.01 px from the middle of
// a strip to its ends. They change by up to `change_px_per_px` from one column to the next.
std::vector<ColumnStrip> StripsOf(int width_px, double change_px_per_px);

// Returns columns, including the first and the last, between which an image with each column's own
// blur and scale is linear. For two waves of half a cycle per px that are d px apart, the mean has
// an error of (pi d)^2/8, like a displacement of (pi/8) d^2 = 0.01 px for d = 0.16 px.
std::vector<int> NodesOf(int width_px, double change_px_per_px);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SWEEP_TILTED_TARGET_H_
