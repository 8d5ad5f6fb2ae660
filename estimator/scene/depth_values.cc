#include "thicklens/estimator/depth_values.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>

#include "estimator/projection/scene_projection.h"
#include "estimator/scene/coarse_start.h"
#include "estimator/scene/lower_bounds.h"
#include "estimator/scene/tile_ripples.h"
#include "estimator/views/input_checks.h"
#include "estimator/views/option_checks.h"
#include "estimator/views/ray_landing.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/run_cost.h"
#include "thicklens/estimator/scene_solver.h"

namespace thicklens::estimator {
namespace {

constexpr double kMaxPixels = 1 << 20;
constexpr double kMinNoise = 0.29 / 255;
constexpr int kParts = 16;
constexpr std::size_t kMinTiles = 12;
// The most that one tile says.
constexpr double kMaxOfTile = 6;
// Evidence from which a photograph shows the ripples of its aperture, at the stated values and
// anywhere; that by which one aperture is likelier than another, and that within which other values
// are about as likely, also as a share.
constexpr double kShown = 25, kShownAnywhere = 60, kOtherAperture = 5, kAboutAsWell = 8,
                 kAboutAsWellShare = 0.1, kOtherApertureShare = 0.15;
// Standard deviations of scale and offset that remain however many tiles there are: of the scale,
// and of the width of the blur, px.
constexpr double kSystematicScale = 0.015, kSystematicPx = 0.1;
// The largest standard deviation of a scale that is a measurement.
constexpr double kMaxScaleSigma = 0.1;
// Values that differ by less than this in the width of their blur, px, are the same.
constexpr double kSameWidthPx = 1;

RipplePhoto LookedAt(const EstimateInput& input) {
  RipplePhoto photo{input.image, input.clipped, input.disparity, 1};
  if (input.grid) {
    photo.disparity =
        PhotographDisparity(input.disparity, LandingStepPx(*input.camera, *input.grid));
  }
  while (1.0 * photo.image.width_px * photo.image.height_px > kMaxPixels) {
    photo.clipped =
        HalfSize(photo.clipped, photo.image.width_px, photo.image.height_px, photo.image.channels);
    photo.image = HalfSize(photo.image);
    photo.disparity = HalfSize(photo.disparity);
    photo.scale *= 2;
  }
  return photo;
}

// Values that are tried. Disparities are px per view step of the reduced photograph.
struct Values {
  double scale = 1, offset = 0;
};

class Fit {
 public:
  explicit Fit(const TileRipples& ripples) : ripples_(ripples) {
    for (std::size_t i = 0; i < ripples.tiles().size(); ++i) parts_.push_back(ripples.PartOf(i));
  }

  // The sum over the tiles, without those of one part (-1: with all).
  double Of(const Values& values, int without = -1) const {
    double sum = 0;
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      if (parts_[i] != without) sum += OfTile(values, i);
    }
    return sum;
  }

  // The best values of a grid.
  Values BestOf(const std::vector<double>& scales, const std::vector<double>& offsets,
                int without = -1) const {
    Values best;
    double most = -std::numeric_limits<double>::infinity();
    for (const double scale : scales) {
      for (const double offset : offsets) {
        const double sum = Of({scale, offset}, without);
        if (!(sum > most)) continue;
        most = sum;
        best = {scale, offset};
      }
    }
    return best;
  }

  // The largest sum near `start`, by ever finer steps.
  Values Refined(Values best, double scale_step, double offset_step, int without = -1) const {
    constexpr double kFinest = 1.0 / 64;
    double most = Of(best, without);
    for (double size = 1; size >= kFinest;) {
      bool is_better = false;
      const Values from = best;
      for (int i = -1; i <= 1; ++i) {
        for (int j = -1; j <= 1; ++j) {
          const Values tried{from.scale + i * size * scale_step,
                             from.offset + j * size * offset_step};
          const double sum = Of(tried, without);
          if (!(sum > most)) continue;
          most = sum;
          best = tried;
          is_better = true;
        }
      }
      if (!is_better) size /= 2;
    }
    return best;
  }

  // Standard deviation of Of(first) - Of(second), by the parts.
  double SigmaOfGain(const Values& first, const Values& second) const {
    std::array<double, kParts> parts{};
    std::array<bool, kParts> is_used{};
    double mean = 0;
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      const double gain = OfTile(first, i) - OfTile(second, i);
      parts[Index(parts_[i])] += gain;
      is_used[Index(parts_[i])] = true;
      mean += gain;
    }
    const auto used = static_cast<double>(std::count(is_used.begin(), is_used.end(), true));
    if (used < 2) return std::abs(mean);
    mean /= used;
    double squares = 0;
    for (std::size_t part = 0; part < kParts; ++part) {
      if (is_used[part]) squares += (parts[part] - mean) * (parts[part] - mean);
    }
    return std::sqrt(std::max(1.0, squares * used / (used - 1)));
  }

