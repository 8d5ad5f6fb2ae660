#include "estimator/scene/scene_radiance.h"

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <numeric>
#include <utility>

#include "estimator/scene/coarse_start.h"
#include "estimator/scene/encoding_slope.h"
#include "estimator/scene/lower_bounds.h"
#include "estimator/scene/scene_patches.h"
#include "estimator/scene/scene_strength.h"
#include "thicklens/base/run_cost.h"
#include "thicklens/kernels/device.h"

namespace thicklens::estimator {
namespace {

// An image starts from the estimate at half its size unless it is smaller than this.
constexpr int kMinCoarsePx = 128;
// Tolerance of that estimate relative to that at full size: work that is left to the full size
// costs four times as much there.
constexpr double kCoarseTolerance = 0.3;
constexpr int kCoarseIterations = 80;

// Returns the equivalent strength at half the size, where the data have a quarter of the pixels and
// differences are twice as large.
double CoarseStrength(Prior prior, double strength) {
  switch (prior) {
    case Prior::kRidge:
      return strength;
    case Prior::kGradient:
      return strength / 4;
    case Prior::kTotalVariation:
    case Prior::kPatches:
      break;
  }
  return strength / 2;
}

// Patches begin with total variation.
Prior SolvedFirst(Prior prior) { return prior == Prior::kPatches ? Prior::kTotalVariation : prior; }

// A photograph through a pinhole shows the radiance itself. Where its texture is fine it hides the
// noise, and a prior for a noise that is too large would remove details: without a stated strength
// none is used, so that the views are never worse than the warped photograph.
bool IsTheCentreView(const SceneOptions& options) {
  return options.photo_aperture == 0 && options.strength_rule == StrengthRule::kAuto;
}

// Standard deviation of the Gaussian that smooths the intensity for the slope of the transfer
// curve.
constexpr double kSlopeSmoothingPx = 2;

}  // namespace

double MeanSlope(const model::LinearImage& photograph, const model::TransferCurve& transfer,
                 const std::vector<SceneBand>& bands) {
  double sum = 0, count = 0;
  for (const SceneBand& band : bands) {
    const std::vector<double> slopes =
        EncodingSlopes(bands.size() == 1 ? photograph : CutRows(photograph, band.from, band.to),
                       transfer, kSlopeSmoothingPx);
    const auto row = [&](int y) {
      return slopes.begin() + static_cast<std::ptrdiff_t>(y - band.from) * photograph.width_px;
    };
    sum = std::accumulate(row(band.first), row(band.last), sum);
    count += static_cast<double>(row(band.last) - row(band.first));
  }
  return sum / count;
}

template <typename Real>
double SceneRadiance<Real>::FindStart(const model::LinearImage& photograph,
                                      const DisparityMap& disparity, const SceneBand& band) {
  if (std::min(photograph.width_px, photograph.height_px) < 2 * kMinCoarsePx) return 0;
  if (IsTheCentreView(run_.options)) return 0;
  EstimateInput half;
  half.image = HalfSize(photograph);
  half.disparity = HalfSize(disparity);
  half.clipped = HalfSize(
      CutRows(run_.input.clipped, photograph.width_px, photograph.channels, band.from, band.to),
      photograph.width_px, photograph.height_px, photograph.channels);
  half.weights = run_.input.weights;
  half.transfer = run_.input.transfer;
  SceneOptions options = run_.options;
  options.tolerance = kCoarseTolerance * options.tolerance_or_usual();
  options.max_iterations = std::min(options.max_iterations, kCoarseIterations);
  options.prior = SolvedFirst(options.prior);
  options.strength = CoarseStrength(options.prior, options.strength);
  if (options.strength_rule == StrengthRule::kGcv) options.strength_rule = StrengthRule::kAuto;
  const ProgressFunction report = [this](int, int) { run_.progress->Report(); };
  IterationProgress progress(report, 1);
  Run run{half, options};
  run.backend = run_.backend;
  run.memory_limit_mib = run_.memory_limit_mib;
  run.threads = run_.threads;
  run.noise_sigma =
      EncodedNoiseSigma(half.image, half.transfer, half.clipped).value_or(kDefaultNoise / 2);
  run.mean_slope = run_.mean_slope;
  run.progress = &progress;
  SceneRadiance coarse(run);
  const int height_px = half.image.height_px;
  coarse.Prepare(half.image, half.disparity, {0, height_px, 0, height_px});
  const auto prepared = Clock::now();
  SceneSummary unused;
  start_ = WithDetail(photograph, half.image, coarse.Solve(&unused));
  return SecondsSince(prepared);
}

template <typename Real>
void SceneRadiance<Real>::Prepare(const model::LinearImage& photograph,
                                  const DisparityMap& disparity, const SceneBand& band) {
  band_ = band;
  disparity_ = &disparity;
  ProjectionOptions projection;
  projection.threads = run_.threads;
  projection.interpolation = run_.options.cubic ? Interpolation::kCubic : Interpolation::kLinear;
  projection.visible_fraction = run_.confidence;
  projection.bundle = run_.bundle;
  projection.progress = [this] { run_.progress->Report(); };
  projection.freed = [this] { ReturnFreedMemory(run_.memory_limit_mib); };
  projection_ = MakeSceneProjection<Real>(disparity, run_.input.weights, projection);
  ReturnFreedMemory(run_.memory_limit_mib);

  data_ = DataTermOf(projection_, photograph, run_.threads);
  data_.bounds =
      BoundsInPlanes(run_.input.clipped, data_.width_px, data_.channels, band.from, band.to);
  slope_squared_ = SlopeSquared(photograph);
  data_.weight =
      DataWeights(slope_squared_, projection_.occluded_fraction, run_.options.disocclusion_weights);
  data_.row_norm2 = SquaredRows<Real>(disparity, run_.input.weights);
}

template <typename Real>
ProjectionBytes SceneRadiance<Real>::BytesOfRows(int first, int last) const {
  constexpr double kOnDevice = 2;  // at most: filters as they are and transposed
  const bool on_device = run_.backend != nullptr && run_.backend->is_opencl();
  return {projection_.bytes(first, last) * (on_device ? 1 + kOnDevice : 1),
          projection_.bundle_bytes * (last - first) / projection_.height_px};
}

template <typename Real>
SignalSum SceneRadiance<Real>::Signal() const {
  return SignalOf(run_.options.prior, data_, slope_squared_, first_row(), last_row());
}

template <typename Real>
model::LinearImage SceneRadiance<Real>::Solve(SceneSummary* summary) {
  const SceneOptions& options = run_.options;
  auto system = std::make_unique<SceneSystem<Real>>(data_, run_.backend);
  std::vector<Real> radiance = start_.values.empty() ? data_.photograph : Planar<Real>(start_);
  start_ = {};
  RadianceLimits limits;
  limits.tolerance = options.tolerance_or_usual();
  limits.max_iterations = options.max_iterations;
  limits.on_iteration = [this] { run_.progress->CountUpTo(run_.last_iteration); };
  summary->strength = IsTheCentreView(options) ? 0 : options.strength;
  const double sigma = std::max(run_.noise_sigma, kMinNoise);
  const bool is_view = IsTheCentreView(options);
  if (options.strength_rule != StrengthRule::kGiven && !is_view) {
    summary->strength = StrengthForNoise(options.prior, sigma, data_, slope_squared_);
  }
  if (options.strength_rule == StrengthRule::kGcv) {
    const StrengthSearch search =
        SearchStrength(SolvedFirst(options.prior), summary->strength, data_, slope_squared_, limits,
                       system.get(), &radiance);
    summary->strength = search.strength;
    summary->iterations = search.iterations;
  }
  RadianceOutcome taken;
  taken.converged = true;
  const RadianceOutcome outcome =
      is_view ? taken
      : options.prior == Prior::kPatches
          ? SolveWithPatches(
                {summary->strength, sigma, run_.input.transfer, disparity_, run_.guide_slope},
                data_, slope_squared_, limits, std::move(system), run_.backend, &radiance)
          : SolveRadiance(options.prior, summary->strength, data_, slope_squared_, limits,
                          system.get(), &radiance);
  summary->iterations += outcome.iterations;
  summary->reweightings = outcome.reweightings;
  summary->converged = outcome.converged;
  summary->relative_residual = outcome.relative_residual;
  system.reset();  // frees its memory
  residual_ = EncodedResidualOf(data_, radiance, run_.input.transfer, first_row(), last_row());
  summary->residual_rms = residual_.rms;
  FillShares(summary);
  return Interleaved(radiance, data_.width_px, data_.height_px, data_.channels);
}

template <typename Real>
void SceneRadiance<Real>::AddMaps(SceneMaps* maps) const {
  AddRows(residual_.mean, &maps->residual);
  AddRows(projection_.occluded_fraction, &maps->occluded_fraction);
  AddRows(BlurSigmaPx(*disparity_, run_.input.weights), &maps->blur_sigma_px);
}

template <typename Real>
void SceneRadiance<Real>::AddConfidence(std::vector<Confidence>* of_points) const {
  const std::vector<float> sigma_px = BlurSigmaPx(*disparity_, run_.input.weights);
  for (std::size_t i = PixelOfRow(first_row()); i < PixelOfRow(last_row()); ++i) {
    of_points->push_back(ConfidenceOfPoint(static_cast<double>(projection_.visible_fraction[i]),
                                           static_cast<double>(sigma_px[i])));
  }
}

template <typename Real>
std::size_t SceneRadiance<Real>::PixelOfRow(int row) const {
  return static_cast<std::size_t>(row) * static_cast<std::size_t>(disparity_->width_px);
}

template <typename Real>
void SceneRadiance<Real>::AddRows(const std::vector<float>& plane, std::vector<float>* to) const {
  to->insert(to->end(), plane.begin() + static_cast<std::ptrdiff_t>(PixelOfRow(first_row())),
             plane.begin() + static_cast<std::ptrdiff_t>(PixelOfRow(last_row())));
}

// Returns s^2. Without slope weights it is that of the whole image, so that strengths keep their
// unit.
template <typename Real>
std::vector<Real> SceneRadiance<Real>::SlopeSquared(const model::LinearImage& photograph) const {
  if (!run_.options.slope_weights) {
    return std::vector<Real>(disparity_->disparity.size(),
                             static_cast<Real>(run_.mean_slope * run_.mean_slope));
  }
  const std::vector<double> slopes =
      EncodingSlopes(photograph, run_.input.transfer, kSlopeSmoothingPx);
  std::vector<Real> squares;
  squares.reserve(slopes.size());
  for (const double slope : slopes) squares.push_back(static_cast<Real>(slope * slope));
  return squares;
}

template <typename Real>
void SceneRadiance<Real>::FillShares(SceneSummary* summary) const {
  const std::size_t first = PixelOfRow(first_row()), last = PixelOfRow(last_row());
  const auto count = static_cast<double>(last - first);
  const auto occluded = [&](std::size_t i) {
    return projection_.occluded_fraction.begin() + static_cast<std::ptrdiff_t>(i);
  };
  summary->occluded_fraction = std::accumulate(occluded(first), occluded(last), 0.0) / count;
  summary->row_share =
      static_cast<double>(projection_.pixels_with_row(first_row(), last_row())) / count;
}

template class SceneRadiance<float>;
template class SceneRadiance<double>;

}  // namespace thicklens::estimator
