#ifndef THICKLENS_MODEL_SIMULATE_SCENE_RAY_BUNDLE_H_
#define THICKLENS_MODEL_SIMULATE_SCENE_RAY_BUNDLE_H_

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "model/simulate/scene/scene_geometry.h"

namespace thicklens::model {

// Number of rays of a pixel that are traced at once.
constexpr int kRaysAtOnce = 64;
// One number per ray, at most kRaysAtOnce.
using RayNumbers = Eigen::Array<float, Eigen::Dynamic, 1, Eigen::ColMajor, kRaysAtOnce, 1>;

// Rays first .. first + count - 1 of a bundle, count <= kRaysAtOnce.
struct RayPart {
  Eigen::Index first = 0, count = 0;
};

// The chief ray of a pixel's centre and the point at which it meets a layer.
struct ChiefHit {
  Eigen::Vector2d slope{0, 0};
  double facing = 1;                 // value of 1 - g . slope
  double depth_mm = 0;               // depth; for a plane z0/facing
  Eigen::Vector2d on_texture{0, 0};  // position on the texture, see SceneHit
  double shift = 0;                  // shift of a height field
  ValueRange shifts;         // bounds of the shifts at which the pixel's rays meet the height field
  bool is_met_once = false;  // true if each of these rays meets it once
};

// The rays of a pixel of a photograph relative to its centre's chief ray, and the points that they
// meet. A ray (A, t + d) meets the plane z0 + g . X at z, and the chief ray (0, t) meets it at zc;
// derived here [D39]:
//   z - zc = (g . A + zc g . d)/(1 - g . t - g . d),
//   X - Xc = (A + z0 d) + (z - z0) d + (z - zc) t.
// Because these are differences, float is precise enough. Height fields are searched ray by ray.
class RayBundle {
 public:
  // Without `occlusion`, no part of a height field occludes another. The bundle keeps the geometry
  // by reference.
  RayBundle(const SceneGeometry& geometry, const std::vector<SceneRay>& rays,
            bool occlusion = true);

  Eigen::Index size() const { return slope_x_.size(); }
  const std::vector<SceneRay>& rays() const { return rays_; }
  // The components of all slopes d.
  const Eigen::ArrayXf& slope_x() const { return slope_x_; }
  const Eigen::ArrayXf& slope_y() const { return slope_y_; }

  ChiefHit ChiefAt(const Eigen::Vector2d& centre_px, std::size_t layer) const;

  // The points at which some of the rays meet a layer, relative to that of the chief ray.
  struct Meeting {
    RayNumbers x, y;       // position on the texture: X - Xc, mm; for a height field x' - xc', px
    RayNumbers beyond_mm;  // depth difference z - zc
  };
  Meeting Meet(std::size_t layer, const ChiefHit& chief, const RayPart& part) const;

  // For each ray of a part, the layer that it shows, as an index of `layers`.
  using Shown = std::array<std::size_t, kRaysAtOnce>;
  // Returns the nearest layer along each ray.
  Shown NearestAlong(const Eigen::Vector2d& centre_px, const std::vector<std::size_t>& layers,
                     const std::vector<ChiefHit>& chiefs, const RayPart& part) const;
  // Without occlusion inside the aperture: the ray passes a point of the surface layers[surface],
  // and the function returns the nearest layer that the middle of the aperture sees at this point.
  Shown NearestFromMiddle(const Eigen::Vector2d& centre_px, const std::vector<std::size_t>& layers,
                          const std::vector<ChiefHit>& chiefs, std::size_t surface,
                          const RayPart& part) const;

 private:
  // Precomputed values of one layer, one per ray.
  struct OnLayer {
    bool tilted = false;                // lift and tilt are empty if false
    Eigen::ArrayXf across_x, across_y;  // values of A + z0 d, mm
    Eigen::ArrayXf lift, tilt;          // values of g . A, mm, and g . d
  };

  Meeting MeetHeights(const HeightField& field, const ChiefHit& chief, const RayPart& part) const;
  // The image positions at which chief rays show the points that the rays meet, px from the pixel's
  // centre.
  std::array<RayNumbers, 2> ChiefOffsetsPx(std::size_t layer, const ChiefHit& chief,
                                           const Meeting& meeting) const;

  const SceneGeometry& geometry_;
  const bool occlusion_;
  std::vector<SceneRay> rays_;
  std::vector<Eigen::Vector2d> landings_px_;  // landing points of the rays, relative to the pixel's
                                              // centre
  ImageRegion farthest_landing_{{0, 0}, {0, 0}};
  ApertureBox aperture_;  // bounding box of the aperture positions of all rays
  Eigen::ArrayXf slope_x_, slope_y_;
  std::vector<OnLayer> on_layer_;
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SCENE_RAY_BUNDLE_H_
