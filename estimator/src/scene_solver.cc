#include "thicklens/estimator/scene_solver.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <utility>

#include "coarse_start.h"
#include "estimate_input.h"
#include "iteration_progress.h"
#include "ray_landing.h"
#include "run_cost.h"
#include "scene_data.h"
#include "scene_priors.h"
#include "scene_projection.h"
#include "scene_strength.h"
#include "scene_system.h"
#include "stored_slope.h"
#include "thicklens/error.h"
#include "thicklens/model/parallel.h"

namespace thicklens::estimator {
namespace {

// What is assumed of the noise where the photograph does not tell it, in stored values.
constexpr double kUsualNoise = 1.0 / 255;
// Of a noiseless photograph: no model of its rays is better than the rounding of 8 bits.
constexpr double kLeastNoise = 0.29 / 255;
// Of the Gaussian over which the intensity is smoothed that says the slope of the transfer curve.
constexpr double kSlopeSmoothingPx = 2;

// A picture starts from the estimate at half its size, unless that is smaller than this.
constexpr int kLeastCoarsePx = 128;
// Of that estimate: what the full size mends costs more here.
constexpr double kCoarseTolerance = 1e-4;
constexpr int kCoarseIterations = 40;

// The strength that stands for the same at half the size, where the data have a quarter of the
// pixels and differences are twice as large.
double CoarseStrength(Prior prior, double strength) {
  switch (prior) {
    case Prior::kRidge:
      return strength;
    case Prior::kGradient:
      return strength / 4;
    case Prior::kTotalVariation:
      break;
  }
  return strength / 2;
}

// For the progress only: of iterations there may be more or fewer.
int UsualIterations(const SceneOptions& options) { return std::min(options.max_iterations, 60); }

// The most that the process is expected to hold: the light field; H; the vectors of the solver.
double VectorBytes(const EstimateInput& input, bool double_precision) {
  constexpr double kPictures = 12;  // data, H^T W I, five of CG, right side, three inside of H, r
  constexpr double kPlanes = 9;     // weights, slopes, diagonals, prior
  const double pixels = static_cast<double>(input.disparity.disparity.size());
  const double real = double_precision ? sizeof(double) : sizeof(float);
  return real * pixels * (kPictures * input.picture.channels + kPlanes);
}
double LightFieldBytes(const EstimateInput& input) {
  return sizeof(float) * static_cast<double>(input.picture.values.size()) *
         static_cast<double>(input.weights.size());
}
void CheckMemory(const SceneOptions& options, double bytes) {
  if (!options.memory_limit_mib || bytes <= *options.memory_limit_mib * kBytesPerMib) return;
  throw Error(fmt::format(
      "memory limit {:.0f} MiB: the whole picture at once needs {:.0f} MiB; the limit must be at "
      "least that, or the views fewer, or the picture smaller",
      *options.memory_limit_mib, std::ceil(bytes / kBytesPerMib)));
}

// All views of one radiance.
model::LightField ShowInAllViews(const EstimateInput& input, const model::LinearPicture& radiance,
                                 int threads, IterationProgress* progress) {
  model::LightField light_field = model::MakeLightField(
      radiance.width_px, radiance.height_px, static_cast<int>(input.weights.cols()),
      static_cast<int>(input.weights.rows()), radiance.channels);
  light_field.weights = input.weights;
  light_field.transfer = input.transfer;
  light_field.grid = input.grid;
  light_field.camera = input.camera;
  if (input.grid) light_field.landing_step_px = LandingStepPx(*input.camera, *input.grid);
  model::ParallelFor(light_field.u_count * light_field.v_count, threads, [&](int view) {
    const int k = view % light_field.u_count;
    const int l = view / light_field.u_count;
    const ViewDisparity shown =
        RenderDisparity(input.disparity, light_field.u_offset(k), light_field.v_offset(l));
    model::SetView(&light_field, k, l, WarpPicture(radiance, input.disparity, shown));
    progress->Count();
  });
  return light_field;
}

// Everything between the checked input and the views, in one precision.
template <typename Real>
class RadianceEstimate {
 public:
  RadianceEstimate(const EstimateInput& input, const SceneOptions& options,
                   kernels::Backend* backend, SceneSummary* summary, IterationProgress* progress)
      : input_(input),
        options_(options),
        backend_(backend),
        summary_(summary),
        progress_(progress) {}

