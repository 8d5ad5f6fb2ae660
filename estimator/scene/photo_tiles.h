#ifndef THICKLENS_ESTIMATOR_SCENE_PHOTO_TILES_H_
#define THICKLENS_ESTIMATOR_SCENE_PHOTO_TILES_H_

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "thicklens/estimator/disparity_map.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::estimator {

// Encoded value from which a pixel is taken as clipped.
constexpr double kClippedValue = 0.99;
// Edge of a tile, px.
constexpr int kTilePx = 32;
// Frequencies are averaged in rings, one cycle per tile wide, and in three sectors: across, down,
// and between.
constexpr int kTileRings = 10, kTileSectors = 3, kTileBins = kTileRings * kTileSectors;

// The disparities of a tile, of as many parts of it of the same size.
constexpr int kTileDisparities = 4;
using TileDisparity = std::array<double, kTileDisparities>;

double RmsOf(const TileDisparity& disparity);

// The power spectrum of one tile of a grey image, and what the depth says of its blur.
struct PhotoTile {
  int x = 0, y = 0;                       // top-left pixel
  TileDisparity disparity{};              // in the unit of the map
  std::array<double, kTileBins> power{};  // mean of each bin, in squares of encoded values
  std::array<bool, kTileBins> is_used{};  // bins that the samples of the aperture represent
};

// The disparities that a map states for a tile; nothing where the tile shows several depths.
// `spread` converts a disparity to the standard deviation of its blur in px.
std::optional<TileDisparity> DisparityOfTile(const DisparityMap& map, int x, int y, double spread);

// Returns the tiles that show one depth, no clipped pixel and more than noise. Distance between
// tiles: `stride_px`.
std::vector<PhotoTile> TilesOf(const model::LinearImage& grey, const DisparityMap& map,
                               const model::TransferCurve& transfer, double noise_sigma,
                               double spread, int stride_px, int threads);

// Blurs of a whole photograph that are tried, px, and exponents of the power spectrum of its
// content.
constexpr std::array<double, 7> kCommonBlursPx = {0.25, 0.5, 0.65, 0.8, 1, 1.3, 1.8};
constexpr std::array<double, 6> kExponents = {0, 1, 1.7, 2.4, 3.1, 4};

// The expected spectra of tiles in each bin, by disparity, without amplitude and noise, as the
// window of a tile shows them.
class ExpectedSpectra {
 public:
  using Bins = std::array<double, kTileBins>;
  using Shapes = std::array<std::array<Bins, kExponents.size()>, kCommonBlursPx.size()>;
  // The aperture: as the views sample it, or a Gaussian of the same standard deviation, which is
  // that of a lens whose PSF is a Gaussian.
  enum class Aperture { kSampled, kGaussian };
  // `step`: of a map of disparities up to `largest`, in absolute values.
  ExpectedSpectra(Aperture aperture, const Eigen::ArrayXXd& weights, const Eigen::Vector2d& step,
                  double largest, int threads);
  // Returns the spectra for a share of the disparities of a tile, whatever their sign: the mean
  // over its parts.
  Shapes At(const TileDisparity& disparity, double share) const;

 private:
  double cell_ = 1;
  std::vector<Shapes> table_;
};

// Number of frequencies in each bin, of one half plane, and the mean of their radius, cycles/tile.
struct TileBin {
  double count = 0, radius = 0;
};
const std::array<TileBin, kTileBins>& TileBinsOf();

// Minus the logarithm of the likelihood of a tile's spectrum, for each blur of the whole
// photograph, without a constant that all have. Small is likely.
struct TileFit {
  std::array<double, kCommonBlursPx.size()> cost{};
  // Lowest deviance per degree of freedom over these.
  double overdispersion = 1;
};
// `noise_power`: the largest that is possible.
TileFit FitTile(const PhotoTile& tile, const ExpectedSpectra::Shapes& shapes, double noise_power);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_PHOTO_TILES_H_
