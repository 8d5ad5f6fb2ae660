#ifndef THICKLENS_MODEL_SIMULATE_SCENE_SCENE_GEOMETRY_H_
#define THICKLENS_MODEL_SIMULATE_SCENE_SCENE_GEOMETRY_H_

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "model/simulate/scene/height_field.h"
#include "model/simulate/scene/picture_region.h"
#include "model/simulate/scene/scene_mask.h"
#include "model/simulate/scene/scene_texture.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::model {

// For messages.
std::string LayerPlace(std::size_t index, const SceneLayer& layer);

// A ray in front of the lens: where it crosses the aperture, and its slope.
struct SceneRay {
  Eigen::Vector2d aperture_mm;
  Eigen::Vector2d slope;  // mm to the right and down per mm of depth

  Eigen::Vector2d PositionMm(double depth_mm) const { return aperture_mm + depth_mm * slope; }
};

// z of the ray with z = z0 + g . (A + slope z), derived here [D38]: (z0 + g . A)/(1 - g . slope). A
// plane that has passed CheckPlane is met by every ray.
inline double HitDepthMm(const PlaneOptions& plane, const SceneRay& ray) {
  return (plane.depth_mm + plane.slope.dot(ray.aperture_mm)) / (1 - plane.slope.dot(ray.slope));
}

// What a ray meets.
struct SceneHit {
  std::size_t layer = 0;
  double depth_mm = std::numeric_limits<double>::infinity();
  // Where its texture has it: (X, Y), mm; of a height field the chief position x', px.
  Eigen::Vector2d on_texture{0, 0};
};

// Where the rays of a picture run and what they meet: geometry alone, no light.
class SceneGeometry {
 public:
  // Throws Error if a mask or a depth map is not what it must be.
  explicit SceneGeometry(const SceneSimulationOptions& options,
                         const std::vector<LayerPixels>& pixels = {});

  const Sensor& sensor() const { return sensor_; }
  const std::vector<SceneLayer>& layers() const { return layers_; }
  // Of a layer that has one instead of a plane; else null.
  const HeightField* height_field(std::size_t layer) const {
    return heights_[layer] ? &*heights_[layer] : nullptr;
  }
  // Of a layer whose outline is one.
  const SceneMask& mask(std::size_t layer) const { return *masks_[layer]; }
  double aperture_sigma_mm() const { return aperture_sigma_mm_; }  // kappa r
  double floor_px() const { return floor_px_; }
  double scale_px() const { return scale_px_; }  // K/p

  // x of a picture position, px; A on the aperture, mm. The slope (x - cx) p/K of the chief ray
  // less A/zf: all rays of a position meet in the plane of focus.
  SceneRay RayAt(const Eigen::Vector2d& position_px, const Eigen::Vector2d& aperture_mm) const {
    return {aperture_mm,
            (position_px - sensor_.principal_point_px) / scale_px_ - aperture_mm / focus_depth_mm_};
  }
  // The position that RayAt has it of.
  Eigen::Vector2d PositionOf(const SceneRay& ray) const {
    return sensor_.principal_point_px + scale_px_ * (ray.slope + ray.aperture_mm / focus_depth_mm_);
  }
  // Where the picture shows what a point's chief ray meets.
  Eigen::Vector2d ChiefPositionPx(const Eigen::Vector2d& point_mm, double depth_mm) const {
    return sensor_.principal_point_px + scale_px_ / depth_mm * point_mm;
  }
  // Sigma of the defocus of a depth, px.
  double DefocusPx(double depth_mm) const;

  // Whether the layer's outline holds a point of its plane.
  bool IsInside(std::size_t layer, const Eigen::Vector2d& point_mm, double depth_mm) const;
  // Where the ray meets the layer, its outline left out.
  SceneHit HitOn(std::size_t layer, const SceneRay& ray) const;
  // The nearest of all layers along the ray.
  SceneHit Trace(const SceneRay& ray) const;
  // The nearest of some.
  SceneHit Trace(const SceneRay& ray, const std::vector<std::size_t>& layers) const;

  // Of what chief rays through the region meet of the layer: whether its outline holds all of it,
  // and whether it may hold any of it (false only if it does not).
  bool Covers(std::size_t layer, const PictureRegion& region) const;
  bool MayTouch(std::size_t layer, const PictureRegion& region) const;

  // Throws unless every ray meets the plane beyond the front focal point.
  void CheckPlane(const std::string& place, const PlaneOptions& plane) const;
  TextureRequest RequestFor(std::size_t layer) const;

 private:
  using BoxMm = std::pair<Eigen::Vector2d, Eigen::Vector2d>;

  void AddPixels(const Camera& camera, std::size_t layer, const LayerPixels& pixels);
  void Consider(const SceneRay& ray, std::size_t layer, SceneHit* nearest) const;
  PictureRegion WholePicture() const;
  PictureRegion ChiefRegion(const PlaneOptions& plane) const;
  std::vector<SceneRay> OutermostRays(double deviations) const;
  double CoarsestPixelMm(const PlaneOptions& plane) const;
  std::optional<BoxMm> BoxOf(const PlaneOptions& plane, const PictureRegion& region) const;
  std::optional<BoxMm> OutlineBox(std::size_t layer) const;

  std::vector<SceneLayer> layers_;
  std::vector<std::optional<SceneMask>> masks_;      // of the layers
  std::vector<std::optional<HeightField>> heights_;  // of the layers
  Sensor sensor_;
  double focal_mm_ = 0;
  double scale_px_ = 0;
  double focus_depth_mm_ = 0;
  double aperture_sigma_mm_ = 0;
  double floor_px_ = 0;
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SCENE_SCENE_GEOMETRY_H_