  std::size_t PartCount() const {
    std::array<bool, kParts> is_used{};
    for (const int part : parts_) is_used[Index(part)] = true;
    return static_cast<std::size_t>(std::count(is_used.begin(), is_used.end(), true));
  }

 private:
  double OfTile(const Values& values, std::size_t tile) const {
    const double evidence =
        ripples_.Of(tile, values.scale * ripples_.tiles()[tile].disparity + values.offset);
    return kMaxOfTile * std::tanh(evidence / kMaxOfTile);
  }

  const TileRipples& ripples_;
  std::vector<int> parts_;
};

std::vector<double> Steps(double from, double to, double step) {
  std::vector<double> steps;
  for (int i = 0; from + i * step <= to + 1e-9 * step; ++i) steps.push_back(from + i * step);
  return steps;
}

// The scales and offsets of a search, and their steps.
struct Grid {
  std::vector<double> scales, offsets;
  double scale_step = 0, offset_step = 0;
};

Grid NearGrid(const TileRipples& ripples) {
  constexpr double kMinScale = 0.7, kMaxScale = 1.4, kScaleStep = 0.02, kOffsetPx = 4,
                   kOffsetStepPx = 0.15;
  Grid grid;
  grid.scale_step = kScaleStep;
  grid.offset_step = kOffsetStepPx / ripples.width_px();
  grid.scales = Steps(kMinScale, kMaxScale, kScaleStep);
  grid.offsets =
      Steps(-kOffsetPx / ripples.width_px(), kOffsetPx / ripples.width_px(), grid.offset_step);
  return grid;
}

// Middle and half of the range of the tiles' values.
struct TileRange {
  double middle = 0, half = 0;
};

TileRange RangeOf(const std::vector<RippleTile>& tiles) {
  std::vector<double> values;
  for (const RippleTile& tile : tiles) values.push_back(tile.disparity);
  std::sort(values.begin(), values.end());
  const std::size_t end = values.size() / 20;
  const double low = values[end], high = values[values.size() - 1 - end];
  return {(low + high) / 2, (high - low) / 2};
}

// Values for which a point in the middle of the range has the disparity `middle`, and one at its
// end another by `slope`.
Values ValuesOf(const TileRange& range, double slope, double middle) {
  const double scale = slope / range.half;
  return {scale, middle - scale * range.middle};
}

// The local maxima over all positive scales, the largest first.
std::vector<Values> AllMaxima(const TileRipples& ripples, const Fit& fit, const TileRange& range) {
  constexpr double kStepPx = 0.4, kMinSlopePx = 0.5;
  const double step = kStepPx / ripples.width_px(), most = ripples.largest();
  const std::vector<double> slopes = Steps(kMinSlopePx / ripples.width_px(), most, step),
                            middles = Steps(-most, most, step);
  std::vector<std::vector<double>> sums(slopes.size(), std::vector<double>(middles.size()));
  for (std::size_t i = 0; i < slopes.size(); ++i) {
    for (std::size_t j = 0; j < middles.size(); ++j)
      sums[i][j] = fit.Of(ValuesOf(range, slopes[i], middles[j]));
  }
  struct Maximum {
    Values values;
    double sum;
  };
  std::vector<Maximum> maxima;
  for (std::size_t i = 0; i < slopes.size(); ++i) {
    for (std::size_t j = 0; j < middles.size(); ++j) {
      bool is_largest = true;
      for (std::size_t k = i == 0 ? 0 : i - 1; k <= std::min(i + 1, slopes.size() - 1); ++k) {
        for (std::size_t l = j == 0 ? 0 : j - 1; l <= std::min(j + 1, middles.size() - 1); ++l)
          is_largest = is_largest && sums[k][l] <= sums[i][j];
      }
      if (is_largest) maxima.push_back({ValuesOf(range, slopes[i], middles[j]), sums[i][j]});
    }
  }
  std::stable_sort(maxima.begin(), maxima.end(),
                   [](const Maximum& a, const Maximum& b) { return a.sum > b.sum; });
  constexpr std::size_t kMaxMaxima = 12;
  std::vector<Values> best;
  for (const Maximum& maximum : maxima) {
    if (best.size() < kMaxMaxima) best.push_back(maximum.values);
  }
  return best;
}

// Root of the mean square difference of the widths of the blur with their sides, px.
double DifferencePx(const TileRipples& ripples, const Values& a, const Values& b) {
  double squares = 0;
  for (const RippleTile& tile : ripples.tiles()) {
    squares += std::pow((a.scale - b.scale) * tile.disparity + a.offset - b.offset, 2);
  }
  return ripples.width_px() * std::sqrt(squares / static_cast<double>(ripples.tiles().size()));
}

