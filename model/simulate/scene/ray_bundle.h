#ifndef THICKLENS_MODEL_SIMULATE_SCENE_RAY_BUNDLE_H_
#define THICKLENS_MODEL_SIMULATE_SCENE_RAY_BUNDLE_H_

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "model/simulate/scene/scene_geometry.h"

namespace thicklens::model {

// So many rays of a pixel are followed at once.
constexpr int kRaysAtOnce = 64;
// A number for each of them, at most kRaysAtOnce.
using RayNumbers = Eigen::Array<float, Eigen::Dynamic, 1, Eigen::ColMajor, kRaysAtOnce, 1>;

// Rays first .. first + count - 1 of a bundle, count <= kRaysAtOnce.
struct RayPart {
  Eigen::Index first = 0, count = 0;
};

// The chief ray of a pixel's centre, and where it meets a layer.
struct ChiefHit {
  Eigen::Vector2d slope{0, 0};
  double facing = 1;                 // 1 - g . slope
  double depth_mm = 0;               // of a plane, z0/facing
  Eigen::Vector2d on_texture{0, 0};  // as of SceneHit
  double shift = 0;                  // of a height field
  ValueRange shifts;                 // within which the pixel's rays meet the height field
  bool is_met_once = false;          // by each of these rays
};

// The rays of a pixel of a photograph, less its centre's chief ray, and what they meet. A ray
// (A, t + d) meets the plane z0 + g . X at z, the chief ray (0, t) at zc; derived here [D39]:
//   z - zc = (g . A + zc g . d)/(1 - g . t - g . d),
//   X - Xc = (A + z0 d) + (z - z0) d + (z - zc) t.
// Being differences, they lose nothing that matters in float. Height fields are searched ray by
// ray.
class RayBundle {
 public:
  // Without occlusion no part of a height field hides another.
  RayBundle(const SceneGeometry& geometry, const std::vector<SceneRay>& rays,
            bool occlusion = true);

  Eigen::Index size() const { return slope_x_.size(); }
  const std::vector<SceneRay>& rays() const { return rays_; }
  // All slopes d, as numbers.
  const Eigen::ArrayXf& slope_x() const { return slope_x_; }
  const Eigen::ArrayXf& slope_y() const { return slope_y_; }

  ChiefHit ChiefAt(const Eigen::Vector2d& centre_px, std::size_t layer) const;

  // Where a part of the rays meets a layer, less where the chief ray does.
  struct Meeting {
    RayNumbers x, y;       // on its texture: X - Xc, mm; of a height field x' - xc', px
    RayNumbers beyond_mm;  // z - zc
  };
  Meeting Meet(std::size_t layer, const ChiefHit& chief, const RayPart& part) const;

  // Which of some layers each ray of a part shows, as an index of `layers`.
  using Shown = std::array<std::size_t, kRaysAtOnce>;
  // The nearest along the ray.
  Shown NearestAlong(const Eigen::Vector2d& centre_px, const std::vector<std::size_t>& layers,
                     const std::vector<ChiefHit>& chiefs, const RayPart& part) const;
  // Without occlusion inside the aperture: of the surface layers[surface] the ray passes a point;
  // the nearest that the middle of the aperture sees there.
  Shown NearestFromMiddle(const Eigen::Vector2d& centre_px, const std::vector<std::size_t>& layers,
                          const std::vector<ChiefHit>& chiefs, std::size_t surface,
                          const RayPart& part) const;

 private:
  // Of one layer, of each ray.
  struct OnLayer {
    bool tilted = false;                // the two below are left out otherwise
    Eigen::ArrayXf across_x, across_y;  // A + z0 d, mm
    Eigen::ArrayXf lift, tilt;          // g . A, mm; g . d
  };

  Meeting MeetHeights(const HeightField& field, const ChiefHit& chief, const RayPart& part) const;
  // Where the picture shows what the rays meet, px from the pixel's centre.
  std::array<RayNumbers, 2> ChiefOffsetsPx(std::size_t layer, const ChiefHit& chief,
                                           const Meeting& meeting) const;

  const SceneGeometry& geometry_;
  const bool occlusion_;
  std::vector<SceneRay> rays_;
  std::vector<Eigen::Vector2d> landings_px_;  // of the rays, from the pixel's centre
  PictureRegion farthest_landing_{{0, 0}, {0, 0}};
  ApertureBox aperture_;  // that holds all of them
  Eigen::ArrayXf slope_x_, slope_y_;
  std::vector<OnLayer> on_layer_;
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SCENE_RAY_BUNDLE_H_
