#include "calib/uncertainty/floor_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "thicklens/base/pi.h"
#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

// Interval of a blur floor that was not measured, px of the sensor: from a perfect lens to a soft
// one. If the target does not exclude it, the interval extends to the softest lens that gives a
// sharp image.
constexpr double kUnknownFloorFromPx = 0;
constexpr double kUnknownFloorToPx = 1.0;
constexpr double kSoftestLensPx = 3.0;

constexpr int kRings = 14;
constexpr double kLowestFrequency = 0.03, kHighestFrequency = 0.33;  // cycles per px
// The range where a soft image has noise alone; remaining detail of a sharp image makes the bound
// larger.
constexpr double kNoiseFrom = 0.40, kNoiseTo = 0.49;
constexpr int kMinModes = 8;  // per ring

// Returns sigma^2 of the target's edges in the plane of focus, of lens and ink together, if it has
// edges.
std::optional<double> EdgeSoftness(const BlurEvidence& evidence, int sensor_px_per_px) {
  BlurFitSetup setup = evidence.setup;
  if (evidence.edges >= 0) {
    setup.estimators = {setup.estimators[static_cast<std::size_t>(evidence.edges)]};
    setup.estimators[0].held_softness_px2 = 0;
    setup.floor_variance_px2.reset();
    const BlurFitResult fit = FitBlur(setup);
    if (!fit.done || !(fit.values[kFloorVariance] > 0)) return std::nullopt;
    return fit.values[kFloorVariance];
  }
  if (!evidence.unstated_edges) return std::nullopt;
  const double unknown_to_px = kUnknownFloorToPx / sensor_px_per_px;
  setup.floor_variance_px2 = model::Estimate{unknown_to_px * unknown_to_px / 2, 0};
  const BlurFitResult fit = FitBlur(setup);
  if (!fit.done) return std::nullopt;
  const double sign = model::DirectionSign(setup.direction);
  std::vector<double> rests;
  for (std::size_t i = 0; i < evidence.unstated_edges->frames.size(); ++i) {
    const FitFrame& frame = setup.frames[evidence.unstated_edges->frames[i]];
    const double depth_mm = setup.offset_mm.value + sign * frame.reading_mm;
    const double defocus =
        FittedDefocusVariance(setup, fit, depth_mm) +
        std::pow(fit.values[kBlurRatio], 2) * AstigmaticVariance(setup, fit.values[kFocusDepth]);
    rests.push_back(evidence.unstated_edges->variances_px2[static_cast<Eigen::Index>(i)] *
                        frame.scale * frame.scale -
                    defocus);
  }
  const double softness = Median(rests);
  return softness > 0 ? std::optional<double>(softness) : std::nullopt;
}

Eigen::Vector2d UnknownFloor(const BlurEvidence& evidence, std::vector<std::string>* warnings,
                             int sensor_px_per_px) {
  if (const auto softness_px2 = EdgeSoftness(evidence, sensor_px_per_px)) {
    // The interval is from none of the edge's softness to all of it.
    warnings->push_back(fmt::format(
        "the {} have a blur of {:.2f} px at focus; the shares of the lens and of the target in "
        "it are not known: photograph a knife edge, or state blur_floor_px",
        evidence.by_points ? "points" : "edges", sensor_px_per_px * std::sqrt(*softness_px2)));
    return {0, *softness_px2};
  }
  double to_px = kUnknownFloorToPx;
  std::string why = "but not those of a softer lens";
  if (evidence.spectrum >= 0) {
    const std::optional<double> bound = LargestBlurVariance(evidence.spectral, evidence.region);
    const double bound_px =
        bound ? sensor_px_per_px * std::sqrt(std::max(0.0, *bound)) : kSoftestLensPx;
    if (bound_px > to_px) {
      to_px = std::min(bound_px, kSoftestLensPx);
      why = "because the texture, which shows little fine detail, does not exclude so soft a lens";
    }
  }
  warnings->push_back(
      fmt::format("this target does not determine the blur floor; values from {} to {:.1f} px are "
                  "allowed for, {}: measure the floor on a knife edge, or state blur_floor_px",
                  kUnknownFloorFromPx, to_px, why));
  const Eigen::Vector2d frame_px = Eigen::Vector2d(kUnknownFloorFromPx, to_px) / sensor_px_per_px;
  return frame_px.cwiseProduct(frame_px);
}

struct Ring {
  double nu = 0, power = 0, sigma = 0;  // |nu| as rms; mean power and its error
};