class Search {
 public:
  // The disparities of the input are those of `base`, to which the found values refer.
  // `is_anywhere`: nothing states them.
  Search(const EstimateInput& input, const DepthValuesOptions& options, const Values& base,
         bool is_anywhere, int threads, DepthValuesFit* found)
      : is_near_(options.search == DepthValuesSearch::kNear),
        is_anywhere_(is_anywhere),
        base_(base),
        photo_(LookedAt(input)),
        ripples_(photo_, input.transfer, input.weights, Rules(),
                 std::hypot(std::max(kMinNoise,
                                     EncodedNoiseSigma(photo_.image, input.transfer, photo_.clipped)
                                         .value_or(1.0 / 255)),
                            options.compression_sigma / photo_.scale),
                 threads),
        found_(found) {}

  void Run() {
    found_->tiles = static_cast<int>(ripples_.tiles().size());
    if (ripples_.tiles().size() < kMinTiles) {
      found_->message = fmt::format(
          "the photograph does not show the values of the depth: {} of its tiles have texture, one "
          "depth and a blur that they resolve, and {} are needed",
          ripples_.tiles().size(), kMinTiles);
      return;
    }
    ripples_.Look(RippleAperture::kSampled);
    const Fit fit(ripples_);
    const Values best = is_near_ ? BestNear(fit) : BestOfAll(fit);
    found_->best = TrialOf(best, fit.Of(best));
    if (is_near_) {
      found_->given = TrialOf({}, fit.Of({}));
      found_->gain = found_->best.evidence - found_->given.evidence;
      found_->gain_sigma = fit.SigmaOfGain(best, {});
    }
    FindErrors(fit, best);
    Decide();
  }

 private:
  RippleTileRules Rules() const {
    RippleTileRules rules;
    if (is_near_) return rules;
    // The values have no unit: what a tile shows is compared with the range of the map.
    rules.by_blur = false;
    rules.range_share = 0;
    std::vector<float> values = photo_.disparity.disparity;
    std::sort(values.begin(), values.end());
    const std::size_t end = values.size() / 20;
    constexpr double kOfRange = 0.06;
    rules.range = kOfRange * photo_.disparity.step.cwiseAbs().maxCoeff() *
                  static_cast<double>(values[values.size() - 1 - end] - values[end]);
    return rules;
  }

  Values BestNear(const Fit& fit) {
    const Grid grid = NearGrid(ripples_);
    scale_step_ = grid.scale_step;
    offset_step_ = grid.offset_step;
    return fit.Refined(fit.BestOf(grid.scales, grid.offsets), scale_step_, offset_step_);
  }

  Values BestOfAll(const Fit& fit) {
    const TileRange range = RangeOf(ripples_.tiles());
    if (!(range.half > 0)) return {};
    constexpr double kStepPx = 0.2;
    offset_step_ = kStepPx / ripples_.width_px();
    scale_step_ = offset_step_ / range.half;
    std::vector<Values> maxima;
    for (const Values& start : AllMaxima(ripples_, fit, range))
      maxima.push_back(fit.Refined(start, scale_step_, offset_step_));
    std::stable_sort(maxima.begin(), maxima.end(),
                     [&](const Values& a, const Values& b) { return fit.Of(a) > fit.Of(b); });
    const Values best = maxima.front();
    const double least = fit.Of(best) - std::max(kAboutAsWell, kAboutAsWellShare * fit.Of(best));
    for (const Values& other : maxima) {
      if (!(other.scale > 0) || fit.Of(other) < least) continue;
      bool is_new = DifferencePx(ripples_, best, other) > kSameWidthPx;
      for (const Values& known : others_)
        is_new = is_new && DifferencePx(ripples_, known, other) > kSameWidthPx;
      if (!is_new) continue;
      others_.push_back(other);
      found_->others.push_back(TrialOf(other, fit.Of(other)));
    }
    return best;
  }

  // The values refer to the base, whose offset is in px of the photograph.
  Values OfBase(const Values& values) const {
    return {values.scale * base_.scale, values.scale * base_.offset + values.offset * photo_.scale};
  }
  DepthValuesTrial TrialOf(const Values& values, double evidence) const {
    const Values of_base = OfBase(values);
    return {of_base.scale, of_base.offset, evidence};
  }

