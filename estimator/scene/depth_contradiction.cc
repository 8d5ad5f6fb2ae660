#include "thicklens/estimator/depth_contradiction.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "estimator/projection/scene_projection.h"
#include "estimator/scene/coarse_start.h"
#include "estimator/scene/depth_evidence.h"
#include "estimator/scene/jpeg_blocks.h"
#include "estimator/scene/lower_bounds.h"
#include "estimator/views/input_checks.h"
#include "estimator/views/option_checks.h"
#include "estimator/views/ray_landing.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/run_cost.h"
#include "thicklens/estimator/scene_solver.h"

namespace thicklens::estimator {
namespace {

// Sizes at which spectra, edges and residuals are compared, px.
constexpr double kSpectraPixels = 1 << 20, kEdgePixels = 260 * 260, kResidualPixels = 130 * 130;
// The least noise: the rounding of 8 bits.
constexpr double kRoundingNoise = 0.29 / 255;

// Standard deviations of the coincidence of edges. Maps of the right place had 3.5 and more, 2.2
// blurred by 8 px, and 0 to 5 dilated by 3 px, where the average over some px was above 1.4; maps
// in another order or of another image had up to 4.4, and less than half of the right order.
constexpr double kCoincides = 3, kAtPlace = 2, kNearPlace = 1.35;
constexpr double kOtherOrder = 4, kOtherPlace = 5, kMayBeRight = 3;
constexpr double kMoreThanGiven = 3;
constexpr double kOfBest = 0.5, kAboutTheBest = 0.7;
constexpr double kSinglePlace = 10, kOfSinglePlace = 0.35;
constexpr int kFarShiftPx = 7;
// The smaller side, also at the size at which edges are compared.
constexpr int kMinSidePx = 48;
constexpr int kReachPx = 24, kMinShiftPx = 4;
// Standard deviations of a residual that decide.
constexpr double kSignDecided = 4, kShiftDecided = 3;
// Logarithm of the likelihood ratio, and that over its standard deviation, from which the values
// of a map are wrong. Values that are less likely by no more than kAlike are not excluded.
constexpr double kMuchLikelier = 14, kMuchLikelierTwo = 40, kLikelierSigmas = 1.8, kAlike = 4.5,
                 kAlikeShare = 0.08;
// Changes up to these are within what textures show: octaves of the scale, and the standard
// deviation of the blur of an offset, px.
constexpr double kMinOctaves = 0.3, kMinOffsetPx = 0.4;
constexpr double kNoBlurScale = 0.2;

DepthCauseTrial TrialOf(DepthCause cause, double scale = 1, double offset_px = 0) {
  DepthCauseTrial trial;
  trial.cause = cause;
  trial.scale = scale;
  trial.offset_px = offset_px;
  return trial;
}

ReducedPhoto ReducedTo(double pixels, ReducedPhoto photo) {
  while (1.0 * photo.grey.width_px * photo.grey.height_px > pixels) {
    photo.clipped = HalfSize(photo.clipped, photo.grey.width_px, photo.grey.height_px, 1);
    photo.grey = HalfSize(photo.grey);
    photo.disparity = HalfSize(photo.disparity);
    photo.scale *= 2;
  }
  return photo;
}

// The photograph in grey, without its fall-off, with the disparity of its pixels. The sum of
// channels is a lower bound if one of them is.
ReducedPhoto LookedAtFor(const EstimateInput& input, bool falloff, int threads) {
  ReducedPhoto photo;
  std::optional<model::LinearImage> without;
  photo.disparity = input.disparity;
  if (input.grid) {
    photo.disparity =
        PhotographDisparity(input.disparity, LandingStepPx(*input.camera, *input.grid));
    if (falloff) {
      without = WithoutFalloff(input.image, *input.grid, input.camera_of_falloff(), input.weights,
                               threads);
    }
  }
  const model::LinearImage& image = without ? *without : input.image;
  photo.grey = {image.width_px, image.height_px, 1, {}};
  photo.grey.values.reserve(image.values.size() / static_cast<std::size_t>(image.channels));
  const auto channels = static_cast<std::size_t>(image.channels);
  for (std::size_t i = 0; i < image.values.size(); i += channels) {
    photo.grey.values.push_back(channels < 3
                                    ? image.values[i]
                                    : 0.2126F * image.values[i] + 0.7152F * image.values[i + 1] +
                                          0.0722F * image.values[i + 2]);
  }
  photo.clipped = InAnyChannel(input.clipped, image.channels);
  return photo;
}

double NoiseOf(const ReducedPhoto& photo, const EstimateInput& input, double compression_sigma) {
  return std::hypot(
      std::max(EncodedNoiseSigma(photo.grey, input.transfer, photo.clipped).value_or(1.0 / 255),
               kRoundingNoise),
      compression_sigma / photo.scale);
}

// Standard deviations by which `other` explains the photograph better than `given`: the mean of
// the logarithm of the ratio of their squares in blocks, in which no single block decides.
double SigmasBetter(const ResidualBlocks& given, const ResidualBlocks& other, double noise_square) {
  // Rounding alone makes the same small difference in many blocks.
  constexpr double kMinRatio = 0.01;
  double sum = 0, squares = 0, count = 0;
  for (std::size_t i = 0; i < given.squares.size(); ++i) {
    const double ratio =
        std::log((given.squares[i] + noise_square) / (other.squares[i] + noise_square));
    sum += ratio;
    squares += ratio * ratio;
    count += 1;
  }
  if (!(std::abs(sum) > kMinRatio * count)) return 0;
  const double scatter = (squares - sum * sum / count) * count / std::max(1.0, count - 1);
  return sum / std::sqrt(std::max(1e-12, scatter));
}

class Search {
 public:
  Search(const EstimateInput& input, const DepthContradictionOptions& options, int threads,
         DepthContradiction* found)
      : input_(input),
        options_(options),
        threads_(threads),
        photo_(ReducedTo(kSpectraPixels, LookedAtFor(input, options.falloff, threads))),
        small_(ReducedTo(kEdgePixels, photo_)),
        found_(found) {}

