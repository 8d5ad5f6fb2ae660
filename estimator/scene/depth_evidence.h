#ifndef THICKLENS_ESTIMATOR_SCENE_DEPTH_EVIDENCE_H_
#define THICKLENS_ESTIMATOR_SCENE_DEPTH_EVIDENCE_H_

#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "estimator/scene/lower_bounds.h"
#include "estimator/scene/photo_tiles.h"
#include "thicklens/estimator/depth_contradiction.h"
#include "thicklens/estimator/estimate_input.h"

namespace thicklens::estimator {

// A photograph in grey, reduced, with the disparity of its pixels.
struct ReducedPhoto {
  model::LinearImage grey;
  DisparityMap disparity;
  double scale = 1;            // px of the photograph per px of it
  ClippedValues clipped = {};  // pixels to which a lower bound contributed
};

// Returns the map in the order that a cause of kRows to kQuarterLeft, kShift or kSign asks for.
// `px`: of the photograph per px of the map, in which a shift is stated. A quarter turn needs a
// square map. Pixels that a shift leaves open repeat the border.
DisparityMap Reordered(const DisparityMap& map, const DepthCauseTrial& change, double px);

// How often edges of a depth map lie on edges of the photograph.
class EdgeCoincidence {
 public:
  EdgeCoincidence(const model::LinearImage& grey, const model::TransferCurve& transfer);
  struct Found {
    double sigmas = 0;           // at the place of the map, or within a px of it
    double coarse_sigmas = 0;    // on average within some px
    double best_sigmas = 0;      // at the best place within `reach` px
    int best_x = 0, best_y = 0;  // by which the map has to move to be there, px
    double opposite_sigmas = 0;  // at the best place on the opposite side of the map's
    // The edges are steps between the levels of slanted surfaces, or noise: they say nothing.
    bool is_unclear = false;
  };
  // Absent for maps without edges.
  std::optional<Found> Of(const DisparityMap& map, int reach_px) const;

 private:
  int width_px_, height_px_;
  std::vector<std::vector<float>> edges_;  // rank of the gradient, by its direction
};

// How likely the spectra of the tiles of a photograph are for another map.
class TileLikelihood {
 public:
  // Fewer tiles say nothing. Tiles with lower bounds are left out: where values are cut off, their
  // spectrum is not that of a blur.
  static constexpr std::size_t kMinTiles = 6;
  // `share`: of the disparities by which the photograph is blurred.
  TileLikelihood(const ReducedPhoto& photo, const EstimateInput& input, double share,
                 double noise_sigma, int threads);
  std::size_t tiles() const { return tiles_.size(); }
  double spread_px() const { return spread_; }
  // The standard deviations of the blur that the map predicts, px: the difference between those of
  // the tenth and of the ninetieth percentile of the tiles.
  double BlurRangePx() const;
  struct Gain {
    double mean = 0, sigma = 0;  // logarithm of the likelihood ratio, and its standard deviation
    int tiles = 0;               // number of tiles that were compared
  };
  // `other` returns the disparities of a tile in the other map, if it shows one depth there.
  using Other = std::function<std::optional<TileDisparity>(const PhotoTile&)>;
  std::optional<Gain> Against(const Other& other) const;
  Gain OfValues(double scale, double offset) const;  // in the unit of the map

 private:
  using Costs = std::array<double, kCommonBlursPx.size()>;
  Costs CostOf(std::size_t tile, const TileDisparity& disparity) const;
  int PartOf(const PhotoTile& tile) const;

  int width_px_, height_px_;
  double spread_ = 0, weight_ = 1;
  std::vector<PhotoTile> tiles_;
  std::vector<std::vector<Costs>> costs_;  // of each tile at each level of blur
  std::vector<Costs> given_;
};

// Sums of (H r - I)^2 of encoded values in blocks, for one map.
constexpr int kResidualBlockPx = 12;
struct ResidualBlocks {
  std::vector<double> squares;
};
ResidualBlocks ExplainedBy(const ReducedPhoto& photo, const DisparityMap& map,
                           const EstimateInput& input, double photo_aperture, int threads);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_DEPTH_EVIDENCE_H_
