#ifndef THICKLENS_MODEL_SIMULATE_SCENE_SCENE_MASK_H_
#define THICKLENS_MODEL_SIMULATE_SCENE_SCENE_MASK_H_

#include <Eigen/Core>
#include <vector>

#include "model/simulate/scene/picture_bounds.h"
#include "model/simulate/scene/picture_region.h"
#include "thicklens/model/scene.h"

namespace thicklens::model {

// An outline drawn as a picture: inside is where its values, bilinear between pixel centres and
// beyond the outermost as there, are at least half of full scale.
class SceneMask {
 public:
  // Grey, 1 at full scale. Throws Error if it has other channels, another size than the picture's,
  // or nothing inside; the message goes on after what `name` says.
  SceneMask(const LinearPicture& picture, int width_px, int height_px, const std::string& name);

  bool IsInside(const Eigen::Vector2d& position_px) const;
  // Of centre + (x_i, y_i), i < count.
  void AreInside(const Eigen::Vector2d& centre_px, const float* x_px, const float* y_px, int count,
                 bool* inside) const;
  // Whether all of the region is inside, and whether any of it may be; never true and never false,
  // respectively, where that is not so.
  bool Covers(const PictureRegion& region) const { return !(bounds_.Over(region).low < kHalf); }
  bool MayTouch(const PictureRegion& region) const { return bounds_.Over(region).high >= kHalf; }

  // The least region that holds what is inside. A side at which the mask's outermost pixels are
  // inside lies at infinity.
  const PictureRegion& extent() const { return extent_; }

 private:
  static constexpr double kHalf = 0.5;

  double At(int x, int y) const;
  void FindExtent();

  const int width_px_, height_px_;
  const std::vector<float> values_;
  const PictureBounds bounds_;
  PictureRegion extent_;
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SCENE_SCENE_MASK_H_