  void Run() {
    found_->trials.push_back({});
    // A strip is too narrow at the size at which edges are compared.
    if (std::min(small_.grey.width_px, small_.grey.height_px) < kMinSidePx) {
      found_->values_untested = fmt::format(
          "the photograph has less than {} px at 1/{:g} of its size", kMinSidePx, small_.scale);
      found_->message =
          "the depth cannot be compared with the photograph: " + found_->values_untested;
      return;
    }
    const EdgeCoincidence edges(small_.grey, input_.transfer);
    const auto given = edges.Of(small_.disparity, kReachPx);
    if (given && given->is_unclear) {
      found_->values_untested = "most edges of the depth are steps between few levels, or noise";
      found_->message =
          "the depth cannot be compared with the photograph: " + found_->values_untested;
      return;
    }
    if (given) found_->trials.front().edges = given->sigmas;
    if (given && IsElsewhere(edges, *given)) return;
    if (given && IsNowhere(*given)) return;
    const bool is_at_place = !given || given->sigmas >= kCoincides;
    // Between the two, as with a map of an eighth of the size, nothing is certain.
    const bool is_open = given && !is_at_place && given->sigmas >= kAtPlace;
    if (is_open) {
      found_->values_untested = "it is not certain that the depth's edges lie on the photograph's";
    } else if (given && is_at_place && !options_.check_values) {
      found_->values_untested = "the photograph shows the blur that they predict";
    } else {
      TryValues(given.has_value(), is_at_place);
    }
    // Without edges, the residual of the reversed sign is the same.
    if (!found_->is_contradicted && given && is_at_place) TrySign();
    if (!found_->is_contradicted) found_->message = AgreementText(given);
  }

 private:
  // The message of a map that nothing contradicts.
  std::string AgreementText(const std::optional<EdgeCoincidence::Found>& given) const {
    const std::string edges =
        !given ? "the depth has no edges"
        : given->sigmas >= kCoincides
            ? fmt::format(
                  "the depth's edges lie on edges of the photograph ({:.1f} standard deviations)",
                  given->sigmas)
            : fmt::format(
                  "whether the depth's edges lie on edges of the photograph is not certain ({:.1f} "
                  "standard deviations, {:.1f} on average within some px)",
                  given->sigmas, given->coarse_sigmas);
    return edges +
           (found_->values_untested.empty()
                ? ", and no other values explain the photograph's blur better"
                : fmt::format("; other values were not tested: {}", found_->values_untested));
  }