  void FindErrors(const Fit& fit, const Values& best) {
    std::vector<Values> without;
    for (int part = 0; part < kParts; ++part)
      without.push_back(OfBase(fit.Refined(best, scale_step_, offset_step_, part)));
    Values mean{0, 0};
    for (const Values& values : without) {
      mean.scale += values.scale / kParts;
      mean.offset += values.offset / kParts;
    }
    double scale = 0, offset = 0;
    for (const Values& values : without) {
      scale += std::pow(values.scale - mean.scale, 2);
      offset += std::pow(values.offset - mean.offset, 2);
    }
    // A part without tiles changes nothing.
    const auto used = static_cast<double>(fit.PartCount());
    const double factor = (used - 1) / used;
    found_->scale_sigma =
        std::hypot(std::sqrt(scale * factor), kSystematicScale * OfBase(best).scale);
    found_->offset_sigma_px =
        std::hypot(std::sqrt(offset * factor), kSystematicPx / ripples_.width_px() * photo_.scale);
  }

  void Decide() {
    DepthValuesFit& found = *found_;
    const double shown = is_anywhere_ ? kShownAnywhere : kShown;
    if (found.best.evidence < shown) {
      found.others.clear();
      found.message = fmt::format(
          "the photograph does not show the blur of its aperture: it is sharp, too smooth or too "
          "noisy, or was taken through another aperture (evidence {:.0f}, {:.0f} are needed)",
          found.best.evidence, shown);
      return;
    }
    if (IsOfDisc()) {
      found.others.clear();
      found.message =
          "another aperture than the stated one explains the photograph better, as a round one";
      return;
    }
    const std::string values = fmt::format(
        "scale {:.3g} +- {:.2g}, offset {:.3g} +- {:.2g} px per view step", found.best.scale,
        found.scale_sigma, found.best.offset_px, found.offset_sigma_px);
    if (!found.others.empty()) {
      found.message = fmt::format(
          "blur alone is the same on both sides of the plane of focus: {} explains it, and so does "
          "scale {:.3g}, offset {:.3g} px per view step{}",
          values, found.others.front().scale, found.others.front().offset_px,
          found.others.size() > 1 ? fmt::format(", and {} more", found.others.size() - 1) : "");
      return;
    }
    // The first values of a search for all are refined.
    if (is_near_ && !(found.scale_sigma <= kMaxScaleSigma * found.best.scale)) {
      found.message = "the photograph shows the values of the depth too inexactly: " + values;
      return;
    }
    found.is_found = true;
    found.message = "the blur of the photograph agrees with " + values;
  }

  // Whether a round aperture explains the photograph better than the stated one.
  bool IsOfDisc() {
    TileRipples other = ripples_;
    other.Look(RippleAperture::kDisc);
    const Fit fit(other);
    double evidence = 0;
    if (is_near_) {
      // The width of the aperture is that of the photograph.
      const Grid grid = NearGrid(other);
      evidence = fit.Of(
          fit.Refined(fit.BestOf(grid.scales, grid.offsets), grid.scale_step, grid.offset_step));
    } else {
      for (const Values& start : AllMaxima(other, fit, RangeOf(other.tiles())))
        evidence = std::max(evidence, fit.Of(fit.Refined(start, scale_step_, offset_step_)));
    }
    // The first values of a search for all are compared once more when they are refined.
    const double more = is_near_
                            ? kOtherAperture
                            : std::max(kOtherAperture, kOtherApertureShare * found_->best.evidence);
    return evidence > found_->best.evidence + more;
  }

  const bool is_near_, is_anywhere_;
  const Values base_;
  const RipplePhoto photo_;
  TileRipples ripples_;
  DepthValuesFit* const found_;
  double scale_step_ = 0, offset_step_ = 0;
  std::vector<Values> others_;
};

// The input with other disparities.
EstimateInput WithValues(const EstimateInput& input, const DepthValuesTrial& values) {
  EstimateInput changed = input;
  const double step = changed.disparity.step.cwiseAbs().maxCoeff();
  for (float& value : changed.disparity.disparity) {
    value = static_cast<float>(values.scale * static_cast<double>(value) + values.offset_px / step);
  }
  return changed;
}

}  // namespace

bool DepthValuesOptions::IsValid(std::string* why) const {
  return IsAtLeast(0, "threads", threads, why) &&
         IsNonNegative("compression_sigma", compression_sigma, why);
}

DepthValuesFit FitDepthValues(const EstimateInput& input, const DepthValuesOptions& options) {
  CheckOptions("depth values", options);
  CheckInput(input);
  const auto start = Clock::now();
  const int threads = ResolveThreads(options.threads);
  DepthValuesFit found;
  const bool is_anywhere = options.search == DepthValuesSearch::kAll;
  Search(input, options, {}, is_anywhere, threads, &found).Run();
  if (found.is_found && is_anywhere) {
    // Now the map states the blur, by which tiles are chosen.
    DepthValuesOptions near = options;
    near.search = DepthValuesSearch::kNear;
    const DepthValuesTrial first = found.best;
    found = {};
    Search(WithValues(input, first), near, {first.scale, first.offset_px}, true, threads, &found)
        .Run();
  }
  found.seconds = SecondsSince(start);
  return found;
}

}  // namespace thicklens::estimator
