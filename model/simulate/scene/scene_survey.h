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

// Radiance of a ray that meets a layer, from its texture and its gloss: R, G, B and an unused
// number.
Eigen::Array4f LayerLight(const SceneGeometry& geometry, const SceneTexture& texture,
                          std::size_t layer, const SceneRay& ray,
                          const Eigen::Vector2d& on_texture);

// A block of an image's pixels, [x0, x1) x [y0, y1).
struct SceneBlock {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  std::vector<std::size_t> layers;  // all layers that its rays can meet
  double sigma_px = 0;              // maximum defocus of these layers
  // True if one of these is a height field so uneven that rays may meet it more than once.
  bool has_folds = false;
  // The content of the photograph there, one per channel.
  std::array<EffectSite, 3> places;
};

// Maximum distance, px, from a region of the image to the chief positions of the points that its
// rays meet on a layer or in its gloss. The rays land up to `landing_px` from their nominal
// positions and pass the aperture up to `deviations` of its standard deviations from its middle.
double ReachPx(const SceneGeometry& geometry, std::size_t layer, const ImageRegion& region,
               double landing_px, double deviations);
// Returns the layers that such rays can meet, in ascending order. Layers behind one that fills the
// region in reach are left out.
std::vector<std::size_t> MetLayers(const SceneGeometry& geometry, const ImageRegion& region,
                                   double landing_px, double deviations);

// The content of a scene at each place, determined before any image is computed: one ray for each
// quarter of a pixel, through the middle of the aperture.
class SceneSurvey {
 public:
  static constexpr int kBlockPx = 8;

  // `landing_px`: maximum distance of a ray's landing point from its pixel's centre.
  SceneSurvey(const Camera& camera, const SceneGeometry& geometry,
              const std::vector<SceneTexture>& textures, double landing_px, int threads);

  const std::vector<SceneBlock>& blocks() const { return blocks_; }
  // Index of the block that contains a pixel.
  std::size_t IndexAt(int x, int y) const {
    return static_cast<std::size_t>(y / kBlockPx) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(x / kBlockPx);
  }
  std::vector<EffectSite> Places() const;

 private:
  int columns_ = 0, rows_ = 0;
  std::vector<SceneBlock> blocks_;
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SCENE_SCENE_SURVEY_H_
