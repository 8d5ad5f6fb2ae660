#include "estimator/scene/depth_evidence.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "estimator/scene/scene_data.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"
#include "thicklens/estimator/scene_solver.h"

namespace thicklens::estimator {
namespace {

// ---- Edges.

// The gradient is that of the image smoothed by so many px: a depth edge of the photograph is
// blurred on its near side or its far side.
constexpr double kEdgeSmoothingPx = 1;
// A jump of so large a share of the depth's range is an edge.
constexpr double kFullEdge = 0.15;
// Slanted surfaces and noise: gradients up to so many times the median are no edges.
constexpr double kNoEdge = 3, kMinEdge = 0.2;
// Contours of a slanted surface in a map of few levels are one level high. Edges are higher.
constexpr double kMinLevels = 1.5;
// A level of the map has this share of its pixels, and all levels together have the other one:
// interpolation leaves few values between them.
constexpr double kShareOfLevel = 1e-3, kShareOfLevels = 0.8;
// The slope of an edge is compared with those so many px off on both sides.
constexpr int kFlankPx = 7;
// Without single pixels, an edge keeps this share of its gradient.
constexpr double kKeptGradient = 0.5;
// Where levels and single pixels have more than this share of the gradients, the others are not
// certain either.
constexpr double kMaxOfNoEdges = 0.5;
// Places that are compared lie so far off, as shares of the smaller side.
constexpr double kNearest = 0.06, kFarthest = 0.3;
constexpr int kBorderPx = 3;
// Places within so many px are averaged, where the map's edges are off by some px.
constexpr int kCoarsePx = 5;
constexpr int kAroundPx = 8;

struct Gradient {
  cv::Mat_<float> across, down, size;
};

Gradient GradientOf(const cv::Mat_<float>& values) {
  Gradient gradient;
  cv::Sobel(values, gradient.across, CV_32F, 1, 0);
  cv::Sobel(values, gradient.down, CV_32F, 0, 1);
  cv::magnitude(gradient.across, gradient.down, gradient.size);
  return gradient;
}

cv::Mat_<float> ImageOf(const std::vector<float>& values, int width_px, int height_px) {
  return cv::Mat_<float>(height_px, width_px, const_cast<float*>(values.data())).clone();
}

float Quantile(std::vector<float> values, double share) {
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// The parts of an edge map that are compared: the strength, and the strength times cosine and sine
// of twice the direction, which edges across each other have with opposite signs.
using EdgeParts = std::array<cv::Mat_<float>, 3>;

EdgeParts WithDirections(const cv::Mat_<float>& strength, const Gradient& gradient, float offset) {
  EdgeParts parts{strength.clone(), strength.clone(), strength.clone()};
  for (int y = 0; y < strength.rows; ++y) {
    for (int x = 0; x < strength.cols; ++x) {
      const float across = gradient.across(y, x), down = gradient.down(y, x);
      const float squared = std::max(1e-20F, across * across + down * down);
      parts[0](y, x) -= offset;
      parts[1](y, x) *= (across * across - down * down) / squared;
      parts[2](y, x) *= 2 * across * down / squared;
    }
  }
  return parts;
}

// The smallest difference between levels of a map; 0 if it does not consist of levels.
float LevelStep(std::vector<float> values) {
  std::sort(values.begin(), values.end());
  const double size = static_cast<double>(values.size());
  double covered = 0;
  std::optional<float> last;
  float step = 0;
  for (auto first = values.begin(); first != values.end();) {
    const auto end = std::upper_bound(first, values.end(), *first);
    const auto count = static_cast<double>(end - first);
    if (count >= kShareOfLevel * size) {
      covered += count;
      if (last && (step == 0 || *first - *last < step)) step = *first - *last;
      last = *first;
    }
    first = end;
  }
  return covered >= kShareOfLevels * size ? step : 0;
}

struct MapEdges {
  std::optional<EdgeParts> parts;  // absent if there are none
  bool is_unclear = false;         // there are none but levels of slanted surfaces, and noise
};

// Edges of a depth map, 0 to 1 per pixel.
MapEdges DepthEdges(const DisparityMap& map) {
  const double range =
      static_cast<double>(Quantile(map.disparity, 0.98) - Quantile(map.disparity, 0.02));
  if (!(range > 0)) return {};
  const cv::Mat_<float> values = ImageOf(map.disparity, map.width_px, map.height_px);
  const Gradient gradient = GradientOf(values);
  cv::Mat_<float> without, highest, lowest;  // without single pixels
  cv::medianBlur(values, without, 3);
  cv::dilate(without, highest, {});
  cv::erode(without, lowest, {});
  const Gradient smooth = GradientOf(without);
  const double level_step = static_cast<double>(LevelStep(map.disparity));
  cv::Mat_<float> strength = gradient.size.clone();
  const double median =
      static_cast<double>(Quantile(std::vector<float>(strength.begin(), strength.end()), 0.5));
  const auto is_high = [&](int x, int y) {
    return static_cast<double>(highest(y, x) - lowest(y, x)) >= kMinLevels * level_step;
  };
  const auto is_kept = [&](int x, int y) {
    const double across = static_cast<double>(gradient.across(y, x)),
                 down = static_cast<double>(gradient.down(y, x));
    return across * static_cast<double>(smooth.across(y, x)) +
               down * static_cast<double>(smooth.down(y, x)) >=
           kKeptGradient * (across * across + down * down);
  };
  // Both flanks are less steep.
  const auto is_steep = [&](int x, int y) {
    const double size = static_cast<double>(gradient.size(y, x));
    const double across = static_cast<double>(gradient.across(y, x)) / size,
                 down = static_cast<double>(gradient.down(y, x)) / size;
    const auto slope = [&](int offset_px) {
      const int i =
          std::clamp(x + static_cast<int>(std::lround(offset_px * across)), 0, map.width_px - 1);
      const int j =
          std::clamp(y + static_cast<int>(std::lround(offset_px * down)), 0, map.height_px - 1);
      return across * static_cast<double>(smooth.across(j, i)) +
             down * static_cast<double>(smooth.down(j, i));
    };
    return size > std::max(slope(-kFlankPx), slope(kFlankPx));
  };
  double sum = 0, kept = 0, edges = 0;
  for (int y = 0; y < map.height_px; ++y) {
    for (int x = 0; x < map.width_px; ++x) {
      const bool is_border = x < kBorderPx || y < kBorderPx || x >= map.width_px - kBorderPx ||
                             y >= map.height_px - kBorderPx;
      // The Sobel filter gives four times the difference over a px and a neighbour.
      const double above = static_cast<double>(strength(y, x)) - kNoEdge * median;
      double edge = is_border ? 0 : std::clamp(above / (4 * kFullEdge * range), 0.0, 1.0);
      if (edge < kMinEdge) edge = 0;
      sum += edge;
      if (edge > 0 && !(is_high(x, y) && is_kept(x, y))) edge = 0;
      kept += edge;
      if (edge > 0 && !is_steep(x, y)) edge = 0;
      edges += edge;
      strength(y, x) = static_cast<float>(edge);
    }
  }
  constexpr double kMinEdges = 40;
  MapEdges found;
  if (!(sum >= kMinEdges)) return found;
  found.is_unclear = kept < (1 - kMaxOfNoEdges) * sum || edges < kMinEdges;
  if (!found.is_unclear) found.parts = WithDirections(strength, gradient, 0);
  return found;
}

// The sums of all places of a map, over their standard deviation at places from `near` to `far`.
class Places {
 public:
  Places(const cv::Mat_<float>& sums, int near, int far) : sums_(sums) {
    double sum = 0, squares = 0, count = 0;
    for (int y = -far; y <= far; ++y) {
      for (int x = -far; x <= far; ++x) {
        if (std::hypot(x, y) < near || std::hypot(x, y) > far) continue;
        const double value = Sum(x, y);
        sum += value;
        squares += value * value;
        count += 1;
      }
    }
    mean_ = sum / count;
    sigma_ = std::sqrt(std::max(1e-12, squares / count - mean_ * mean_));
  }
  double At(int x, int y) const { return (Sum(x, y) - mean_) / sigma_; }

 private:
  double Sum(int x, int y) const {
    const auto wrapped = [](int at, int size) { return (at % size + size) % size; };
    return static_cast<double>(sums_(wrapped(y, sums_.rows), wrapped(x, sums_.cols)));
  }
  cv::Mat_<float> sums_;
  double mean_ = 0, sigma_ = 1;
};

}  // namespace

DisparityMap Reordered(const DisparityMap& map, const DepthCauseTrial& change, double px) {
  DisparityMap other = map;
  const int width = map.width_px, height = map.height_px;
  const auto at = [&](int x, int y) {
    return map.disparity[Index(std::clamp(y, 0, height - 1)) * Index(width) +
                         Index(std::clamp(x, 0, width - 1))];
  };
  const int shift_x = static_cast<int>(std::lround(change.shift_x_px / px));
  const int shift_y = static_cast<int>(std::lround(change.shift_y_px / px));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      float value = at(x, y);
      switch (change.cause) {
        case DepthCause::kRows:
          value = at(x, height - 1 - y);
          break;
        case DepthCause::kColumns:
          value = at(width - 1 - x, y);
          break;
        case DepthCause::kBoth:
          value = at(width - 1 - x, height - 1 - y);
          break;
        case DepthCause::kQuarterRight:
          value = at(y, height - 1 - x);
          break;
        case DepthCause::kQuarterLeft:
          value = at(width - 1 - y, x);
          break;
        case DepthCause::kShift:
          value = at(x - shift_x, y - shift_y);
          break;
        case DepthCause::kSign:
          value = -value;
          break;
        default:
          break;
      }
      other.disparity[Index(y) * Index(width) + Index(x)] = value;
    }
  }
  return other;
}

