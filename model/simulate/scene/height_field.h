#ifndef THICKLENS_MODEL_SIMULATE_SCENE_HEIGHT_FIELD_H_
#define THICKLENS_MODEL_SIMULATE_SCENE_HEIGHT_FIELD_H_

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "model/simulate/scene/picture_bounds.h"
#include "model/simulate/scene/picture_region.h"

namespace thicklens::model {

// Rays through what part of the aperture.
struct ApertureBox {
  Eigen::Vector2d low_mm{0, 0}, high_mm{0, 0};
};

// A surface that every chief ray meets once, in the coordinates of the picture: 1/z = W(x') at the
// chief position x', px, bilinear between pixel centres and beyond the outermost as there. A sheet
// of rubber: across an edge of depth it is stretched from one pixel to the next.
//
// Depth is given as a shift V = K/p (1/z - 1/zf) [D41], px per mm of aperture: what lies at x' is
// shown at x' - A V by rays through aperture position A (from X(z) of SceneSimulator, whose chief
// position is cx + K/p X(z)/z). The ray (x, A) passes the chief position x + A V at the shift V,
// and meets the sheet where V = V(x + A V): on each cell between four pixels the root of a
// quadratic equation.
class HeightField {
 public:
  // Depths in mm, > 0, rows top to bottom; K/p in px.
  HeightField(int width_px, int height_px, const std::vector<float>& depth_mm, double scale_px,
              double focus_depth_mm);

  double ShiftAt(const Eigen::Vector2d& position_px) const;
  double DepthMm(double shift) const { return 1 / (inverse_focus_per_mm_ + shift / scale_px_); }
  // Bounds of V over a region.
  ValueRange ShiftsOver(const PictureRegion& region) const { return shifts_.Over(region); }
  // No less than |grad V| anywhere in the region, and than the jumps of its components between
  // cells, px per mm per px.
  double SteepestOver(const PictureRegion& region) const;
  double SharpestOver(const PictureRegion& region) const { return bends_.Over(region).high; }

  // Bounds of the shifts at which rays of positions in the region meet the sheet. All positions
  // that such rays pass at these shifts lie in what Reached gives.
  ValueRange MetFrom(const PictureRegion& region, const ApertureBox& aperture) const;
  static PictureRegion Reached(const PictureRegion& region, const ApertureBox& aperture,
                               const ValueRange& shifts);

  // Along the ray (x, A) from one shift toward another, the first at which it meets the sheet; `to`
  // where it does not. From the upper end of MetFrom to the lower: what is seen.
  double FirstMet(const Eigen::Vector2d& position_px, const Eigen::Vector2d& aperture_mm,
                  double from, double to) const;
  // What is met first from a shift on, to nearer or farther, whichever is the side on which the ray
  // crosses the sheet within `bounds`. From the shift that the middle of the aperture sees: what is
  // seen if no part of the sheet hides another. Where a ray meets the sheet but once, the same.
  double MetNearShift(const Eigen::Vector2d& position_px, const Eigen::Vector2d& aperture_mm,
                      double shift, const ValueRange& bounds) const;

 private:
  struct Corners {
    double upper_left, upper_right, lower_left, lower_right;
  };

  double At(int x, int y) const;
  // Of the cell right of and below a pixel.
  Corners CornersOf(int x, int y) const;

  const int width_px_, height_px_;
  const double scale_px_, inverse_focus_per_mm_;
  const std::vector<double> shift_;
  const PictureBounds shifts_, slopes_, bends_;
  const ValueRange all_;  // of the shifts
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SCENE_HEIGHT_FIELD_H_