  // H, I and the weights.
  void Prepare(const model::LinearPicture& radiance_of_photograph) {
    disparity_ = input_.grid ? PhotographDisparity(input_.disparity,
                                                   LandingStepPx(*input_.camera, *input_.grid))
                             : input_.disparity;
    const auto coarse_start = Clock::now();
    start_ = StartOf(radiance_of_photograph);  // before H, so that both H are never held at once
    coarse_seconds_ = SecondsSince(coarse_start);
    ProjectionOptions projection;
    projection.threads = summary_->threads;
    projection.between = options_.cubic ? Between::kCubic : Between::kLinear;
    projection.progress = [this] { progress_->Tell(); };
    projection_ = MakeSceneProjection<Real>(disparity_, input_.weights, projection);
    const std::vector<float>& hidden = projection_.hidden_share;
    summary_->row_share = projection_.row_share();
    summary_->hidden_share =
        std::accumulate(hidden.begin(), hidden.end(), 0.0) / static_cast<double>(hidden.size());

    data_.width_px = radiance_of_photograph.width_px;
    data_.height_px = radiance_of_photograph.height_px;
    data_.channels = radiance_of_photograph.channels;
    data_.threads = summary_->threads;
    data_.projection.apply = [this](const Real* x, int channels, Real* y) {
      projection_.Apply(x, channels, y);
    };
    data_.projection.apply_transposed = [this](const Real* y, int channels, Real* x) {
      projection_.ApplyTransposed(y, channels, x);
    };
    for (const auto& term : projection_.terms) {
      data_.filters.products.push_back({&term.across, &term.down});
    }
    data_.filters.rows = &projection_.rows;
    data_.filters.rows_transposed = &projection_.rows_transposed;
    data_.photograph = Planar<Real>(radiance_of_photograph);
    slope_squared_ = SlopeSquared(radiance_of_photograph);
    data_.weight = DataWeights(slope_squared_, hidden, options_.hidden_weights);
    data_.squared_row = SquaredRows<Real>(disparity_, input_.weights);
  }

  double operator_bytes() const {
    constexpr double kOnDevice = 2;  // at most: filters as they are and transposed
    const bool on_device = backend_ != nullptr && backend_->is_opencl();
    return projection_.memory_mib() * kBytesPerMib * (on_device ? 1 + kOnDevice : 1);
  }

  model::LinearPicture Solve() {
    SceneSystem<Real> system(data_, backend_);
    std::vector<Real> radiance = Planar<Real>(start_);
    start_ = {};
    RadianceLimits limits;
    limits.tolerance = options_.tolerance_or_usual();
    limits.max_iterations = options_.max_iterations;
    limits.on_iteration = [this] { progress_->CountUpTo(UsualIterations(options_)); };
    summary_->strength = options_.strength;
    if (options_.strength_rule != StrengthRule::kGiven) {
      summary_->strength = StrengthForNoise(
          options_.prior, std::max(summary_->noise_sigma, kLeastNoise), data_, slope_squared_);
    }
    if (options_.strength_rule == StrengthRule::kGcv) {
      const StrengthSearch search = SearchStrength(options_.prior, summary_->strength, data_,
                                                   slope_squared_, limits, &system, &radiance);
      summary_->strength = search.strength;
      summary_->iterations = search.iterations;
    }
    const RadianceOutcome outcome = SolveRadiance(options_.prior, summary_->strength, data_,
                                                  slope_squared_, limits, &system, &radiance);
    summary_->iterations += outcome.iterations;
    summary_->reweightings = outcome.reweightings;
    summary_->converged = outcome.converged;
    summary_->relative_residual = outcome.relative_residual;
    residual_ = StoredResidualOf(data_, radiance, input_.transfer);
    summary_->residual_rms = residual_.rms;
    return Interleaved(radiance, data_.width_px, data_.height_px, data_.channels);
  }

  void TakeMaps(SceneMaps* maps) {
    maps->residual = std::move(residual_.mean);
    maps->hidden_share = std::move(projection_.hidden_share);
    maps->blur_sigma_px = BlurSigmaPx(disparity_, input_.weights);
  }