  // Whether the map in another order, or at another place, lies on the photograph's edges.
  bool IsElsewhere(const EdgeCoincidence& edges, const EdgeCoincidence::Found& given) {
    std::vector<DepthCauseTrial> orders;
    for (const DepthCause cause : {DepthCause::kRows, DepthCause::kColumns, DepthCause::kBoth,
                                   DepthCause::kQuarterRight, DepthCause::kQuarterLeft}) {
      const bool is_quarter =
          cause == DepthCause::kQuarterRight || cause == DepthCause::kQuarterLeft;
      if (is_quarter && small_.disparity.width_px != small_.disparity.height_px) continue;
      DepthCauseTrial trial = TrialOf(cause);
      const auto place = edges.Of(Reordered(small_.disparity, trial, small_.scale), 1);
      if (!place || place->is_unclear) continue;
      trial.edges = place->sigmas;
      found_->trials.push_back(trial);
      orders.push_back(trial);
    }
    std::stable_sort(
        orders.begin(), orders.end(),
        [](const DepthCauseTrial& a, const DepthCauseTrial& b) { return *a.edges > *b.edges; });
    const double best = orders.empty() ? 0 : *orders.front().edges;
    const bool is_far = std::max(std::abs(given.best_x), std::abs(given.best_y)) >= kMinShiftPx;
    if (best >= kOtherOrder && best >= given.sigmas + kMoreThanGiven &&
        given.sigmas <= kOfBest * best && best >= given.best_sigmas) {
      for (const DepthCauseTrial& order : orders) {
        if (*order.edges >= kAboutTheBest * best) found_->causes.push_back(order);
      }
      // One symmetrical thing may be reversed or moved.
      if (is_far && given.best_sigmas >= std::max(kOtherPlace, kAboutTheBest * best))
        CompareWithShift(given);
      found_->is_contradicted = true;
      found_->message = fmt::format(
          "in another order, the depth's edges lie on edges of the photograph ({:.1f} standard "
          "deviations; as it is: {:.1f})",
          best, given.sigmas);
      return true;
    }
    if (!is_far || given.best_sigmas < kOtherPlace ||
        given.best_sigmas < given.sigmas + kMoreThanGiven + 1 ||
        given.sigmas > kOfBest * given.best_sigmas || given.best_sigmas < best / kAboutTheBest) {
      return false;
    }
    DepthCauseTrial shift = ShiftOf(given);
    // The edges of a dilated map lie elsewhere as well, but to both sides.
    const bool is_single =
        std::max(std::abs(given.best_x), std::abs(given.best_y)) >= kFarShiftPx &&
        given.best_sigmas >= kSinglePlace &&
        given.opposite_sigmas <= kOfSinglePlace * given.best_sigmas;
    if (!is_single) shift.residual = ResidualOf(shift);
    found_->trials.push_back(shift);
    if (!is_single && !(*shift.residual >= kShiftDecided)) return false;
    found_->causes = {shift};
    found_->is_contradicted = true;
    found_->message = fmt::format(
        "{} px farther right and {} px farther down, the depth's edges lie on edges of the "
        "photograph ({:.1f} standard deviations; as it is: {:.1f})",
        shift.shift_x_px, shift.shift_y_px, given.best_sigmas, given.sigmas);
    return true;
  }

  DepthCauseTrial ShiftOf(const EdgeCoincidence::Found& given) const {
    DepthCauseTrial shift = TrialOf(DepthCause::kShift);
    shift.shift_x_px = static_cast<int>(std::lround(given.best_x * small_.scale));
    shift.shift_y_px = static_cast<int>(std::lround(given.best_y * small_.scale));
    shift.edges = given.best_sigmas;
    return shift;
  }

  // Names the shift beside an order unless the order explains the photograph better.
  void CompareWithShift(const EdgeCoincidence::Found& given) {
    DepthCauseTrial shift = ShiftOf(given);
    const ReducedPhoto& photo = Least();
    const auto explained = [&](const DepthCauseTrial& change) {
      return ExplainedBy(photo, Reordered(photo.disparity, change, photo.scale), input_,
                         options_.photo_aperture, threads_);
    };
    // Against the map in that order.
    shift.residual =
        SigmasBetter(explained(found_->causes.front()), explained(shift), NoiseOfBlock());
    found_->trials.push_back(shift);
    if (*shift.residual > -kShiftDecided) found_->causes.push_back(shift);
  }

