#include "thicklens/estimator/photo_aperture.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>

#include "estimator/scene/coarse_start.h"
#include "estimator/scene/lower_bounds.h"
#include "estimator/scene/photo_tiles.h"
#include "estimator/scene/scene_data.h"
#include "estimator/views/input_checks.h"
#include "estimator/views/option_checks.h"
#include "estimator/views/ray_landing.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/run_cost.h"
#include "thicklens/estimator/scene_solver.h"

namespace thicklens::estimator {
namespace {

constexpr double kMaxPixels = 1 << 20;
constexpr double kMinNoise = 0.29 / 255;
// Shares that are tried: up to 1.3, because a photograph may be blurred more than predicted.
constexpr int kShares = 14;
constexpr double kShareStep = 0.1;
constexpr std::size_t kWhole = 10;  // index of the share 1
double ShareAt(std::size_t i) { return static_cast<double>(i) * kShareStep; }
// The most that one tile says for one share against another.
constexpr double kMaxOfTile = 4;
// Overlapping tiles repeat half of each other.
constexpr double kOverlapWeight = 0.5;
constexpr std::size_t kFewTiles = 150, kMaxTiles = 128;
constexpr int kPartsAlong = 4;
// Fewer tiles do not show what is usual in the photograph.
constexpr int kMinTiles = 6;
// Textures differ from the power law, and from each other in their sharpness: the error of the
// share, and that of the variance of the blur in px^2, which this leaves.
constexpr double kSystematic = 0.05;
constexpr double kSystematicPx2 = 0.25;
// Standard deviations within which a share is consistent with 0 or 1.
constexpr double kConsistent = 2;
// Logarithm of the likelihood that excludes a share: three standard deviations.
constexpr double kExcluded = 4.5;
// A measured share is in doubt unless it is likelier by this than another map with the whole
// aperture.
constexpr double kLikelier = 3;
// Less than the whole aperture by so little is not worth it.
constexpr double kNearlyWhole = 0.85;
// The largest share that may be none, however uncertain it is.
constexpr double kMaxOfSharp = 0.45;
// The largest uncertainty of a share that is used.
constexpr double kMaxSigma = 0.15;

// The image on which the share is measured: grey, of at most a million pixels. A pixel with a
// clipped channel is clipped in it.
struct Looked {
  model::LinearImage grey;
  DisparityMap disparity;
  double scale = 1;  // px of the photograph per px of it
};

model::LinearImage GreyOf(const model::LinearImage& image, double clipped) {
  if (image.channels < 3) return image;
  model::LinearImage grey{image.width_px, image.height_px, 1, {}};
  grey.values.reserve(Index(image.width_px) * Index(image.height_px));
  const auto channels = Index(image.channels);
  for (std::size_t i = 0; i < image.values.size(); i += channels) {
    const float red = image.values[i], green = image.values[i + 1], blue = image.values[i + 2];
    const float mean = 0.2126F * red + 0.7152F * green + 0.0722F * blue;
    const float largest = std::max({red, green, blue});
    grey.values.push_back(static_cast<double>(largest) >= clipped ? std::max(largest, mean) : mean);
  }
  return grey;
}

// Sets the pixels that are only lower bounds to full scale: a level of clipping may be lower.
void MarkClipped(const ClippedValues& clipped, model::LinearImage* grey) {
  for (std::size_t i = 0; i < clipped.size(); ++i) {
    if (clipped[i] != 0) grey->values[i] = std::max(grey->values[i], 1.0F);
  }
}

Looked LookedAt(const EstimateInput& input) {
  Looked looked{GreyOf(input.image, input.transfer.Decode(kClippedValue)), input.disparity, 1};
  ClippedValues clipped;
  if (looked.grey.channels == 1) clipped = InAnyChannel(input.clipped, input.image.channels);
  MarkClipped(clipped, &looked.grey);
  if (input.grid) {
    looked.disparity =
        PhotographDisparity(input.disparity, LandingStepPx(*input.camera, *input.grid));
  }
  while (1.0 * looked.grey.width_px * looked.grey.height_px > kMaxPixels) {
    clipped = HalfSize(clipped, looked.grey.width_px, looked.grey.height_px, 1);
    looked.grey = HalfSize(looked.grey);
    MarkClipped(clipped, &looked.grey);
    looked.disparity = HalfSize(looked.disparity);
    looked.scale *= 2;
  }
  return looked;
}

// Standard deviation of the blur, px, of a disparity of 1 in the map's unit.
double SpreadPx(const DisparityMap& map, const Eigen::ArrayXXd& weights) {
  DisparityMap unit{1, 1, {1.0F}, map.step};
  return static_cast<double>(BlurSigmaPx(unit, weights).front());
}

// Costs of one tile: by common blur and share.
using Costs = std::array<std::array<double, kShares>, kCommonBlursPx.size()>;

double LowestOf(const Costs& costs) {
  double lowest = std::numeric_limits<double>::infinity();
  for (const auto& of_blur : costs)
    lowest = std::min(lowest, *std::min_element(of_blur.begin(), of_blur.end()));
  return lowest;
}

// The tiles with their costs for one form of the aperture.
struct TileCosts {
  std::vector<Costs> costs;
  std::vector<double> lowest;  // of each tile, for any form of the aperture
  double weight = 1;           // of a tile
};

struct ShareFit {
  double share = 0, sigma = 0;
  double against_whole = 0, against_sharp = 0;
  double cost = 0;
  std::size_t common_blur = 0;
};

// Returns the share of the smallest sum of costs over some tiles, with the standard deviation by
// the shares that cost 2 more.
ShareFit FitShare(const TileCosts& tiles, const std::function<bool(std::size_t)>& is_used) {
  ShareFit fit;
  std::array<double, kShares> line{};
  line.fill(std::numeric_limits<double>::infinity());
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t blur = 0; blur < kCommonBlursPx.size(); ++blur) {
    std::array<double, kShares> sums{};
    for (std::size_t i = 0; i < tiles.costs.size(); ++i) {
      if (!is_used(i)) continue;
      for (std::size_t s = 0; s < kShares; ++s) {
        sums[s] += tiles.weight * std::min(kMaxOfTile, tiles.costs[i][blur][s] - tiles.lowest[i]);
      }
    }
    for (std::size_t s = 0; s < kShares; ++s) line[s] = std::min(line[s], sums[s]);
    const double lowest = *std::min_element(sums.begin(), sums.end());
    if (lowest < least) {
      least = lowest;
      fit.common_blur = blur;
    }
  }
  const auto at =
      static_cast<std::size_t>(std::min_element(line.begin(), line.end()) - line.begin());
  fit.share = ShareAt(at);
  fit.cost = line[at];
  if (at > 0 && at + 1 < kShares) {  // the vertex of the parabola
    const double curvature = line[at - 1] - 2 * line[at] + line[at + 1];
    const double offset = curvature > 0 ? (line[at - 1] - line[at + 1]) / (2 * curvature) : 0;
    fit.share += kShareStep * offset;
    fit.cost -= (line[at - 1] - line[at + 1]) * offset / 4;
  }
  constexpr double kTwoSigma = 2;
  const auto deviation = [&](int direction) -> double {
    double last = fit.share, last_cost = fit.cost;
    for (int s = static_cast<int>(at) + direction; s >= 0 && s < kShares; s += direction) {
      const double cost = line[Index(s)];
      if (cost >= fit.cost + kTwoSigma) {
        const double share = (fit.cost + kTwoSigma - last_cost) / std::max(1e-9, cost - last_cost);
        return std::abs(last + (ShareAt(Index(s)) - last) * share - fit.share) / 2;
      }
      last = ShareAt(Index(s));
      last_cost = std::max(last_cost, cost);
    }
    return direction < 0 ? 0 : 1;  // no share below 0; nothing is known above
  };
  fit.sigma = std::max(deviation(-1), deviation(1));
  fit.against_whole = line[kWhole] - fit.cost;
  fit.against_sharp = line[0] - fit.cost;
  return fit;
}

// The photograph as it is looked at, its tiles, and the likelihood of their spectra.
class Measurement {
 public:
  Measurement(const EstimateInput& input, double compression_sigma, int threads)
      : input_(input), threads_(threads), looked_(LookedAt(input)) {
    noise_ = std::hypot(
        std::max(EncodedNoiseSigma(looked_.grey, input.transfer).value_or(1.0 / 255), kMinNoise),
        compression_sigma / looked_.scale);
    spread_ = SpreadPx(looked_.disparity, input.weights);
    FindTiles(kTilePx);
    if (tiles_.size() < kFewTiles) {
      weight_ = kOverlapWeight;
      FindTiles(kTilePx / 2);
    }
    // Tiles of all strengths of blur: the weak ones show the blur that all have.
    std::stable_sort(tiles_.begin(), tiles_.end(), [](const PhotoTile& a, const PhotoTile& b) {
      return RmsOf(a.disparity) > RmsOf(b.disparity);
    });
    if (tiles_.size() > kMaxTiles) {
      for (std::size_t i = 0; i < kMaxTiles; ++i) tiles_[i] = tiles_[i * tiles_.size() / kMaxTiles];
      tiles_.resize(kMaxTiles);
    }
  }

