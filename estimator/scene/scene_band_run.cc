#include "estimator/scene/scene_band_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "estimator/scene/guided_shading.h"
#include "estimator/views/ray_landing.h"
#include "thicklens/base/error.h"
#include "thicklens/base/residual_guard.h"
#include "thicklens/base/run_cost.h"

namespace thicklens::estimator {
namespace {

// Lower bands would consist mainly of margin.
constexpr int kMinRows = 16;
// For a large photograph, sampled bands with so many pixels in all represent the whole. A band has
// at least so many rows and not more rows of margin than that.
constexpr int kSampleRows = 16;
constexpr double kSamplePixels = 1 << 18;

// Combines the results of the bands into those of one image.
class JoinedSummary {
 public:
  void Add(const SceneSummary& of_band, int rows) {
    iterations_ = std::max(iterations_, of_band.iterations);
    reweightings_ = std::max(reweightings_, of_band.reweightings);
    converged_ = converged_ && of_band.converged;
    relative_residual_ = LargerResidual(relative_residual_, of_band.relative_residual);
    rows_ += rows;
    row_share_ += rows * of_band.row_share;
    occluded_fraction_ += rows * of_band.occluded_fraction;
    squares_ += rows * of_band.residual_rms * of_band.residual_rms;
    strength_ = of_band.strength;
  }

  // Throws Error if the iterations made no progress.
  void Fill(const SceneOptions& options, SceneSummary* summary) const {
    RequireProgress("scene", relative_residual_, iterations_,
                    options.strength_rule == StrengthRule::kGiven
                        ? fmt::format("allow more iterations, or use another strength than {:g}",
                                      options.strength)
                        : "allow more");
    summary->strength = strength_;
    summary->iterations = iterations_;
    summary->reweightings = reweightings_;
    summary->converged = converged_;
    summary->relative_residual = relative_residual_;
    summary->row_share = row_share_ / rows_;
    summary->occluded_fraction = occluded_fraction_ / rows_;
    summary->residual_rms = std::sqrt(squares_ / rows_);
  }