  // Whether the map's edges lie on the photograph's no more often than elsewhere, although no order
  // and no place is certain. Those that may be right are named beside another image.
  bool IsNowhere(const EdgeCoincidence::Found& given) {
    if (!(given.sigmas < kAtPlace && given.coarse_sigmas < kNearPlace &&
          given.best_sigmas < kOtherPlace))
      return false;
    for (const DepthCauseTrial& order : found_->trials) {
      if (order.cause != DepthCause::kNone && order.cause != DepthCause::kShift &&
          *order.edges >= kMayBeRight)
        found_->causes.push_back(order);
    }
    std::stable_sort(
        found_->causes.begin(), found_->causes.end(),
        [](const DepthCauseTrial& a, const DepthCauseTrial& b) { return *a.edges > *b.edges; });
    if (given.best_sigmas >= kOtherOrder) {
      found_->causes.push_back(ShiftOf(given));
    }
    found_->causes.push_back(TrialOf(DepthCause::kOtherImage));
    found_->is_contradicted = true;
    found_->message = fmt::format(
        "the depth's edges lie on edges of the photograph no more often than elsewhere ({:.1f} "
        "standard deviations{})",
        given.sigmas,
        found_->causes.size() == 1 ? ", and in no other order and at no other place more often"
                                   : "");
    return true;
  }

  // Standard deviations by which the changed map explains the reduced photograph better.
  double ResidualOf(const DepthCauseTrial& change) {
    const ReducedPhoto& photo = Least();
    if (!explained_) {
      explained_ = ExplainedBy(photo, photo.disparity, input_, options_.photo_aperture, threads_);
    }
    return SigmasBetter(*explained_,
                        ExplainedBy(photo, Reordered(photo.disparity, change, photo.scale), input_,
                                    options_.photo_aperture, threads_),
                        NoiseOfBlock());
  }

  const ReducedPhoto& Least() {
    if (!least_) least_ = ReducedTo(kResidualPixels, small_);
    return *least_;
  }
  double NoiseOfBlock() {
    const double sigma = NoiseOf(Least(), input_, options_.compression_sigma);
    return sigma * sigma * kResidualBlockPx * kResidualBlockPx;
  }