EdgeCoincidence::EdgeCoincidence(const model::LinearImage& grey,
                                 const model::TransferCurve& transfer)
    : width_px_(grey.width_px), height_px_(grey.height_px) {
  std::vector<float> encoded;
  encoded.reserve(grey.values.size());
  for (const float light : grey.values)
    encoded.push_back(
        static_cast<float>(transfer.Encode(std::max(0.0, static_cast<double>(light)))));
  cv::Mat_<float> image = ImageOf(encoded, width_px_, height_px_);
  cv::GaussianBlur(image, image, {}, kEdgeSmoothingPx, kEdgeSmoothingPx, cv::BORDER_REFLECT_101);
  const Gradient gradient = GradientOf(image);
  std::vector<std::size_t> order(grey.values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const float* const values = gradient.size[0];
  std::stable_sort(order.begin(), order.end(),
                   [values](std::size_t a, std::size_t b) { return values[a] < values[b]; });
  cv::Mat_<float> rank(height_px_, width_px_);
  for (std::size_t i = 0; i < order.size(); ++i) {
    rank[0][order[i]] =
        static_cast<float>(static_cast<double>(i) / static_cast<double>(order.size()));
  }
  const EdgeParts parts = WithDirections(rank, gradient, 0.5F);
  for (const cv::Mat_<float>& part : parts) edges_.emplace_back(part.begin(), part.end());
}

std::optional<EdgeCoincidence::Found> EdgeCoincidence::Of(const DisparityMap& map,
                                                          int reach_px) const {
  const MapEdges edges = DepthEdges(map);
  if (!edges.parts) {
    if (!edges.is_unclear) return std::nullopt;
    Found unclear;
    unclear.is_unclear = true;
    return unclear;
  }
  const double smaller = std::min(width_px_, height_px_);
  const int far = static_cast<int>(kFarthest * smaller),
            near = static_cast<int>(kNearest * smaller);
  const int reach = std::min(reach_px, far);
  // The sums around a place that is compared do not reach those of the other end.
  const int padding = far + 2 * kAroundPx;
  const auto pad = [&](const cv::Mat_<float>& values) {
    cv::Mat_<float> padded;
    cv::copyMakeBorder(values, padded, 0, cv::getOptimalDFTSize(height_px_ + padding) - height_px_,
                       0, cv::getOptimalDFTSize(width_px_ + padding) - width_px_,
                       cv::BORDER_CONSTANT, 0);
    return padded;
  };
  // Sums over the edges of the map for all of its places.
  cv::Mat spectrum;
  for (std::size_t part = 0; part < edges_.size(); ++part) {
    cv::Mat of_photo, of_map, product;
    cv::dft(pad(ImageOf(edges_[part], width_px_, height_px_)), of_photo);
    cv::dft(pad((*edges.parts)[part]), of_map);
    cv::mulSpectrums(of_photo, of_map, product, 0, true);
    spectrum = spectrum.empty() ? product : cv::Mat(spectrum + product);
  }
  cv::Mat_<float> sums;
  cv::dft(spectrum, sums, cv::DFT_INVERSE | cv::DFT_SCALE | cv::DFT_REAL_OUTPUT);
  // A place is compared with those around it: what is common to them is the distribution of edges
  // over the image.
  const auto against = [&](int inner_px, int outer_px) {
    cv::Mat_<float> wrapped, inner, outer;
    cv::copyMakeBorder(sums, wrapped, outer_px, outer_px, outer_px, outer_px, cv::BORDER_WRAP);
    cv::blur(wrapped, inner, cv::Size(2 * inner_px + 1, 2 * inner_px + 1));
    cv::blur(wrapped, outer, cv::Size(2 * outer_px + 1, 2 * outer_px + 1));
    inner -= outer;
    return cv::Mat_<float>(inner(cv::Rect(outer_px, outer_px, sums.cols, sums.rows)));
  };
  const Places sharp(against(0, kAroundPx), near, far);
  const Places coarse(against(kCoarsePx, 2 * kAroundPx), near, far);
  Found found;
  found.sigmas = found.best_sigmas = -std::numeric_limits<double>::infinity();
  found.coarse_sigmas = coarse.At(0, 0);
  for (int y = -reach; y <= reach; ++y) {
    for (int x = -reach; x <= reach; ++x) {
      const double sigmas = sharp.At(x, y);
      if (std::max(std::abs(x), std::abs(y)) <= 1) found.sigmas = std::max(found.sigmas, sigmas);
      if (sigmas > found.best_sigmas) {
        found.best_sigmas = sigmas;
        found.best_x = x;
        found.best_y = y;
      }
    }
  }
  found.opposite_sigmas = -std::numeric_limits<double>::infinity();
  for (int y = -reach; y <= reach; ++y) {
    for (int x = -reach; x <= reach; ++x) {
      if (x * found.best_x + y * found.best_y >= 0) continue;
      found.opposite_sigmas = std::max(found.opposite_sigmas, sharp.At(x, y));
    }
  }
  return found;
}

// ---- Spectra.

namespace {

// Blurs for which the likelihood of a tile is known, standard deviations in px.
constexpr std::array<double, 14> kLevelsPx = {0,   0.25, 0.5, 0.75, 1,   1.3, 1.6,
                                              2.0, 2.5,  3,   3.7,  4.5, 5.5, 7};
constexpr double kMaxOfTile = 4;  // the most that one tile says
constexpr std::size_t kEnoughTiles = 64, kFewTiles = 48;
constexpr int kPartsAlong = 4;

// Removes the tiles that show a lower bound.
void RemoveClipped(const ClippedValues& clipped, int width_px, std::vector<PhotoTile>* tiles) {
  if (clipped.empty()) return;
  const auto is_clipped = [&](const PhotoTile& tile) {
    for (int y = tile.y; y < tile.y + kTilePx; ++y) {
      const auto row =
          clipped.begin() + static_cast<std::ptrdiff_t>(Index(y) * Index(width_px) + Index(tile.x));
      if (std::any_of(row, row + kTilePx, [](std::uint8_t value) { return value != 0; }))
        return true;
    }
    return false;
  };
  tiles->erase(std::remove_if(tiles->begin(), tiles->end(), is_clipped), tiles->end());
}

double SpreadOf(const DisparityMap& map, const Eigen::ArrayXXd& weights) {
  DisparityMap unit{1, 1, {1.0F}, map.step};
  return static_cast<double>(BlurSigmaPx(unit, weights).front());
}

}  // namespace

TileLikelihood::TileLikelihood(const ReducedPhoto& photo, const EstimateInput& input, double share,
                               double noise_sigma, int threads)
    : width_px_(photo.grey.width_px),
      height_px_(photo.grey.height_px),
      spread_(share * SpreadOf(photo.disparity, input.weights)) {
  if (!(spread_ > 0)) return;
  for (const int stride : {kTilePx, kTilePx / 2}) {
    tiles_ =
        TilesOf(photo.grey, photo.disparity, input.transfer, noise_sigma, spread_, stride, threads);
    RemoveClipped(photo.clipped, width_px_, &tiles_);
    weight_ = stride == kTilePx ? 1 : 0.5;
    if (tiles_.size() >= kFewTiles) break;
  }
  std::stable_sort(tiles_.begin(), tiles_.end(), [](const PhotoTile& a, const PhotoTile& b) {
    return RmsOf(a.disparity) > RmsOf(b.disparity);
  });
  if (tiles_.size() > kEnoughTiles) {
    for (std::size_t i = 0; i < kEnoughTiles; ++i)
      tiles_[i] = tiles_[i * tiles_.size() / kEnoughTiles];
    tiles_.resize(kEnoughTiles);
  }
  if (tiles_.empty()) return;
  const ExpectedSpectra spectra(ExpectedSpectra::Aperture::kSampled, input.weights,
                                photo.disparity.step, share * kLevelsPx.back() / spread_, threads);
  costs_.resize(tiles_.size());
  given_.resize(tiles_.size());
  ParallelFor(static_cast<int>(tiles_.size()), threads, [&](int i) {
    ThrowIfCancelled();
    double overdispersion = std::numeric_limits<double>::infinity();
    auto& costs = costs_[Index(i)];
    for (const double level : kLevelsPx) {
      TileDisparity disparity;
      disparity.fill(level / spread_);
      const TileFit fit =
          FitTile(tiles_[Index(i)], spectra.At(disparity, share), noise_sigma * noise_sigma);
      overdispersion = std::min(overdispersion, fit.overdispersion);
      costs.push_back(fit.cost);
    }
    for (Costs& level : costs) {
      for (double& cost : level) cost /= overdispersion;
    }
    given_[Index(i)] = CostOf(Index(i), tiles_[Index(i)].disparity);
  });
}

TileLikelihood::Costs TileLikelihood::CostOf(std::size_t tile,
                                             const TileDisparity& disparity) const {
  const double sigma_px = std::min(RmsOf(disparity) * spread_, kLevelsPx.back() - 1e-6);
  const auto above = std::upper_bound(kLevelsPx.begin(), kLevelsPx.end(), sigma_px);
  const auto level = static_cast<std::size_t>(above - kLevelsPx.begin());
  const double share =
      (sigma_px - kLevelsPx[level - 1]) / (kLevelsPx[level] - kLevelsPx[level - 1]);
  Costs costs{};
  for (std::size_t blur = 0; blur < costs.size(); ++blur) {
    costs[blur] = costs_[tile][level - 1][blur] * (1 - share) + costs_[tile][level][blur] * share;
  }
  return costs;
}

int TileLikelihood::PartOf(const PhotoTile& tile) const {
  return (tile.y + kTilePx / 2) * kPartsAlong / height_px_ * kPartsAlong +
         (tile.x + kTilePx / 2) * kPartsAlong / width_px_;
}

std::optional<TileLikelihood::Gain> TileLikelihood::Against(const Other& other) const {
  std::vector<std::optional<Costs>> costs(tiles_.size());
  std::size_t compared = 0;
  for (std::size_t i = 0; i < tiles_.size(); ++i) {
    const std::optional<TileDisparity> disparity = other(tiles_[i]);
    if (!disparity) continue;
    costs[i] = CostOf(i, *disparity);
    ++compared;
  }
  if (compared < kMinTiles) return std::nullopt;
  // Each map with the blur of the whole photograph that suits it, relative to the lowest costs of a
  // tile, limited.
  const auto best_blur = [&](const auto& cost_of) {
    std::size_t best = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t blur = 0; blur < kCommonBlursPx.size(); ++blur) {
      double sum = 0;
      for (std::size_t i = 0; i < tiles_.size(); ++i) {
        if (costs[i]) sum += cost_of(i, blur);
      }
      if (sum < least) {
        least = sum;
        best = blur;
      }
    }
    return best;
  };
  const auto lowest = [&](std::size_t i) {
    double least = std::numeric_limits<double>::infinity();
    for (const Costs& level : costs_[i])
      least = std::min(least, *std::min_element(level.begin(), level.end()));
    return least;
  };
  const auto limited = [&](std::size_t i, double cost) {
    return std::min(kMaxOfTile, cost - lowest(i));
  };
  const auto given_cost = [&](std::size_t i, std::size_t blur) {
    return limited(i, given_[i][blur]);
  };
  const auto other_cost = [&](std::size_t i, std::size_t blur) {
    return limited(i, (*costs[i])[blur]);
  };
  const std::size_t of_given = best_blur(given_cost), of_other = best_blur(other_cost);
  std::array<double, kPartsAlong * kPartsAlong> parts{};
  Gain gain;
  gain.tiles = static_cast<int>(compared);
  for (std::size_t i = 0; i < tiles_.size(); ++i) {
    if (!costs[i]) continue;
    const double difference = weight_ * (given_cost(i, of_given) - other_cost(i, of_other));
    gain.mean += difference;
    parts[Index(PartOf(tiles_[i]))] += difference;
  }
  double squares = 0, used = 0;
  for (const double part : parts) {
    if (part == 0) continue;
    squares += part * part;
    used += 1;
  }
  const double scatter =
      used > 1 ? (squares - gain.mean * gain.mean / used) * used / (used - 1) : squares;
  gain.sigma = std::sqrt(std::max(1.0, scatter));
  return gain;
}

