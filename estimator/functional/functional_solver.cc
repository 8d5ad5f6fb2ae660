#include "thicklens/estimator/functional_solver.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "estimator/functional/conjugate_gradients.h"
#include "estimator/functional/functional_run.h"
#include "estimator/projection/scene_projection.h"
#include "estimator/projection/scene_rays.h"
#include "estimator/views/input_checks.h"
#include "estimator/views/ray_landing.h"
#include "thicklens/base/iteration_progress.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/residual_guard.h"
#include "thicklens/base/run_cost.h"
#include "thicklens/kernels/aperture_prior.h"
#include "thicklens/kernels/image_filter.h"

namespace thicklens::estimator {
namespace {

// Expected iterations of conjugate gradients: an eigenvalue ratio of kappa takes about
// sqrt(kappa)/2 ln(2/tolerance).
int ExpectedIterations(const FunctionalOptions& options, double ridge, double views) {
  const double ratio = 1 + 1 / (views * ridge);
  return static_cast<int>(std::clamp(0.5 * std::sqrt(ratio) * std::log(2 / options.tolerance), 1.0,
                                     static_cast<double>(options.max_iterations)));
}

// The system, solved for one channel after the other.
template <typename Real>
class FunctionalSystem {
 public:
  FunctionalSystem(SceneRays<Real>* rays, kernels::AperturePrior<Real>* prior, int threads)
      : rays_(*rays),
        prior_(*prior),
        threads_(threads),
        size_(rays->pixels()),
        planes_(rays->plane_stride() * rays->view_count()),
        photograph_(rays->plane_stride()),
        right_(size_),
        answer_(size_),
        solver_(size_, threads) {}

  Real* photograph() { return photograph_.data(); }
  const Real* plane(std::size_t k) const { return planes_.data() + k * rays_.plane_stride(); }

  // Solves for R in all planes.
  IterationOutcome Solve(const IterationLimits& limits, const std::function<void()>& on_iteration) {
    SetRightSide();
    std::fill(answer_.begin(), answer_.end(), Real{0});
    *solver_.residual() = right_;
    LinearSystem<Real> system;
    system.multiply = [this](const auto& x, auto* product) { Multiply(x, product); };
    system.set_residual = [this](const auto& x, auto* residual) {
      Multiply(x, residual);
      for (std::size_t i = 0; i < size_; ++i) (*residual)[i] = right_[i] - (*residual)[i];
    };
    system.right_squared =
        kernels::Dot<Real>(right_.data(), right_.data(), nullptr, size_, threads_);
    const IterationOutcome outcome = solver_.Solve(system, limits, on_iteration, &answer_);
    SpreadOverAperture(answer_);
    const std::size_t stride = rays_.plane_stride();
    ParallelFor(static_cast<int>(rays_.view_count()), threads_, [&](int k) {
      Real* plane = planes_.data() + static_cast<std::size_t>(k) * stride;
      for (std::size_t i = 0; i < size_; ++i) plane[i] += photograph_[i];
    });
    return outcome;
  }

  static constexpr int kImages = 3 + ConjugateGradients<Real>::kVectors;  // besides the planes

 private:
  // Sets all planes to A^-1 H^T x, where x is `image`.
  void SpreadOverAperture(const std::vector<Real>& image) {
    rays_.ApplyTransposed(image.data(), planes_.data());
    constexpr std::size_t kPacket = kernels::AperturePrior<Real>::kPacket;
    const std::size_t points = (size_ + kPacket - 1) / kPacket;
    prior_.ApplyInverse(points * kPacket, rays_.plane_stride(), threads_, planes_.data());
  }

  // Sets the product to (Id + H A^-1 H^T) x, where x is `image`.
  void Multiply(const std::vector<Real>& image, std::vector<Real>* product) {
    SpreadOverAperture(image);
    rays_.Apply(planes_.data(), rays_.plane_stride(), product->data());
    for (std::size_t i = 0; i < size_; ++i) (*product)[i] += image[i];
  }

  // Sets the right-hand side I - H R0.
  void SetRightSide() {
    rays_.Apply(photograph_.data(), 0, right_.data());
    for (std::size_t i = 0; i < size_; ++i) right_[i] = photograph_[i] - right_[i];
  }