  void TryValues(bool has_edges, bool is_at_place) {
    if (!(options_.photo_aperture > 0)) {
      found_->values_untested = "the photograph is taken as sharp";
      return;
    }
    if (options_.compression_sigma > 0 || ShowsJpegBlocks(input_.image, input_.transfer)) {
      found_->values_untested = "the photograph's compression hides its blur";
      return;
    }
    const TileLikelihood tiles(photo_, input_, options_.photo_aperture,
                               NoiseOf(photo_, input_, options_.compression_sigma), threads_);
    // Offsets are stated in px of the photograph, whose step the reduced one has not.
    const double step = photo_.disparity.step.cwiseAbs().maxCoeff() * photo_.scale;
    // The textures of a few tiles may differ by chance as their blur would. Tiles of one blur say
    // nothing of it: what they have in common may be their texture.
    constexpr std::size_t kMinTiles = 16;
    constexpr double kMinRangePx = 0.3;
    if (tiles.tiles() < kMinTiles) {
      found_->values_untested =
          fmt::format("of the {} parts that are needed, {} show one depth and more than noise",
                      kMinTiles, tiles.tiles());
      return;
    }
    if (!(tiles.BlurRangePx() >= kMinRangePx)) {
      found_->values_untested = fmt::format(
          "the predicted blur is about the same everywhere (its standard deviation changes by "
          "{:.2g} px, {:g} are needed), as the texture may be",
          tiles.BlurRangePx(), kMinRangePx);
      return;
    }
    const auto trial = [&](DepthCause cause, double scale, double offset) {
      const TileLikelihood::Gain gain = tiles.OfValues(scale, offset / step);
      DepthCauseTrial made = TrialOf(cause, scale, offset);
      made.spectra = gain.mean;
      made.spectra_sigma = gain.sigma;
      return made;
    };
    constexpr int kScalesDown = 18, kScalesUp = 8, kOffsets = 20;
    constexpr double kScalesPerOctave = 6, kOffsetSigmaPx = 0.15;
    const double offset_px = kOffsetSigmaPx / tiles.spread_px() * step;
    // Blur does not show the side of focus, so that an offset to each side may explain it.
    std::array<DepthCauseTrial, 4> best_of = {
        trial(DepthCause::kScale, 1, 0), trial(DepthCause::kOffset, 1, 0),
        trial(DepthCause::kOffset, 1, 0), trial(DepthCause::kScaleOffset, 1, 0)};
    const auto keep = [](const DepthCauseTrial& made, DepthCauseTrial* best) {
      if (!(*made.spectra > *best->spectra)) return;
      const DepthCause cause = best->cause;
      *best = made;
      best->cause = cause;
    };
    for (int i = -kScalesDown; i <= kScalesUp; ++i) {
      const double factor = std::exp2(i / kScalesPerOctave);
      const bool is_moderate = std::abs(i) <= kScalesUp;
      for (int j = -kOffsets; j <= kOffsets; ++j) {
        if (j != 0 && !is_moderate) continue;
        const DepthCauseTrial made = trial(DepthCause::kNone, factor, j * offset_px);
        if (j == 0) keep(made, &best_of[0]);
        if (i == 0) keep(made, &best_of[j < 0 ? 1 : 2]);
        if (is_moderate) keep(made, &best_of[3]);
      }
    }
    std::vector<DepthCauseTrial> tried(best_of.begin(), best_of.end() - 1);
    tried.push_back(trial(DepthCause::kSharp, 0, 0));
    // Two numbers suit a wrong map more easily than one.
    if (*best_of[3].spectra >= kMuchLikelierTwo) tried.push_back(best_of[3]);
    if (!has_edges) {
      for (const DepthCause cause : {DepthCause::kRows, DepthCause::kColumns, DepthCause::kBoth,
                                     DepthCause::kQuarterRight, DepthCause::kQuarterLeft}) {
        if (cause >= DepthCause::kQuarterRight &&
            photo_.disparity.width_px != photo_.disparity.height_px)
          continue;
        DepthCauseTrial order = TrialOf(cause);
        const DisparityMap map = Reordered(photo_.disparity, order, photo_.scale);
        const auto gain = tiles.Against([&](const PhotoTile& tile) {
          return DisparityOfTile(map, tile.x, tile.y, tiles.spread_px());
        });
        if (!gain) continue;
        order.spectra = gain->mean;
        order.spectra_sigma = gain->sigma;
        tried.push_back(order);
      }
    }
    found_->trials.insert(found_->trials.end(), tried.begin(), tried.end());
    std::stable_sort(
        tried.begin(), tried.end(),
        [](const DepthCauseTrial& a, const DepthCauseTrial& b) { return *a.spectra > *b.spectra; });
    const DepthCauseTrial& first = tried.front();
    const double best = *first.spectra;
    const bool is_small =
        first.cause != DepthCause::kSharp && std::abs(std::log2(first.scale)) < kMinOctaves &&
        std::abs(first.offset_px) / step * tiles.spread_px() < kMinOffsetPx &&
        (first.cause == DepthCause::kScale || first.cause == DepthCause::kOffset ||
         first.cause == DepthCause::kScaleOffset);
    if (is_small || !(best >= kMuchLikelier && best >= kLikelierSigmas * *first.spectra_sigma))
      return;
    found_->is_contradicted = true;
    for (DepthCauseTrial& cause : tried) {
      if (*cause.spectra < best - std::max(kAlike, kAlikeShare * best)) continue;
      // So little blur is none.
      if (cause.cause == DepthCause::kScale && cause.scale <= kNoBlurScale) continue;
      found_->causes.push_back(cause);
    }
    if (found_->causes.empty()) {
      found_->causes.push_back(*std::find_if(
          tried.begin(), tried.end(),
          [](const DepthCauseTrial& cause) { return cause.cause == DepthCause::kSharp; }));
    }
    // A change of both is named where neither alone does.
    const auto is_single = [](const DepthCauseTrial& cause) {
      return cause.cause != DepthCause::kScaleOffset;
    };
    if (std::any_of(found_->causes.begin(), found_->causes.end(), is_single)) {
      found_->causes.erase(
          std::stable_partition(found_->causes.begin(), found_->causes.end(), is_single),
          found_->causes.end());
    }
    if (!is_at_place) found_->causes.push_back(TrialOf(DepthCause::kOtherImage));
    found_->is_sign_open = found_->causes.front().cause == DepthCause::kOffset ||
                           found_->causes.front().cause == DepthCause::kScaleOffset;
    if (found_->is_sign_open) DecideSide(&found_->causes.front());
    found_->message = fmt::format(
        "other disparities explain the blur of the photograph better (logarithm of the likelihood "
        "ratio {:.0f} +- {:.0f})",
        best, *found_->causes.front().spectra_sigma);
  }