double TileLikelihood::BlurRangePx() const {
  if (tiles_.empty()) return 0;
  std::vector<double> sigmas;
  for (const PhotoTile& tile : tiles_) sigmas.push_back(spread_ * RmsOf(tile.disparity));
  std::sort(sigmas.begin(), sigmas.end());
  const std::size_t end = sigmas.size() / 10;
  return sigmas[sigmas.size() - 1 - end] - sigmas[end];
}

TileLikelihood::Gain TileLikelihood::OfValues(double scale, double offset) const {
  const auto gain = Against([&](const PhotoTile& tile) {
    TileDisparity disparity = tile.disparity;
    for (double& part : disparity) part = scale * part + offset;
    return std::optional(disparity);
  });
  return gain.value_or(Gain{});
}

// ---- Residuals.

ResidualBlocks ExplainedBy(const ReducedPhoto& photo, const DisparityMap& map,
                           const EstimateInput& input, double photo_aperture, int threads) {
  EstimateInput tried;
  tried.image = photo.grey;
  tried.clipped = photo.clipped;
  tried.disparity = map;
  tried.weights = input.weights;
  tried.transfer = input.transfer;
  SceneOptions options;
  options.falloff = false;
  options.photo_aperture = photo_aperture;
  options.tolerance = 1e-3;
  SceneViewSink sink;  // only the residual is wanted
  sink.take = [](int, int, const model::LinearImage&, const std::vector<Confidence>&) {
    ThrowIfCancelled();
  };
  sink.wants_confidence = false;
  SolverRun run;
  run.threads = threads;
  run.sink = &sink;
  SceneSummary summary;
  SceneMaps maps;
  EstimateScene(tried, options, run, &summary, &maps);
  const int across = (map.width_px + kResidualBlockPx - 1) / kResidualBlockPx;
  const int down = (map.height_px + kResidualBlockPx - 1) / kResidualBlockPx;
  ResidualBlocks blocks;
  blocks.squares.resize(Index(across) * Index(down));
  for (int y = 0; y < map.height_px; ++y) {
    for (int x = 0; x < map.width_px; ++x) {
      const auto residual =
          static_cast<double>(maps.residual[Index(y) * Index(map.width_px) + Index(x)]);
      blocks.squares[Index(y / kResidualBlockPx) * Index(across) + Index(x / kResidualBlockPx)] +=
          residual * residual;
    }
  }
  return blocks;
}

}  // namespace thicklens::estimator