  const std::vector<PhotoTile>& tiles() const { return tiles_; }
  // Standard deviation of the predicted blur of a tile, in px of the photograph.
  double PredictedPx(const PhotoTile& tile) const {
    return spread_ * RmsOf(tile.disparity) * looked_.scale;
  }
  // Mean variance of the predicted blur, px^2 of the image that is looked at, of the quarter of the
  // tiles with the strongest, which decide.
  double MeanSquaredBlur() const {
    const std::size_t count = (tiles_.size() + 3) / 4;
    double sum = 0;
    for (std::size_t i = 0; i < count; ++i)
      sum += std::pow(spread_ * RmsOf(tiles_[i].disparity), 2);
    return count == 0 ? 0 : sum / static_cast<double>(count);
  }
  // Whether any blur is predicted: views of one point of the aperture have none.
  bool IsBlurred() const {
    return spread_ > 0 &&
           std::any_of(looked_.disparity.disparity.begin(), looked_.disparity.disparity.end(),
                       [](float value) { return value != 0; });
  }
  double scale() const { return looked_.scale; }
  int width_px() const { return looked_.grey.width_px; }
  int height_px() const { return looked_.grey.height_px; }

  // Finds the costs for one form of the aperture, and keeps them.
  void Try(ExpectedSpectra::Aperture aperture) {
    double largest = 0;
    for (const PhotoTile& tile : tiles_) largest = std::max(largest, RmsOf(tile.disparity));
    Tried& tried = tried_.emplace_back();
    tried.spectra.emplace(aperture, input_.weights, looked_.disparity.step,
                          1.5 * largest + kMaxOffsetPx / spread_, threads_);
    tried.raw.resize(tiles_.size());
    overdispersion_.resize(tiles_.size(), std::numeric_limits<double>::infinity());
    ParallelFor(static_cast<int>(tiles_.size()), threads_, [&](int i) {
      ThrowIfCancelled();
      for (std::size_t s = 0; s < kShares; ++s) {
        const TileFit fit = FitOf(tried, Index(i), tiles_[Index(i)].disparity, ShareAt(s));
        overdispersion_[Index(i)] = std::min(overdispersion_[Index(i)], fit.overdispersion);
        for (std::size_t blur = 0; blur < kCommonBlursPx.size(); ++blur)
          tried.raw[Index(i)][blur][s] = fit.cost[blur];
      }
    });
  }