  SceneRays<Real>& rays_;
  kernels::AperturePrior<Real>& prior_;
  const int threads_;
  const std::size_t size_;
  std::vector<Real> planes_;      // one for each aperture sample
  std::vector<Real> photograph_;  // with a margin
  std::vector<Real> right_, answer_;
  ConjugateGradients<Real> solver_;
};

// The grid samples are the rays that meet on the photograph's pixels only with ST in the plane of
// focus, and the photograph has no rays of views without a weight.
bool ShowsSameRays(const EstimateInput& input, const Eigen::Vector2d& landing_step_px) {
  return landing_step_px.isZero(0) && (input.weights > 0).all();
}

// Bytes without the rays: the light field, all planes of one channel, images, and the working
// memory of each thread that makes the rays.
template <typename Real>
double FixedBytes(const EstimateInput& input, int threads) {
  constexpr double kPerViewMade = 40;
  const auto pixels = static_cast<double>(input.disparity.disparity.size());
  const auto views = static_cast<double>(input.weights.size());
  return pixels *
         (sizeof(float) * views * input.image.channels +
          sizeof(Real) * (views + FunctionalSystem<Real>::kImages + 1) + kPerViewMade * threads);
}
template <typename Real>
double LeastRayBytes(const EstimateInput& input, int kinds) {
  return kinds * static_cast<double>(sizeof(Real) * input.disparity.disparity.size()) *
         static_cast<double>(input.weights.size());
}

// The options and the input are checked already.
template <typename Real>
model::LightField SolveFunctional(const EstimateInput& input, const FunctionalOptions& options,
                                  const SolverRun& run, FunctionalSummary* summary) {
  const auto start = Clock::now();
  const int threads = summary->threads;
  const auto views = static_cast<int>(input.weights.size());
  const int channels = input.image.channels;
  const Eigen::Vector2d landing_step_px =
      input.grid ? LandingStepPx(*input.camera, *input.grid) : Eigen::Vector2d::Zero();
  const bool same_rays = ShowsSameRays(input, landing_step_px);
  const double fixed_bytes = ResidentBytes() + FixedBytes<Real>(input, threads);
  RequireMemory(run, fixed_bytes + LeastRayBytes<Real>(input, same_rays ? 1 : 2));

  const int iterations = ExpectedIterations(options, summary->ridge, views);
  const int made_views = same_rays ? views : 2 * views;
  IterationProgress progress(run.progress, made_views + channels * (iterations + views));
  const auto count = [&] { progress.Count(); };
  SceneRays<Real> rays(PhotographDisparity(input.disparity, landing_step_px), input.weights,
                       threads, count);
  std::unique_ptr<SceneRays<Real>> other_rays;
  if (!same_rays) {
    const Eigen::ArrayXXd alike =
        Eigen::ArrayXXd::Constant(input.weights.rows(), input.weights.cols(), 1.0 / views);
    other_rays = std::make_unique<SceneRays<Real>>(input.disparity, alike, threads, count);
  }
  const SceneRays<Real>& shown_rays = same_rays ? rays : *other_rays;
  const double bytes = fixed_bytes + rays.bytes() + (same_rays ? 0 : other_rays->bytes());
  summary->predicted_memory_mib = bytes / kBytesPerMib;
  RequireMemory(run, bytes);

  const bool falloff = options.falloff && input.camera.has_value();
  const model::LinearImage radiance =
      falloff ? WithoutFalloff(input.image, *input.grid, input.camera_of_falloff(), input.weights,
                               threads)
              : input.image;
  kernels::AperturePrior<Real> prior(static_cast<int>(input.weights.cols()),
                                     static_cast<int>(input.weights.rows()), options.gamma,
                                     summary->ridge);
  FunctionalSystem<Real> system(&rays, &prior, threads);
  model::LightField light_field = FrameOf(input);
  summary->setup_seconds = SecondsSince(start);

  for (int channel = 0; channel < channels; ++channel) {
    const auto solve_start = Clock::now();
    for (std::size_t i = 0; i < rays.pixels(); ++i) {
      system.photograph()[i] =
          radiance
              .values[i * static_cast<std::size_t>(channels) + static_cast<std::size_t>(channel)];
    }
    const int solved = made_views + channel * (iterations + views) + iterations;
    const IterationOutcome outcome = system.Solve({options.tolerance, options.max_iterations},
                                                  [&] { progress.CountUpTo(solved); });
    progress.SkipTo(solved);
    summary->iterations = std::max(summary->iterations, outcome.iterations);
    summary->relative_residual =
        LargerResidual(summary->relative_residual, outcome.relative_residual);
    const auto views_start = Clock::now();
    summary->solve_seconds += std::chrono::duration<double>(views_start - solve_start).count();
    ParallelFor(views, threads, [&](int view) {
      const int k = view % light_field.u_count, l = view / light_field.u_count;
      shown_rays.Show(static_cast<std::size_t>(view), system.plane(static_cast<std::size_t>(view)),
                      light_field.values.data() + light_field.ViewStart(channel, k, l));
      progress.Count();
    });
    summary->views_seconds += SecondsSince(views_start);
  }
  FillOrigin("functional", *summary, falloff, &light_field.origin);
  return light_field;
}

}  // namespace

model::LightField EstimateFunctional(const EstimateInput& input, const FunctionalOptions& options,
                                     const SolverRun& run, FunctionalSummary* summary) {
  FunctionalSummary unused;
  if (summary == nullptr) summary = &unused;
  StartRun("functional solver", input, options, run, summary);
  const auto solve = options.double_precision ? SolveFunctional<double> : SolveFunctional<float>;
  model::LightField light_field = solve(input, options, run, summary);
  EndRun("functional", options, summary);
  return light_field;
}

}  // namespace thicklens::estimator