  // Of the part of Prepare that solves at half the size.
  double coarse_seconds() const { return coarse_seconds_; }

 private:
  // Where the iteration starts.
  model::LinearPicture StartOf(const model::LinearPicture& picture) const {
    if (std::min(picture.width_px, picture.height_px) < 2 * kLeastCoarsePx) return picture;
    EstimateInput half;
    half.picture = HalfSize(picture);
    half.disparity = HalfSize(disparity_);
    half.weights = input_.weights;
    half.transfer = input_.transfer;
    SceneOptions options = options_;
    options.tolerance = std::max(options.tolerance_or_usual(), kCoarseTolerance);
    options.max_iterations = std::min(options.max_iterations, kCoarseIterations);
    options.strength = CoarseStrength(options.prior, options.strength);
    if (options.strength_rule == StrengthRule::kGcv) options.strength_rule = StrengthRule::kAuto;
    SceneSummary summary;
    summary.threads = summary_->threads;
    summary.noise_sigma = StoredNoiseSigma(half.picture, half.transfer).value_or(kUsualNoise / 2);
    const std::function<void(int, int)> tell = [this](int, int) { progress_->Tell(); };
    IterationProgress progress(tell, UsualIterations(options));
    RadianceEstimate coarse(half, options, backend_, &summary, &progress);
    coarse.Prepare(half.picture);
    return WithDetail(picture, half.picture, coarse.Solve());
  }

  // s^2. Without slope weights that of the whole picture, so that strengths keep their unit.
  std::vector<Real> SlopeSquared(const model::LinearPicture& picture) const {
    const std::vector<double> slopes = StoredSlopes(picture, input_.transfer, kSlopeSmoothingPx);
    std::vector<Real> squares;
    squares.reserve(slopes.size());
    for (const double slope : slopes) squares.push_back(static_cast<Real>(slope * slope));
    if (options_.slope_weights) return squares;
    const double mean =
        std::accumulate(slopes.begin(), slopes.end(), 0.0) / static_cast<double>(slopes.size());
    squares.assign(slopes.size(), static_cast<Real>(mean * mean));
    return squares;
  }