  // Returns the costs of the form that explains the photograph best, and its index in `best`.
  TileCosts Best(std::size_t* best) const {
    TileCosts costs;
    costs.weight = weight_;
    costs.lowest.resize(tiles_.size(), std::numeric_limits<double>::infinity());
    for (const Tried& tried : tried_) {
      for (std::size_t i = 0; i < tiles_.size(); ++i) {
        costs.lowest[i] = std::min(costs.lowest[i], LowestOf(tried.raw[i]) / overdispersion_[i]);
      }
    }
    double least = std::numeric_limits<double>::infinity();
    TileCosts found;
    for (std::size_t form = 0; form < tried_.size(); ++form) {
      costs.costs = tried_[form].raw;
      for (std::size_t i = 0; i < tiles_.size(); ++i) {
        for (auto& of_blur : costs.costs[i]) {
          for (double& cost : of_blur) cost /= overdispersion_[i];
        }
      }
      const double cost = FitShare(costs, [](std::size_t) { return true; }).cost;
      if (cost < least) {
        least = cost;
        *best = form;
        found = costs;
      }
    }
    return found;
  }

  // Returns how much likelier the whole aperture with another map is than the fit, by the tiles
  // that show one depth in both. `other` returns the disparities of a tile in that map.
  double LikelierBy(const TileCosts& costs, std::size_t form,
                    const std::function<std::optional<TileDisparity>(const PhotoTile&)>& other) {
    std::vector<std::optional<std::array<double, kCommonBlursPx.size()>>> of_other(tiles_.size());
    ParallelFor(static_cast<int>(tiles_.size()), threads_, [&](int i) {
      ThrowIfCancelled();
      const std::optional<TileDisparity> disparity = other(tiles_[Index(i)]);
      if (disparity) of_other[Index(i)] = FitOf(tried_[form], Index(i), *disparity, 1).cost;
    });
    // Without tiles that show one depth in both maps, nothing was compared.
    if (std::count_if(of_other.begin(), of_other.end(),
                      [](const auto& cost) { return cost.has_value(); }) < kMinTiles)
      return -std::numeric_limits<double>::infinity();
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t blur = 0; blur < kCommonBlursPx.size(); ++blur) {
      double sum = 0;
      for (std::size_t i = 0; i < tiles_.size(); ++i) {
        if (!of_other[i]) continue;
        const double cost = (*of_other[i])[blur] / overdispersion_[i];
        // A tile that the other map explains better than any share counts for it, within limits.
        sum += weight_ * std::clamp(cost - costs.lowest[i], -kMaxOfTile, kMaxOfTile);
      }
      least = std::min(least, sum);
    }
    return FitShare(costs, [&](std::size_t i) { return of_other[i].has_value(); }).cost - least;
  }