// Returns the mean noise power of a mode, with the pixel's box still in it.
double NoisePower(const SpectralEstimatorSetup& estimator, const EstimatorRegion& region) {
  const EstimatorFrame& frame = estimator.frames[estimator.reference];
  const std::vector<Mode> modes = ModesBetween(region.window, kNoiseFrom, kNoiseTo);
  const auto spectrum = MeasureSpectrum(estimator.read_grey(frame.frame), estimator.origin_px,
                                        frame.place, region.window, modes, modes.size());
  if (!spectrum || modes.empty()) return 0;
  double sum = 0;
  for (std::size_t k = 0; k < modes.size(); ++k) {
    const double box = BoxTransfer(modes[k], region.window, frame.place.scale);
    sum += std::norm(spectrum->values[static_cast<Eigen::Index>(k)]) * box * box;
  }
  return std::max(sum / static_cast<double>(modes.size()),
                  spectrum->noise_gain * frame.pixel_noise * frame.pixel_noise);
}

std::vector<Ring> MeasureRings(const SpectralEstimatorSetup& estimator,
                               const EstimatorRegion& region) {
  const EstimatorFrame& frame = estimator.frames[estimator.reference];
  const std::vector<Mode> modes = ModesBetween(region.window, kLowestFrequency, kHighestFrequency);
  const auto spectrum = MeasureSpectrum(estimator.read_grey(frame.frame), estimator.origin_px,
                                        frame.place, region.window, modes, modes.size());
  if (!spectrum) return {};
  const double noise = NoisePower(estimator, region);
  std::vector<Ring> rings(kRings);
  std::vector<int> counts(kRings, 0);
  std::vector<double> raw(kRings, 0);
  for (std::size_t k = 0; k < modes.size(); ++k) {
    const double nu = ModeFrequency(modes[k], region.window).norm();
    const double part = (nu - kLowestFrequency) / (kHighestFrequency - kLowestFrequency);
    const auto r = static_cast<std::size_t>(std::clamp<int>(int(part * kRings), 0, kRings - 1));
    const double box = BoxTransfer(modes[k], region.window, frame.place.scale);
    const double power = std::norm(spectrum->values[static_cast<Eigen::Index>(k)]);
    rings[r].nu += nu * nu;
    rings[r].power += power - noise / (box * box);
    raw[r] += power;
    ++counts[r];
  }
  std::vector<Ring> kept;
  for (std::size_t r = 0; r < rings.size(); ++r) {
    if (counts[r] < kMinModes) continue;
    Ring ring = rings[r];
    ring.nu = std::sqrt(ring.nu / counts[r]);
    ring.power /= counts[r];
    // The standard deviation of a random texture's power, noise included, is equal to its mean.
    ring.sigma = raw[r] / counts[r] / std::sqrt(counts[r]);
    kept.push_back(ring);
  }
  return kept;
}

}  // namespace

FloorChoice ChooseFloor(const model::FloorKnowledge& known, const BlurEvidence& evidence,
                        std::vector<std::string>* warnings, int sensor_px_per_px) {
  FloorChoice choice;
  const std::vector<BlurSamples>& estimators = evidence.setup.estimators;
  if (known.given_px) {
    const double px = known.given_px->value;
    const double sigma_px = known.given_px->sigma;
    // Near 0 the square's own term counts [D82]: the variance of x^2 is 4 mu^2 s^2 + 2 s^4.
    choice.variance_px2 = model::Estimate{
        px * px, std::hypot(2 * px * sigma_px, std::sqrt(2.0) * sigma_px * sigma_px)};
  } else if (known.from_px) {
    choice.interval_px2 =
        Eigen::Vector2d(*known.from_px * *known.from_px, *known.to_px * *known.to_px);
  } else if (std::any_of(estimators.begin(), estimators.end(), [](const BlurSamples& estimator) {
               return estimator.held_softness_px2.has_value();
             })) {
    choice.is_measured = true;
  } else {
    choice.interval_px2 = UnknownFloor(evidence, warnings, sensor_px_per_px);
  }
  if (choice.interval_px2) choice.variance_px2 = model::Estimate{choice.interval_px2->mean(), 0};
  return choice;
}

std::optional<double> LargestBlurVariance(const SpectralEstimatorSetup& estimator,
                                          const EstimatorRegion& region) {
  if (region.samples.empty() || !estimator.read_grey) return std::nullopt;
  const std::vector<Ring> rings = MeasureRings(estimator, region);
  std::optional<double> least;
  for (std::size_t a = 0; a < rings.size(); ++a) {
    for (std::size_t b = a + 1; b < rings.size(); ++b) {
      const double most = rings[a].power + 2 * rings[a].sigma;
      const double fewest = rings[b].power - 2 * rings[b].sigma;
      if (!(fewest > 0) || !(most > 0)) continue;
      const double apart = rings[b].nu * rings[b].nu - rings[a].nu * rings[a].nu;
      const double bound = std::max(0.0, std::log(most / fewest) / (4 * kPi * kPi * apart));
      if (!least || bound < *least) least = bound;
    }
  }
  return least;
}

}  // namespace thicklens::calib
