#ifndef THICKLENS_MODEL_SIMULATE_SCENE_IMAGE_REGION_H_
#define THICKLENS_MODEL_SIMULATE_SCENE_IMAGE_REGION_H_

#include <Eigen/Core>
#include <array>

namespace thicklens::model {

// An upright rectangle of the image, px.
struct ImageRegion {
  Eigen::Vector2d low_px, high_px;

  ImageRegion Widened(double margin_px) const {
    return {low_px.array() - margin_px, high_px.array() + margin_px};
  }
  std::array<Eigen::Vector2d, 4> Corners() const {
    return {{low_px, {high_px.x(), low_px.y()}, {low_px.x(), high_px.y()}, high_px}};
  }
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SCENE_IMAGE_REGION_H_