 private:
  int iterations_ = 0, reweightings_ = 0, rows_ = 0;
  bool converged_ = true;
  double strength_ = 0, relative_residual_ = 0;
  double row_share_ = 0, occluded_fraction_ = 0, squares_ = 0;
};

// Appends the rows of a band's result to those of the bands above.
void AddRows(const model::LinearImage& solved, const SceneBand& band, model::LinearImage* image) {
  const auto in_row =
      static_cast<std::ptrdiff_t>(solved.width_px) * static_cast<std::ptrdiff_t>(solved.channels);
  image->values.insert(image->values.end(),
                       solved.values.begin() + (band.first - band.from) * in_row,
                       solved.values.begin() + (band.last - band.from) * in_row);
  image->height_px += band.last - band.first;
}

}  // namespace

template <typename Real>
SceneBandRun<Real>::SceneBandRun(const EstimateInput& input, const SceneOptions& options,
                                 const SolverRun& run, const SceneMemory& memory, int reach_px,
                                 int iterations, IterationProgress* progress, SceneSummary* summary)
    : input_(input),
      options_(options),
      run_(run),
      memory_(memory),
      reach_px_(reach_px),
      iterations_(iterations),
      progress_(progress),
      summary_(summary) {}

template <typename Real>
SolvedScene SceneBandRun<Real>::Solve(const model::LinearImage& photograph, bool wants_confidence,
                                      SceneMaps* maps) {
  const auto start = Clock::now();
  const int height_px = photograph.height_px;
  if (!options_.slope_weights) {
    mean_slope_ = MeanSlope(photograph, input_.transfer,
                            BandsOf(height_px, options_.least_bands, BandMarginPx(reach_px_)));
  }
  if (options_.prior == Prior::kPatches) guide_slope_ = ShadingGuideSlope(input_.disparity);
  int count = std::min(options_.least_bands, height_px);
  if (run_.memory_limit_mib) {
    per_pixel_ = memory_.LargestPerPixel();
    if (MostBytes(count, per_pixel_) > *run_.memory_limit_mib * kBytesPerMib) {
      per_pixel_ = TakenSample(photograph).per_pixel;
      count = BandsFor(per_pixel_);
    }
  }
  summary_->setup_seconds += SecondsSince(start);
  for (;;) {
    std::optional<SolvedScene> solved = SolveIn(count, photograph, wants_confidence, maps);
    if (solved) return std::move(*solved);
    count = std::max(count + 1, BandsFor(per_pixel_));
  }
}

template <typename Real>
double SceneBandRun<Real>::MostBytes(int count, const ProjectionBytes& per_pixel) const {
  const int height_px = input_.image.height_px;
  const int rows =
      count == 1
          ? height_px
          : std::min(height_px, (height_px + count - 1) / count + 2 * BandMarginPx(reach_px_));
  return memory_.MostBytes(rows, memory_.OfRows(rows, per_pixel));
}

template <typename Real>
int SceneBandRun<Real>::BandsFor(const ProjectionBytes& per_pixel) const {
  const double limit = *run_.memory_limit_mib * kBytesPerMib;
  const int least = std::min(options_.least_bands, input_.image.height_px);
  const int most = std::max(least, input_.image.height_px / kMinRows);
  double needed = MostBytes(least, per_pixel);
  for (int count = least; count <= most; ++count) {
    const double bytes = MostBytes(count, per_pixel);
    if (bytes <= limit) return count;
    needed = std::min(needed, bytes);
  }
  throw Error(fmt::format(
      "memory limit {:.0f} MiB: with any number of bands {:.0f} MiB are needed; the limit must be "
      "at least as large, or use fewer views or threads, or a smaller image",
      *run_.memory_limit_mib, std::ceil(needed / kBytesPerMib)));
}

template <typename Real>
typename SceneRadiance<Real>::Run SceneBandRun<Real>::RunFor(const SceneOptions& options) const {
  typename Radiance::Run run{input_, options};
  run.backend = run_.backend;
  run.memory_limit_mib = run_.memory_limit_mib;
  run.threads = summary_->threads;
  run.noise_sigma = summary_->noise_sigma;
  run.mean_slope = mean_slope_;
  run.guide_slope = guide_slope_;
  run.progress = progress_;
  return run;
}

template <typename Real>
double SceneBandRun<Real>::Prepare(const model::LinearImage& photograph, const SceneBand& band,
                                   Start start, Radiance* radiance) {
  const bool whole = band.rows() == photograph.height_px;
  if (!whole) band_disparity_ = CutRows(input_.disparity, band.from, band.to);
  if (input_.grid) {
    band_disparity_ = PhotographDisparity(whole ? input_.disparity : band_disparity_,
                                          LandingStepPx(*input_.camera, *input_.grid));
  }
  if (options_.photo_aperture != 1) {
    if (whole && !input_.grid) band_disparity_ = input_.disparity;
    for (float& value : band_disparity_.disparity)
      value *= static_cast<float>(options_.photo_aperture);
  }
  const bool is_own = whole && !input_.grid && options_.photo_aperture == 1;
  const DisparityMap& disparity = is_own ? input_.disparity : band_disparity_;
  const std::optional<model::LinearImage> cut =
      whole ? std::nullopt : std::optional(CutRows(photograph, band.from, band.to));
  const model::LinearImage& rows = cut ? *cut : photograph;
  double seconds = 0;
  if (start == Start::kFound) {
    seconds = radiance->FindStart(rows, disparity, band);
    ReturnFreedMemory(run_.memory_limit_mib);
  }
  radiance->Prepare(rows, disparity, band);
  return seconds;
}

template <typename Real>
const typename SceneBandRun<Real>::Sample& SceneBandRun<Real>::TakenSample(
    const model::LinearImage& photograph) {
  if (sample_) return *sample_;
  sample_.emplace();
  const double pixels = static_cast<double>(photograph.width_px) * photograph.height_px;
  const int stride = static_cast<int>(std::ceil(pixels / kSamplePixels));
  double sampled = 0;
  ProjectionBytes bytes;
  const int margin_px = SampleMarginPx(reach_px_);
  const int rows = std::max(kSampleRows, 2 * margin_px);
  for (const SceneBand& band : SampleBands(photograph.height_px, rows, stride, margin_px)) {
    Radiance radiance(RunFor(options_));
    Prepare(photograph, band, Start::kNone, &radiance);
    const SignalSum signal = radiance.Signal();
    sample_->signal.squares += signal.squares;
    sample_->signal.count += signal.count;
    const ProjectionBytes of_band = radiance.result_projection_bytes();
    bytes.held += of_band.held;
    bytes.bundle += of_band.bundle;
    sampled += static_cast<double>(photograph.width_px) * (band.last - band.first);
  }
  sample_->per_pixel = {bytes.held / sampled, bytes.bundle / sampled};
  return *sample_;
}

// Returns one strength for all bands, so that they fit together. Cross-validation uses the band in
// the middle.
template <typename Real>
double SceneBandRun<Real>::StrengthFor(const model::LinearImage& photograph,
                                       const std::vector<SceneBand>& bands) {
  switch (options_.strength_rule) {
    case StrengthRule::kGiven:
      break;
    case StrengthRule::kAuto:
      return StrengthForNoise(
          options_.prior, std::max(summary_->noise_sigma, kMinNoise),
          NeedsSignal(options_.prior) ? TakenSample(photograph).signal : SignalSum());
    case StrengthRule::kGcv:
      Radiance radiance(RunFor(options_));
      Prepare(photograph, bands[bands.size() / 2], Start::kFound, &radiance);
      SceneSummary found;
      radiance.Solve(&found);
      search_iterations_ += found.iterations;
      return found.strength;
  }
  return options_.strength;
}

template <typename Real>
bool SceneBandRun<Real>::IsWithinLimit(double bytes) const {
  return !run_.memory_limit_mib || bytes <= *run_.memory_limit_mib * kBytesPerMib;
}

template <typename Real>
double SceneBandRun<Real>::PredictedMib(double bytes, int rows, const ProjectionBytes& projection,
                                        double kept_bundle_bytes) const {
  const double with_freed =
      memory_.MostBytes(rows, projection, kept_bundle_bytes, SceneMemory::Freed::kStays);
  const double staying = std::min(with_freed, StayingBytes(run_.memory_limit_mib));
  return std::max(bytes, staying) / kBytesPerMib;
}

template <typename Real>
bool SceneBandRun<Real>::Fits(const SceneBand& band, const Radiance& radiance) {
  const ProjectionBytes projection = radiance.projection_bytes();
  const double bytes = memory_.MostBytes(band.rows(), projection);
  summary_->predicted_memory_mib =
      std::max(summary_->predicted_memory_mib, PredictedMib(bytes, band.rows(), projection, 0));
  if (IsWithinLimit(bytes)) return true;
  const double pixels = static_cast<double>(input_.image.width_px) * band.rows();
  per_pixel_ = {std::max(per_pixel_.held, projection.held / pixels),
                std::max(per_pixel_.bundle, projection.bundle / pixels)};
  return false;
}

template <typename Real>
bool SceneBandRun<Real>::MayKeepBundle(int bands) const {
  // The rays of a photograph through another aperture are not those of the views.
  if (bands > 1 || options_.photo_aperture != 1) return false;
  if (run_.sink != nullptr && !run_.sink->wants_views) return false;
  if (!input_.grid) return true;
  return LandingStepPx(*input_.camera, *input_.grid).isZero(0);
}

template <typename Real>
std::optional<SolvedScene> SceneBandRun<Real>::SolveIn(int count,
                                                       const model::LinearImage& photograph,
                                                       bool wants_confidence, SceneMaps* maps) {
  auto lap = Clock::now();
  const auto take_lap = [&lap] { return SecondsSince(std::exchange(lap, Clock::now())); };
  const std::vector<SceneBand> bands =
      BandsOf(photograph.height_px, count, BandMarginPx(reach_px_));
  SceneOptions options = options_;
  const bool is_centre_view =
      options.photo_aperture == 0 && options.strength_rule == StrengthRule::kAuto;
  if (count > 1 && !is_centre_view) {  // the centre view has no prior
    options.strength = StrengthFor(photograph, bands);
    (options_.strength_rule == StrengthRule::kGcv ? summary_->solve_seconds
                                                  : summary_->setup_seconds) += take_lap();
    options.strength_rule = StrengthRule::kGiven;
  }
  if (maps != nullptr) *maps = {};
  summary_->predicted_memory_mib = 0;
  JoinedSummary joined;
  SolvedScene whole;
  whole.radiance = {photograph.width_px, 0, photograph.channels, {}};
  if (wants_confidence) whole.of_points.reserve(input_.disparity.disparity.size());
  for (std::size_t i = 0; i < bands.size(); ++i) {
    const SceneBand& band = bands[i];
    ReturnFreedMemory(run_.memory_limit_mib);  // memory of the band above
    typename Radiance::Run run = RunFor(options);
    run.confidence = wants_confidence;
    run.bundle = MayKeepBundle(count);
    run.last_iteration = static_cast<int>(iterations_ * (i + 1) / bands.size());
    Radiance radiance(run);
    const double coarse_seconds = Prepare(photograph, band, Start::kFound, &radiance);
    summary_->solve_seconds += coarse_seconds;
    summary_->setup_seconds += take_lap() - coarse_seconds;
    if (!Fits(band, radiance)) return std::nullopt;
    if (run.bundle) {
      AngularBundle bundle = radiance.TakeBundle();
      const double bytes =
          memory_.MostBytes(band.rows(), radiance.projection_bytes(), BytesOf(bundle));
      if (IsWithinLimit(bytes)) {
        summary_->predicted_memory_mib =
            PredictedMib(bytes, band.rows(), radiance.projection_bytes(), BytesOf(bundle));
        whole.bundle = std::move(bundle);
      }
    }
    SceneSummary of_band;
    model::LinearImage solved = radiance.Solve(&of_band);
    progress_->SkipTo(run.last_iteration);
    joined.Add(of_band, band.last - band.first);
    if (maps != nullptr) radiance.AddMaps(maps);
    if (wants_confidence) radiance.AddConfidence(&whole.of_points);
    if (count == 1) {
      whole.radiance = std::move(solved);
    } else {
      if (i == 0) whole.radiance.values.reserve(photograph.values.size());
      AddRows(solved, band, &whole.radiance);
    }
    summary_->solve_seconds += take_lap();
  }
  joined.Fill(options_, summary_);
  summary_->iterations += search_iterations_;
  summary_->bands = count;
  return whole;
}

template class SceneBandRun<float>;
template class SceneBandRun<double>;

}  // namespace thicklens::estimator
