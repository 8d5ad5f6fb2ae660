#ifndef THICKLENS_MODEL_SIMULATE_SCENE_SCENE_SURVEY_H_
#define THICKLENS_MODEL_SIMULATE_SCENE_SCENE_SURVEY_H_

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "model/simulate/scene/scene_geometry.h"
#include "model/simulate/scene/scene_texture.h"
#include "thicklens/model/effect_impact.h"

namespace thicklens::model {

// Radiance of a ray that meets a layer: its texture and the gloss on it; R, G, B and a number that
// means nothing.
Eigen::Array4f LayerLight(const SceneGeometry& geometry, const SceneTexture& texture,
                          std::size_t layer, const SceneRay& ray,
                          const Eigen::Vector2d& on_texture);

// A block of a picture's pixels, [x0, x1) x [y0, y1).
struct SceneBlock {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  std::vector<std::size_t> layers;  // all that its rays can meet
  double sigma_px = 0;              // the largest defocus of these
  // One of these is a height field so uneven that rays may meet it more than once.
  bool has_folds = false;
  // What is photographed there, of each channel.
  std::array<EffectPlace, 3> places;
};

// How far from a region of the picture the chief positions of what its rays meet on a layer, or in
// its gloss, may lie, px, if they land up to `landing_px` from where they would and go through the
// aperture up to so many of its standard deviations from its middle.
double ReachPx(const SceneGeometry& geometry, std::size_t layer, const PictureRegion& region,
               double landing_px, double deviations);
// The layers that such rays can meet, in ascending order: not those that lie behind one that fills
// what they reach.
std::vector<std::size_t> MetLayers(const SceneGeometry& geometry, const PictureRegion& region,
                                   double landing_px, double deviations);

// What a scene holds where, found before any picture is taken: by one ray for each quarter of a
// pixel, through the middle of the aperture.
class SceneSurvey {
 public:
  static constexpr int kBlockPx = 8;

  // `landing_px`: how far from its pixel's centre a ray may land.
  SceneSurvey(const Camera& camera, const SceneGeometry& geometry,
              const std::vector<SceneTexture>& textures, double landing_px, int threads);

  const std::vector<SceneBlock>& blocks() const { return blocks_; }
  // Of the block that holds a pixel.
  std::size_t IndexAt(int x, int y) const {
    return static_cast<std::size_t>(y / kBlockPx) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(x / kBlockPx);
  }
  std::vector<EffectPlace> Places() const;

 private:
  int columns_ = 0, rows_ = 0;
  std::vector<SceneBlock> blocks_;
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SCENE_SCENE_SURVEY_H_
