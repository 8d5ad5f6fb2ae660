#ifndef THICKLENS_MODEL_SIMULATE_SCENE_SCENE_MASK_H_
#define THICKLENS_MODEL_SIMULATE_SCENE_SCENE_MASK_H_

#include <Eigen/Core>
#include <vector>

#include "model/simulate/scene/image_bounds.h"
#include "model/simulate/scene/image_region.h"
#include "thicklens/model/scene.h"

namespace thicklens::model {

// An outline that is drawn as an image. Its values are bilinear between pixel centres and constant
// beyond the outermost ones; a position is inside where the value is at least half of full scale.
class SceneMask {
 public:
  // `image` is grey, 1 at full scale. Throws Error if it has several channels, a size other than
  // the scene's or nothing inside; the message begins with `name`.
  SceneMask(const LinearImage& image, int width_px, int height_px, const std::string& name);

  bool IsInside(const Eigen::Vector2d& position_px) const;
  // Tests the positions centre + (x_i, y_i), i < count.
  void AreInside(const Eigen::Vector2d& centre_px, const float* x_px, const float* y_px, int count,
                 bool* inside) const;
  // Covers is true only if the whole region is inside. MayTouch is false only if no position of the
  // region is inside.
  bool Covers(const ImageRegion& region) const { return !(bounds_.Over(region).low < kHalf); }
  bool MayTouch(const ImageRegion& region) const { return bounds_.Over(region).high >= kHalf; }

  // The smallest region that contains all inside positions. A side is at infinity if the outermost
  // pixels of the mask on that side are inside.
  const ImageRegion& extent() const { return extent_; }

 private:
  static constexpr double kHalf = 0.5;

  double At(int x, int y) const;
  void FindExtent();

  const int width_px_, height_px_;
  const std::vector<float> values_;
  const ImageBounds bounds_;
  ImageRegion extent_;
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SCENE_SCENE_MASK_H_