  // Returns how much likelier the best of the reversed maps, and of the offsets, is.
  double LikelierReversed(const TileCosts& costs, std::size_t form) {
    double most = -std::numeric_limits<double>::infinity();
    for (const model::DepthFlip flip :
         {model::DepthFlip::kRows, model::DepthFlip::kColumns, model::DepthFlip::kBoth}) {
      DisparityMap map = looked_.disparity;
      model::FlipDepth(flip, map.width_px, &map.disparity);
      most = std::max(most, LikelierBy(costs, form, [&](const PhotoTile& tile) {
                        return DisparityOfTile(map, tile.x, tile.y, spread_);
                      }));
    }
    return most;
  }
  double LikelierOffset(const TileCosts& costs, std::size_t form) {
    double most = -std::numeric_limits<double>::infinity();
    for (int i = 1; i <= kOffsets; ++i) {
      for (const int sign : {-1, 1}) {
        const double offset = sign * i * kMaxOffsetPx / kOffsets / spread_;
        most = std::max(most, LikelierBy(costs, form, [offset](const PhotoTile& tile) {
                          TileDisparity disparity = tile.disparity;
                          for (double& part : disparity) part += offset;
                          return std::optional(disparity);
                        }));
      }
    }
    return most;
  }

  // Part of the photograph to which a tile belongs.
  int PartOf(const PhotoTile& tile) const {
    return (tile.y + kTilePx / 2) * kPartsAlong / height_px() * kPartsAlong +
           (tile.x + kTilePx / 2) * kPartsAlong / width_px();
  }

 private:
  // Offsets that are tried, as the standard deviation of the blur that they cause.
  static constexpr double kMaxOffsetPx = 2;
  static constexpr int kOffsets = 4;

  struct Tried {
    std::optional<ExpectedSpectra> spectra;
    std::vector<Costs> raw;
  };

  void FindTiles(int stride_px) {
    tiles_ = TilesOf(looked_.grey, looked_.disparity, input_.transfer, noise_, spread_, stride_px,
                     threads_);
  }
  TileFit FitOf(const Tried& tried, std::size_t tile, const TileDisparity& disparity,
                double share) const {
    return FitTile(tiles_[tile], tried.spectra->At(disparity, share), noise_ * noise_);
  }

