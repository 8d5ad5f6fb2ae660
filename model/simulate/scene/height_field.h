#ifndef THICKLENS_MODEL_SIMULATE_SCENE_HEIGHT_FIELD_H_
#define THICKLENS_MODEL_SIMULATE_SCENE_HEIGHT_FIELD_H_

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "model/simulate/scene/image_bounds.h"
#include "model/simulate/scene/image_region.h"

namespace thicklens::model {

// The part of the aperture through which rays pass.
struct ApertureBox {
  Eigen::Vector2d low_mm{0, 0}, high_mm{0, 0};
};

// A surface that every chief ray meets once, in the coordinates of the image: 1/z = W(x') at the
// chief position x', px. W is bilinear between pixel centres and constant beyond the outermost
// ones. Across a depth edge the surface is stretched from one pixel to the next.
//
// Depth is given as a shift V = K/p (1/z - 1/zf) [D41], px per mm of aperture: rays through
// aperture position A show the point of x' at x' - A V (from X(z) of SceneSimulator, whose chief
// position is cx + K/p X(z)/z). The ray (x, A) passes the chief position x + A V at the shift V and
// meets the surface where V = V(x + A V). On each cell between four pixels this is the root of a
// quadratic equation.
class HeightField {
 public:
  // Depths in mm, > 0, rows top to bottom; `scale_px` is K/p.
  HeightField(int width_px, int height_px, const std::vector<float>& depth_mm, double scale_px,
              double focus_depth_mm);

  double ShiftAt(const Eigen::Vector2d& position_px) const;
  double DepthMm(double shift) const { return 1 / (inverse_focus_per_mm_ + shift / scale_px_); }
  // Bounds of V over a region.
  ValueRange ShiftsOver(const ImageRegion& region) const { return shifts_.Over(region); }
  // Upper bounds over the region, px per mm per px: SteepestOver of |grad V|, SharpestOver of the
  // jumps of its components between cells.
  double SteepestOver(const ImageRegion& region) const;
  double SharpestOver(const ImageRegion& region) const { return bends_.Over(region).high; }

  // IntersectionShiftBounds returns bounds of the shifts at which rays of positions in the region
  // meet the surface. ReachedRegion returns a region that contains all positions that such rays
  // pass at these shifts.
  ValueRange IntersectionShiftBounds(const ImageRegion& region, const ApertureBox& aperture) const;
  static ImageRegion ReachedRegion(const ImageRegion& region, const ApertureBox& aperture,
                                   const ValueRange& shifts);

  // Returns the first shift at which the ray (x, A) meets the surface on its way from one shift to
  // another, or `to` if it does not meet the surface. From the upper end of IntersectionShiftBounds
  // to the lower end, the result is the visible point.
  double FirstIntersection(const Eigen::Vector2d& position_px, const Eigen::Vector2d& aperture_mm,
                           double from, double to) const;
  // Returns the shift at which the ray first meets the surface from `shift` on. The search goes to
  // nearer or farther points, depending on the side on which the ray crosses the surface within
  // `bounds`. From the shift at the middle of the aperture, the result is the visible point if no
  // part of the surface occludes another. Where a ray meets the surface only once, it equals that
  // of FirstIntersection.
  double IntersectionNearShift(const Eigen::Vector2d& position_px,
                               const Eigen::Vector2d& aperture_mm, double shift,
                               const ValueRange& bounds) const;

 private:
  struct Corners {
    double upper_left, upper_right, lower_left, lower_right;
  };

  double At(int x, int y) const;
  // Corners of the cell to the right of and below a pixel.
  Corners CornersOf(int x, int y) const;

  const int width_px_, height_px_;
  const double scale_px_, inverse_focus_per_mm_;
  const std::vector<double> shift_;
  const ImageBounds shifts_, slopes_, bends_;
  const ValueRange all_;  // bounds of all shifts
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SCENE_HEIGHT_FIELD_H_
