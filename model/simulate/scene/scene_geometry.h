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
#include "model/simulate/scene/image_region.h"
#include "model/simulate/scene/scene_mask.h"
#include "model/simulate/scene/scene_texture.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::model {

// The name of a layer for messages.
std::string LayerPlace(std::size_t index, const SceneLayer& layer);

// A ray in front of the lens: its crossing of the aperture and its slope.
struct SceneRay {
  Eigen::Vector2d aperture_mm;
  Eigen::Vector2d slope;  // mm to the right and down per mm of depth

  Eigen::Vector2d PositionMm(double depth_mm) const { return aperture_mm + depth_mm * slope; }
};

// Depth z of the ray with z = z0 + g . (A + slope z), derived here [D38]: (z0 + g . A)/(1 - g .
// slope). Every ray meets a plane that has passed CheckPlane.
inline double HitDepthMm(const PlaneOptions& plane, const SceneRay& ray) {
  return (plane.depth_mm + plane.slope.dot(ray.aperture_mm)) / (1 - plane.slope.dot(ray.slope));
}

// The point that a ray meets.
struct SceneHit {
  std::size_t layer = 0;
  double depth_mm = std::numeric_limits<double>::infinity();
  // Position on its texture: (X, Y), mm; for a height field the chief position x', px.
  Eigen::Vector2d on_texture{0, 0};
};

// The rays of an image and the points that they meet. This class contains geometry only, no light.
class SceneGeometry {
 public:
  // Throws Error if a mask or a depth map does not fit its layer.
  explicit SceneGeometry(const SceneSimulationOptions& options,
                         const std::vector<LayerPixels>& pixels = {});

  const Sensor& sensor() const { return sensor_; }
  const std::vector<SceneLayer>& layers() const { return layers_; }
  // The height field of a layer with a depth map; null for a plane.
  const HeightField* height_field(std::size_t layer) const {
    return heights_[layer] ? &*heights_[layer] : nullptr;
  }
  // The mask of a layer whose outline is a mask.
  const SceneMask& mask(std::size_t layer) const { return *masks_[layer]; }
  double aperture_sigma_mm() const { return aperture_sigma_mm_; }  // value of kappa r
  double floor_px() const { return floor_px_; }
  double scale_px() const { return scale_px_; }  // value of K/p

  // The ray of an image position x, px, through A on the aperture, mm. Its slope is that of the
  // chief ray, (x - cx) p/K, minus A/zf: all rays of a position meet in the plane of focus.
  SceneRay RayAt(const Eigen::Vector2d& position_px, const Eigen::Vector2d& aperture_mm) const {
    return {aperture_mm,
            (position_px - sensor_.principal_point_px) / scale_px_ - aperture_mm / focus_depth_mm_};
  }
  // The inverse of RayAt: the image position of a ray.
  Eigen::Vector2d PositionOf(const SceneRay& ray) const {
    return sensor_.principal_point_px + scale_px_ * (ray.slope + ray.aperture_mm / focus_depth_mm_);
  }
  // The image position at which a chief ray shows a point.
  Eigen::Vector2d ChiefPositionPx(const Eigen::Vector2d& point_mm, double depth_mm) const {
    return sensor_.principal_point_px + scale_px_ / depth_mm * point_mm;
  }
  // Sigma of the defocus at a depth, px.
  double DefocusPx(double depth_mm) const;

  // Returns true if the layer's outline contains a point of its plane.
  bool IsInside(std::size_t layer, const Eigen::Vector2d& point_mm, double depth_mm) const;
  // Returns the point at which the ray meets the layer; the outline is ignored.
  SceneHit HitOn(std::size_t layer, const SceneRay& ray) const;
  // Returns the nearest point of all layers along the ray.
  SceneHit Trace(const SceneRay& ray) const;
  // Returns the nearest point of some layers.
  SceneHit Trace(const SceneRay& ray, const std::vector<std::size_t>& layers) const;

  // Both functions consider the points of the layer that chief rays through the region meet. Covers
  // is true only if the outline contains all of them. MayTouch is false only if it contains none.
  bool Covers(std::size_t layer, const ImageRegion& region) const;
  bool MayTouch(std::size_t layer, const ImageRegion& region) const;

  // Throws Error unless every ray meets the plane beyond the front focal point.
  void CheckPlane(const std::string& place, const PlaneOptions& plane) const;
  TextureRequest RequestFor(std::size_t layer) const;

 private:
  using BoxMm = std::pair<Eigen::Vector2d, Eigen::Vector2d>;

  void AddPixels(const Camera& camera, std::size_t layer, const LayerPixels& pixels);
  void Consider(const SceneRay& ray, std::size_t layer, SceneHit* nearest) const;
  ImageRegion WholeImage() const;
  ImageRegion ChiefRegion(const PlaneOptions& plane) const;
  std::vector<SceneRay> OutermostRays(double deviations) const;
  double CoarsestPixelMm(const PlaneOptions& plane) const;
  std::optional<BoxMm> BoxOf(const PlaneOptions& plane, const ImageRegion& region) const;
  std::optional<BoxMm> OutlineBox(std::size_t layer) const;

  std::vector<SceneLayer> layers_;
  std::vector<std::optional<SceneMask>> masks_;      // one entry per layer
  std::vector<std::optional<HeightField>> heights_;  // one entry per layer
  Sensor sensor_;
  double focal_mm_ = 0;
  double scale_px_ = 0;
  double focus_depth_mm_ = 0;
  double aperture_sigma_mm_ = 0;
  double floor_px_ = 0;
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SCENE_SCENE_GEOMETRY_H_
