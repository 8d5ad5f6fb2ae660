#ifndef THICKLENS_ESTIMATOR_SCENE_TILE_RIPPLES_H_
#define THICKLENS_ESTIMATOR_SCENE_TILE_RIPPLES_H_

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <utility>
#include <vector>

#include "estimator/scene/lower_bounds.h"
#include "thicklens/estimator/disparity_map.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::estimator {

// An aperture has frequencies that it does not let through, and where they are depends on the
// blur alone. Content is smooth in frequency, so that these ripples show the blur of a tile, while
// how fast its spectrum falls may as well be its texture.

// Shape of an aperture whose standard deviation is that of the views.
enum class RippleAperture {
  kSampled,  // as the views sample it
  kSquare,   // a continuous rectangle
  kDisc,     // a continuous disc, an ellipse if the steps differ
};

// A tile of a photograph that shows one depth.
struct RippleTile {
  int x = 0, y = 0, size_px = 0;  // top-left pixel, and edge
  double disparity = 0;           // mean of its middle, px per view step
  double range = 0;               // of its disparities
};

// The image, in colour, and the disparity of its pixels.
struct RipplePhoto {
  model::LinearImage image;
  ClippedValues clipped;  // as in EstimateInput
  DisparityMap disparity;
  double scale = 1;  // px of the photograph per px of it
};

// Which tiles are looked at.
struct RippleTileRules {
  // The disparities of a tile differ by at most this, px per view step, and this share of their
  // mean.
  double range = 0.1, range_share = 0.15;
  // Tiles are chosen by the blur that the map states; false: by their place alone.
  bool by_blur = true;
};

// The evidence of tiles for a blur: how much likelier their spectra are with the ripples of a blur
// than without any, as a logarithm. A spectrum is
//
//   m(f) = K(f) exp(sum_i theta_i b_i(f)) + noise,  K = window * (abs(f)^-2.2 abs(T(f d))^2),
//
// T the transfer function of the aperture, b_i smooth functions: 1, log abs(f), f^2, the cosine and
// the sine of twice the direction, and these times log abs(f). theta and the noise, which is known
// within a fifth, are chosen for each blur, and once for K without T. The likelihood is that of
// exponentially distributed powers (Whittle). Frequencies beyond 0.55 periods per view step are
// left out: there the samples of an aperture are not the aperture. Derived here [D195].
class TileRipples {
 public:
  // `noise_sigma`: of one channel, in encoded values.
  TileRipples(const RipplePhoto& photo, const model::TransferCurve& transfer,
              const Eigen::ArrayXXd& weights, const RippleTileRules& rules, double noise_sigma,
              int threads);

  const std::vector<RippleTile>& tiles() const { return tiles_; }
  // Width of the blur of one px per view step, px of the photograph: of the square aperture of the
  // same standard deviation.
  double width_px() const { return width_; }
  // Finds the evidence for an aperture. It is kept.
  void Look(RippleAperture aperture);
  // The evidence of a tile for a disparity, px per view step. Beyond those that were tried it is
  // that of the nearest one; where no blur was stated, it is not above 0 there.
  double Of(std::size_t tile, double disparity) const;
  // The largest disparity that any tile can show, px per view step.
  double largest() const;
  // The part of the photograph to which a tile belongs, of 4 x 4.
  int PartOf(std::size_t tile) const;

 private:
  static constexpr std::size_t kSizes = 3;
  struct Frequencies;
  struct Spectrum;
  class Shapes;

  std::vector<double> LevelsOf(const Frequencies& frequencies) const;
  // The levels of a tile that are tried, from the first to the last.
  std::pair<std::size_t, std::size_t> LevelsAbout(const RippleTile& tile,
                                                  const std::vector<double>& levels) const;
  void FindTiles(const RipplePhoto& photo, const model::TransferCurve& transfer,
                 const RippleTileRules& rules, const Frequencies& frequencies, double noise_power,
                 int threads);

  Eigen::ArrayXXd weights_;
  Eigen::Vector2d step_{1, 1};  // relative to the larger one
  bool by_blur_ = true;
  double width_ = 0;
  int width_of_image_px_ = 0, height_of_image_px_ = 0, threads_ = 1;
  double noise_power_ = 0;
  std::vector<RippleTile> tiles_;
  std::vector<std::vector<double>> powers_;         // of each tile, by frequency
  std::array<std::vector<double>, kSizes> levels_;  // of each size of tile
  // Evidence of a tile for its levels from `first` on.
  struct TileEvidence {
    std::size_t first = 0;
    std::vector<double> of_level;
  };
  std::vector<TileEvidence> evidence_;  // of each tile
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_TILE_RIPPLES_H_
