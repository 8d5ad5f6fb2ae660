#ifndef THICKLENS_MODEL_SIMULATE_SCENE_SCENE_PHOTOGRAPH_H_
#define THICKLENS_MODEL_SIMULATE_SCENE_SCENE_PHOTOGRAPH_H_

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "model/simulate/scene/ray_bundle.h"
#include "model/simulate/scene/ray_set.h"
#include "model/simulate/scene/scene_geometry.h"
#include "model/simulate/scene/scene_survey.h"
#include "model/simulate/scene/scene_texture.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::model {

// Returns the spread of the rays of a pixel with the given effects on.
RaySpread SpreadOf(const SceneSimulationOptions& options, const EffectSet& on);

// The pixels of a photograph. Each is the mean of the number of rays that its block needs.
class ScenePhotograph {
 public:
  // All arguments except the options are kept by reference. `stored` converts light to stored
  // values.
  ScenePhotograph(const SceneSimulationOptions& options, const SceneGeometry& geometry,
                  const std::vector<SceneTexture>& textures, const SceneSurvey& survey,
                  const EffectSet& on, const TransferCurve& stored);

  Eigen::Array3d PixelAt(int x, int y) const;
  // Maximum rms error of the encoded values over all blocks; 255 is full scale.
  double sampling_error_grey_levels() const { return sampling_error_; }
  double mean_rays_per_pixel() const;

 private:
  struct RaySet {
    RayBundle rays;
    // The inverse of [S12] at the principal point, for each ray's position on the aperture.
    Eigen::ArrayXf exposure;
    Eigen::ArrayXf behind_x, behind_y;  // slope of each ray behind the lens times d1
  };

  // Returns the layers that rays of a region's pixels can show, in ascending order.
  std::vector<std::size_t> LayersFor(const ImageRegion& region, const RaySpread& spread) const;
  // Removes from the blocks the layers that no ray meets with these effects.
  void LookCloser(const RaySpread& spread);
  void MakeSets(const SceneSimulationOptions& options, const TransferCurve& stored);
  RaySet Prepared(const std::vector<PixelRay>& rays) const;
  double IrradianceSd(const SceneBlock& block) const;
  double Irradiance(const Eigen::Vector2d& position_px, const SceneRay& ray) const;
  // The mean of the weights is 1 at the principal point.
  RayNumbers Weights(const RaySet& set, const Eigen::Vector2d& centre_px,
                     const RayPart& part) const;
  struct Pixel {
    const SceneBlock& block;
    const RaySet& set;
    Eigen::Vector2d centre_px;
    std::vector<ChiefHit> chiefs;  // one per layer of the block
  };
  // Returns which of the block's layers each ray shows.
  RayBundle::Shown ShownBy(const Pixel& pixel, const RayPart& part) const;
  // Returns the weighted sum of the light of the rays that show the layer block.layers[which].
  Eigen::Array4f LayerSum(const Pixel& pixel, std::size_t which, const RayBundle::Shown& shown,
                          const RayPart& part, const RayNumbers& weights) const;

  const SceneGeometry& geometry_;
  const std::vector<SceneTexture>& textures_;
  const SceneSurvey& survey_;
  std::vector<SceneBlock> blocks_;
  const EffectSet on_;
  double irradiance_distance_mm_ = 0;
  std::vector<RaySet> sets_;
  std::vector<std::size_t> set_of_block_;
  double sampling_error_ = 0;
};

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SCENE_SCENE_PHOTOGRAPH_H_