  // Which of the two signs the changed disparities have.
  void DecideSide(DepthCauseTrial* cause) {
    const ReducedPhoto& photo = Least();
    const double step = photo.disparity.step.cwiseAbs().maxCoeff() * photo.scale;
    DisparityMap changed = photo.disparity, mirrored = photo.disparity;
    for (std::size_t i = 0; i < changed.disparity.size(); ++i) {
      const double value =
          cause->scale * static_cast<double>(changed.disparity[i]) + cause->offset_px / step;
      changed.disparity[i] = static_cast<float>(value);
      mirrored.disparity[i] = static_cast<float>(-value);
    }
    const double sigmas = SigmasBetter(
        ExplainedBy(photo, mirrored, input_, options_.photo_aperture, threads_),
        ExplainedBy(photo, changed, input_, options_.photo_aperture, threads_), NoiseOfBlock());
    cause->residual = sigmas;
    found_->is_sign_open = std::abs(sigmas) < kSignDecided;
    if (sigmas <= -kSignDecided) {
      cause->scale = -cause->scale;
      cause->offset_px = -cause->offset_px;
      cause->cause = DepthCause::kScaleOffset;
    }
  }

  void TrySign() {
    DepthCauseTrial sign = TrialOf(DepthCause::kSign, -1);
    sign.residual = ResidualOf(sign);
    found_->trials.push_back(sign);
    if (!(*sign.residual >= kSignDecided)) return;
    found_->is_contradicted = true;
    found_->causes = {sign};
    // A wrong offset also has more on the wrong side of the plane of focus.
    constexpr double kHint = 5, kHintSigmas = 3;
    for (const DepthCauseTrial& trial : found_->trials) {
      if (trial.spectra && trial.cause == DepthCause::kOffset && *trial.spectra >= kHint &&
          *trial.spectra >= kHintSigmas * *trial.spectra_sigma)
        found_->causes.push_back(trial);
    }
    found_->message = fmt::format(
        "with near and far exchanged, the depth explains the edges of the photograph better "
        "({:.1f} "
        "standard deviations)",
        *sign.residual);
  }

  const EstimateInput& input_;
  const DepthContradictionOptions& options_;
  const int threads_;
  const ReducedPhoto photo_, small_;
  std::optional<ReducedPhoto> least_;
  std::optional<ResidualBlocks> explained_;
  DepthContradiction* const found_;
};

}  // namespace

bool DepthContradictionOptions::IsValid(std::string* why) const {
  return IsAtLeast(0, "threads", threads, why) &&
         IsNonNegative("compression_sigma", compression_sigma, why) &&
         IsNonNegative("photo_aperture", photo_aperture, why);
}

std::string DepthCauseName(DepthCause cause) {
  switch (cause) {
    case DepthCause::kRows:
      return "rows";
    case DepthCause::kColumns:
      return "columns";
    case DepthCause::kBoth:
      return "both";
    case DepthCause::kQuarterRight:
      return "quarter-right";
    case DepthCause::kQuarterLeft:
      return "quarter-left";
    case DepthCause::kShift:
      return "shift";
    case DepthCause::kSign:
      return "sign";
    case DepthCause::kScale:
      return "scale";
    case DepthCause::kOffset:
      return "offset";
    case DepthCause::kScaleOffset:
      return "scale-and-offset";
    case DepthCause::kSharp:
      return "sharp";
    case DepthCause::kOtherImage:
      return "other-image";
    case DepthCause::kNone:
      break;
  }
  return "none";
}

DepthContradiction CheckContradiction(const EstimateInput& input,
                                      const DepthContradictionOptions& options) {
  CheckOptions("depth contradiction", options);
  CheckInput(input);
  const auto start = Clock::now();
  DepthContradiction found;
  if (std::min(input.image.width_px, input.image.height_px) < kMinSidePx) {
    found.trials.push_back({});
    found.message = fmt::format(
        "a photograph of less than {} px does not show whether its depth agrees", kMinSidePx);
    found.values_untested = fmt::format("the photograph has less than {} px", kMinSidePx);
  } else {
    Search(input, options, ResolveThreads(options.threads), &found).Run();
  }
  found.seconds = SecondsSince(start);
  return found;
}

}  // namespace thicklens::estimator