  const EstimateInput& input_;
  const int threads_;
  const Looked looked_;
  double noise_ = 0, spread_ = 0, weight_ = 1;
  std::vector<PhotoTile> tiles_;
  std::vector<Tried> tried_;
  std::vector<double> overdispersion_;
};

// Returns the standard deviation of a share by a delete-one jackknife over parts, and records the
// parts.
double Jackknife(const Measurement& measurement, const TileCosts& costs, PhotoAperture* found) {
  const std::vector<PhotoTile>& tiles = measurement.tiles();
  std::vector<double> without;
  for (int part = 0; part < kPartsAlong * kPartsAlong; ++part) {
    const auto is_in = [&](std::size_t i) { return measurement.PartOf(tiles[i]) == part; };
    PhotoAperture::Region region;
    double squares = 0;
    for (std::size_t i = 0; i < tiles.size(); ++i) {
      if (!is_in(i)) continue;
      ++region.tiles;
      squares += std::pow(measurement.PredictedPx(tiles[i]), 2);
    }
    if (region.tiles == 0) continue;
    without.push_back(FitShare(costs, [&](std::size_t i) { return !is_in(i); }).share);
    const ShareFit own = FitShare(costs, is_in);
    const auto edge = [&](int index, int size_px) {
      return static_cast<int>(index * size_px * measurement.scale() / kPartsAlong);
    };
    region.x = edge(part % kPartsAlong, measurement.width_px());
    region.y = edge(part / kPartsAlong, measurement.height_px());
    region.width_px = edge(part % kPartsAlong + 1, measurement.width_px()) - region.x;
    region.height_px = edge(part / kPartsAlong + 1, measurement.height_px()) - region.y;
    region.predicted_sigma_px = std::sqrt(squares / region.tiles);
    if (own.sigma < 1) {
      region.share = own.share;
      region.sigma = std::hypot(own.sigma, kSystematic);
    }
    found->regions.push_back(region);
  }
  const auto parts = static_cast<double>(without.size());
  if (without.size() < 2) return 1;
  double mean = 0, scatter = 0;
  for (const double share : without) mean += share / parts;
  for (const double share : without) scatter += (share - mean) * (share - mean);
  return std::sqrt(scatter * (parts - 1) / parts);
}

void Decide(PhotoAperture* found) {
  using Verdict = PhotoAperture::Verdict;
  // Shares above are not tried.
  constexpr double kMaxShare = (kShares - 1.5) * kShareStep;
  const std::string measured =
      *found->share < kMaxShare
          ? fmt::format("{:.2f} +- {:.2f} of the predicted blur", *found->share, *found->sigma)
          : fmt::format("at least {:.3g} of the predicted blur", kMaxShare);
  if (found->evidence_against_captured <= kExcluded && found->evidence_against_sharp <= kExcluded) {
    found->verdict = Verdict::kUndecided;
    found->message = fmt::format(
        "the photograph does not show how much of the predicted blur it has: its {} textured "
        "tile(s) are blurred by at most {:.2g} px, or too smooth",
        found->tiles, found->largest_sigma_px);
  } else if (!found->is_narrower()) {
    // A blur that is much too wide, with sharp details besides, is nobody's aperture; a share that
    // is both unlike 1 and too uncertain to differ from it shows nothing.
    const bool is_clear =
        found->evidence_against_sharp > kExcluded &&
        (found->evidence_against_captured <= kExcluded || *found->share >= kNearlyWhole);
    found->verdict = is_clear ? Verdict::kCaptured : Verdict::kUndecided;
    found->message =
        is_clear ? "the photograph shows " + measured
                 : fmt::format("the photograph shows {}, too uncertain to be used", measured);
  } else if (*found->share < kMaxOfSharp &&
             *found->share * *found->share <= kConsistent * found->sigma_of_square) {
    found->verdict = Verdict::kSharp;
    found->message = fmt::format(
        "the photograph is sharp at all depths: it shows {}, which is consistent with none",
        measured);
  } else if (*found->sigma <= kMaxSigma) {
    found->verdict = Verdict::kPartial;
    found->message = fmt::format(
        "the photograph shows {}: a smaller aperture, or a scale of the depth that is too large",
        measured);
  } else {
    found->verdict = Verdict::kUndecided;
    found->message = fmt::format(
        "the photograph shows less blur than predicted, {}, too uncertain to be used", measured);
  }
}

}  // namespace