  const EstimateInput& input_;
  const SceneOptions& options_;
  kernels::Backend* backend_;
  SceneSummary* summary_;
  IterationProgress* progress_;
  DisparityMap disparity_;
  SceneProjection<Real> projection_;
  DataTerm<Real> data_;
  std::vector<Real> slope_squared_;
  StoredResidual residual_;
  model::LinearPicture start_;
  double coarse_seconds_ = 0;
};

std::string MessageOf(const SceneOptions& options, const SceneSummary& summary, bool noise_known) {
  std::string message = fmt::format("{} prior of strength {:.3g}, {} iterations",
                                    PriorName(options.prior), summary.strength, summary.iterations);
  if (!summary.converged) {
    message +=
        fmt::format("; stopped at a relative residual of {:.2g}, above the tolerance of {:.2g}",
                    summary.relative_residual, options.tolerance_or_usual());
  }
  if (!noise_known && options.strength_rule != StrengthRule::kGiven) {
    message += "; no part of the photograph tells its noise: 1/255 is assumed";
  }
  return message;
}

void FillOrigin(const SceneOptions& options, const SceneSummary& summary, bool falloff,
                model::LightFieldOrigin* origin) {
  origin->method = "scene";
  origin->device = summary.device;
  origin->prior = PriorName(options.prior);
  origin->strength = summary.strength;
  origin->noise_sigma = summary.noise_sigma;
  origin->iterations = summary.iterations;
  origin->relative_residual = summary.relative_residual;
  origin->effects = {"defocus"};
  if (falloff) origin->effects.emplace_back("falloff");
}

template <typename Real>
model::LightField EstimateIn(const EstimateInput& input, const SceneOptions& options,
                             kernels::Backend* backend, SceneSummary* summary, SceneMaps* maps) {
  const auto start = Clock::now();
  summary->threads = model::ResolveThreads(options.threads);
  summary->prior = options.prior;
  summary->device = backend != nullptr ? backend->name() : "cpu";
  const double fixed_bytes =
      ResidentBytes() + LightFieldBytes(input) + VectorBytes(input, options.double_precision);
  CheckMemory(options, fixed_bytes);
  const auto views = static_cast<int>(input.weights.size());
  IterationProgress progress(options.progress, UsualIterations(options) + views);

  const std::optional<double> noise = StoredNoiseSigma(input.picture, input.transfer);
  summary->noise_sigma = noise.value_or(kUsualNoise);
  const bool falloff = options.falloff && input.camera.has_value();
  RadianceEstimate<Real> estimate(input, options, backend, summary, &progress);
  estimate.Prepare(falloff ? WithoutFalloff(input.picture, *input.grid, *input.camera,
                                            input.weights, summary->threads)
                           : input.picture);
  const double bytes = fixed_bytes + estimate.operator_bytes();
  summary->predicted_memory_mib = bytes / kBytesPerMib;
  CheckMemory(options, bytes);
  summary->setup_seconds = SecondsSince(start) - estimate.coarse_seconds();

  const auto solve_start = Clock::now();
  model::LinearPicture radiance = estimate.Solve();
  summary->solve_seconds = SecondsSince(solve_start) + estimate.coarse_seconds();
  progress.SkipTo(UsualIterations(options));

  const auto views_start = Clock::now();
  model::LightField light_field = ShowInAllViews(input, radiance, summary->threads, &progress);
  summary->views_seconds = SecondsSince(views_start);
  summary->message = MessageOf(options, *summary, noise.has_value());
  FillOrigin(options, *summary, falloff, &light_field.origin);
  if (maps != nullptr) {
    estimate.TakeMaps(maps);
    maps->radiance = std::move(radiance);
  }
  return light_field;
}

}  // namespace

Prior PriorFromName(const std::string& name) {
  if (name == "ridge") return Prior::kRidge;
  if (name == "gradient") return Prior::kGradient;
  if (name == "tv") return Prior::kTotalVariation;
  throw Error(fmt::format("prior \"{}\" is unknown: it must be ridge, gradient or tv", name));
}

std::string PriorName(Prior prior) {
  switch (prior) {
    case Prior::kRidge:
      return "ridge";
    case Prior::kGradient:
      return "gradient";
    case Prior::kTotalVariation:
      break;
  }
  return "tv";
}

double UsualTolerance(Prior prior) { return prior == Prior::kTotalVariation ? 5e-5 : 1e-3; }

bool SceneOptions::IsValid(std::string* why) const {
  const auto fail = [why](std::string reason) {
    if (why != nullptr) *why = std::move(reason);
    return false;
  };
  if (strength_rule == StrengthRule::kGiven && (!(strength > 0) || !std::isfinite(strength))) {
    return fail(fmt::format("strength is {}: it must be finite and > 0", strength));
  }
  if (tolerance && (!(*tolerance > 0) || !(*tolerance < 1))) {
    return fail(fmt::format("tolerance is {}: it must be > 0 and < 1", *tolerance));
  }
  if (max_iterations < 1) {
    return fail(fmt::format("max_iterations is {}: it must be >= 1", max_iterations));
  }
  if (threads < 0) return fail(fmt::format("threads is {}: it must be >= 0", threads));
  if (memory_limit_mib && !(*memory_limit_mib > 0)) {
    return fail(fmt::format("memory_limit_mib is {}: it must be > 0", *memory_limit_mib));
  }
  return true;
}

model::LightField EstimateScene(const EstimateInput& input, const SceneOptions& options,
                                SceneSummary* summary, SceneMaps* maps, kernels::Backend* backend) {
  std::string why;
  if (!options.IsValid(&why)) throw Error("scene solver: " + why);
  if (options.double_precision && backend != nullptr && !backend->has_double()) {
    throw Error(
        fmt::format("device {}: it has no double, which double precision asks for; the device must "
                    "be cpu, or the precision float",
                    backend->name()));
  }
  CheckInput(input);
  *summary = SceneSummary();
  return options.double_precision ? EstimateIn<double>(input, options, backend, summary, maps)
                                  : EstimateIn<float>(input, options, backend, summary, maps);
}

}  // namespace thicklens::estimator