double PhotoAperture::used_share() const {
  return verdict == Verdict::kSharp ? 0 : verdict == Verdict::kPartial ? *share : 1;
}

bool PhotoAperture::is_narrower() const {
  return share && *share * *share + kConsistent * sigma_of_square < 1 && *share < kNearlyWhole &&
         evidence_against_captured > kExcluded;
}

bool PhotoApertureOptions::IsValid(std::string* why) const {
  return IsAtLeast(0, "threads", threads, why) &&
         IsNonNegative("compression_sigma", compression_sigma, why);
}

std::string PhotoVerdictName(PhotoAperture::Verdict verdict) {
  switch (verdict) {
    case PhotoAperture::Verdict::kCaptured:
      return "captured";
    case PhotoAperture::Verdict::kSharp:
      return "sharp";
    case PhotoAperture::Verdict::kPartial:
      return "partial";
    case PhotoAperture::Verdict::kUndecided:
      return "undecided";
    case PhotoAperture::Verdict::kContradicted:
      return "contradicted";
    case PhotoAperture::Verdict::kNotMeasured:
      break;
  }
  return "not measured";
}

PhotoAperture MeasurePhotoAperture(const EstimateInput& input,
                                   const PhotoApertureOptions& options) {
  CheckOptions("photo aperture", options);
  CheckInput(input);
  const auto start = Clock::now();
  PhotoAperture found;
  Measurement measurement(input, options.compression_sigma, ResolveThreads(options.threads));
  found.tiles = static_cast<int>(measurement.tiles().size());
  for (const PhotoTile& tile : measurement.tiles())
    found.largest_sigma_px = std::max(found.largest_sigma_px, measurement.PredictedPx(tile));
  if (!measurement.IsBlurred()) {
    found.verdict = PhotoAperture::Verdict::kUndecided;
    found.message = "the stated aperture and depth predict no blur anywhere";
    found.seconds = SecondsSince(start);
    return found;
  }
  if (found.tiles < kMinTiles) {
    found.verdict = PhotoAperture::Verdict::kUndecided;
    found.message = fmt::format(
        "the photograph does not show how much of the predicted blur it has: {} of its tiles of {} "
        "px have texture and one depth, and {} are needed",
        found.tiles, kTilePx, kMinTiles);
    found.seconds = SecondsSince(start);
    return found;
  }
  std::size_t form = 0;
  ShareFit fit;
  TileCosts costs;
  const auto measure = [&](ExpectedSpectra::Aperture aperture) {
    measurement.Try(aperture);
    costs = measurement.Best(&form);
    fit = FitShare(costs, [](std::size_t) { return true; });
    found.regions.clear();
    found.share = fit.share;
    const double scatter =
        std::hypot(std::max(fit.sigma, Jackknife(measurement, costs, &found)), kSystematic);
    found.sigma_of_square =
        std::hypot(scatter * (2 * fit.share + scatter),
                   kSystematicPx2 / std::max(1e-6, measurement.MeanSquaredBlur()));
    found.sigma = std::sqrt(fit.share * fit.share + found.sigma_of_square) - fit.share;
    found.evidence_against_captured = fit.against_whole;
    found.evidence_against_sharp = fit.against_sharp;
  };
  measure(ExpectedSpectra::Aperture::kSampled);
  if (fit.against_whole > kExcluded) measure(ExpectedSpectra::Aperture::kGaussian);
  Decide(&found);
  if (found.used_share() < 1) {
    const double reversed = measurement.LikelierReversed(costs, form);
    const double offset = measurement.LikelierOffset(costs, form);
    if (std::max(reversed, offset) > -kLikelier) {
      found.verdict = PhotoAperture::Verdict::kContradicted;
      found.message = fmt::format(
          "the photograph would show {:.2f} +- {:.2f} of the predicted blur, but {} explains it "
          "about as well as a smaller aperture does",
          *found.share, *found.sigma,
          reversed > offset ? "the depth map in another order of its rows or columns"
                            : "another plane of focus, or another offset of the disparity,");
    }
  }
  found.seconds = SecondsSince(start);
  return found;
}

}  // namespace thicklens::estimator
