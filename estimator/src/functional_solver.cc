#include "thicklens/estimator/functional_solver.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "aperture_prior.h"
#include "estimate_input.h"
#include "ray_landing.h"
#include "run_cost.h"
#include "scene_projection.h"
#include "scene_rays.h"
#include "thicklens/error.h"
#include "thicklens/kernels/picture_filter.h"
#include "thicklens/model/parallel.h"

namespace thicklens::estimator {
namespace {

// Views and iterations, counted together. Of iterations there may be fewer than expected, or more.
class Progress {
 public:
  Progress(const std::function<void(int, int)>& report, int total)
      : report_(report), total_(total) {}

  void Count() { Advance(1); }
  void CountUpTo(int limit) { Advance(done_ < limit ? 1 : 0); }
  void SkipTo(int done) { Advance(std::max(0, done - done_)); }

 private:
  void Advance(int steps) {
    const std::lock_guard<std::mutex> lock(mutex_);
    done_ = std::min(total_, done_ + steps);
    if (report_) report_(done_, total_);
  }

  const std::function<void(int, int)>& report_;
  const int total_;
  std::mutex mutex_;
  int done_ = 0;
};

// Of conjugate gradients: an eigenvalue ratio of kappa takes about sqrt(kappa)/2 ln(2/tolerance).
int ExpectedIterations(const FunctionalOptions& options, double ridge, double views) {
  const double ratio = 1 + 1 / (views * ridge);
  return static_cast<int>(std::clamp(0.5 * std::sqrt(ratio) * std::log(2 / options.tolerance), 1.0,
                                     static_cast<double>(options.max_iterations)));
}

struct Outcome {
  int iterations = 0;
  double relative_residual = 0;
};

// The system of one channel after the other.
class FunctionalSystem {
 public:
  FunctionalSystem(SceneRays* rays, AperturePrior* prior, int threads)
      : rays_(*rays),
        prior_(*prior),
        threads_(threads),
        size_(rays->pixels()),
        planes_(rays->plane_stride() * rays->view_count()) {
    photograph_.resize(rays->plane_stride());
    for (std::vector<float>* vector : {&answer_, &residual_, &direction_, &product_}) {
      vector->resize(size_);
    }
  }

  float* photograph() { return photograph_.data(); }
  const float* plane(std::size_t k) const { return planes_.data() + k * rays_.plane_stride(); }

  // To R in all planes.
  Outcome Solve(const FunctionalOptions& options, const std::function<void()>& on_iteration) {
    std::fill(answer_.begin(), answer_.end(), 0.0F);
    Outcome outcome;
    SetResidual(false);
    const double right = Squared(residual_);
    const double target = options.tolerance * options.tolerance * right;
    double left = right;
    // The residual of conjugate gradients drifts from that of their answer; where float allows it,
    // they go on from the latter.
    while (left > target && outcome.iterations < options.max_iterations) {
      const double before = left;
      Iterate(target, left, options.max_iterations, &outcome.iterations, on_iteration);
      SetResidual(true);
      left = Squared(residual_);
      if (!(left < before / 4)) break;
    }
    outcome.relative_residual = right > 0 ? std::sqrt(left / right) : 0;
    SpreadOverAperture(answer_);
    const std::size_t stride = rays_.plane_stride();
    model::ParallelFor(static_cast<int>(rays_.view_count()), threads_, [&](int k) {
      float* plane = planes_.data() + static_cast<std::size_t>(k) * stride;
      for (std::size_t i = 0; i < size_; ++i) plane[i] += photograph_[i];
    });
    return outcome;
  }

 private:
  // A^-1 H^T of a picture, in all planes.
  void SpreadOverAperture(const std::vector<float>& picture) {
    rays_.ApplyTransposed(picture.data(), planes_.data());
    const std::size_t points = (size_ + AperturePrior::kPacket - 1) / AperturePrior::kPacket;
    prior_.ApplyInverse(points * AperturePrior::kPacket, rays_.plane_stride(), threads_,
                        planes_.data());
  }

  // (Id + H A^-1 H^T) picture.
  void Multiply(const std::vector<float>& picture, std::vector<float>* product) {
    SpreadOverAperture(picture);
    rays_.Apply(planes_.data(), rays_.plane_stride(), product->data());
    for (std::size_t i = 0; i < size_; ++i) (*product)[i] += picture[i];
  }

  // I - H R0, less the product with the answer.
  void SetResidual(bool with_answer) {
    rays_.Apply(photograph_.data(), 0, residual_.data());
    for (std::size_t i = 0; i < size_; ++i) residual_[i] = photograph_[i] - residual_[i];
    if (!with_answer) return;
    Multiply(answer_, &product_);
    for (std::size_t i = 0; i < size_; ++i) residual_[i] -= product_[i];
  }

  double Squared(const std::vector<float>& vector) const { return Dot(vector, vector); }
  double Dot(const std::vector<float>& a, const std::vector<float>& b) const {
    return kernels::Dot<float>(a.data(), b.data(), nullptr, size_, threads_);
  }

  // Conjugate gradients from the residual of the answer on.
  void Iterate(double target, double left, int max_iterations, int* iterations,
               const std::function<void()>& on_iteration) {
    direction_ = residual_;
    while (left > target && *iterations < max_iterations) {
      Multiply(direction_, &product_);
      const auto step = static_cast<float>(left / Dot(direction_, product_));
      for (std::size_t i = 0; i < size_; ++i) {
        answer_[i] += step * direction_[i];
        residual_[i] -= step * product_[i];
      }
      const double now = Squared(residual_);
      const auto turn = static_cast<float>(now / left);
      for (std::size_t i = 0; i < size_; ++i) {
        direction_[i] = residual_[i] + turn * direction_[i];
      }
      left = now;
      ++*iterations;
      on_iteration();
    }
  }

  SceneRays& rays_;
  AperturePrior& prior_;
  const int threads_;
  const std::size_t size_;
  std::vector<float> planes_;      // of all aperture samples
  std::vector<float> photograph_;  // with a margin
  std::vector<float> answer_, residual_, direction_, product_;
};

// The samples of the grid are the rays that meet on the photograph's pixels only with ST in the
// plane of focus; and of views without a weight the photograph has no rays.
bool ShowsSameRays(const EstimateInput& input, const Eigen::Vector2d& landing_step_px) {
  return landing_step_px.isZero(0) && (input.weights > 0).all();
}

void CheckMemory(const FunctionalOptions& options, double bytes) {
  if (!options.memory_limit_mib || bytes <= *options.memory_limit_mib * kBytesPerMib) return;
  throw Error(fmt::format(
      "memory limit {:.0f} MiB: all rays of the picture at once need {:.0f} MiB; the limit must be "
      "at least that, or the views fewer, or the picture smaller",
      *options.memory_limit_mib, std::ceil(bytes / kBytesPerMib)));
}

// Without the rays: the light field, all planes of one channel, vectors, what the rays are made
// from on each thread.
double FixedBytes(const EstimateInput& input, int threads) {
  constexpr double kVectors = 8;
  constexpr double kPerViewMade = 40;
  const auto pixels = static_cast<double>(input.disparity.disparity.size());
  const auto views = static_cast<double>(input.weights.size());
  return sizeof(float) * pixels * (views * (input.picture.channels + 1) + kVectors) +
         kPerViewMade * pixels * threads;
}
double LeastRayBytes(const EstimateInput& input, int kinds) {
  return kinds * static_cast<double>(sizeof(float) * input.disparity.disparity.size()) *
         static_cast<double>(input.weights.size());
}

std::string MessageOf(const FunctionalOptions& options, const FunctionalSummary& summary) {
  std::string message = fmt::format("gamma {:.3g}, ridge {:.3g}, {} iterations", summary.gamma,
                                    summary.ridge, summary.iterations);
  if (!summary.converged) {
    message +=
        fmt::format("; stopped at a relative residual of {:.2g}, above the tolerance of {:.2g}",
                    summary.relative_residual, options.tolerance);
  }
  return message;
}

void FillOrigin(const FunctionalSummary& summary, bool falloff, model::LightFieldOrigin* origin) {
  origin->method = "functional";
  origin->device = "cpu";
  origin->gamma = summary.gamma;
  origin->ridge = summary.ridge;
  origin->iterations = summary.iterations;
  origin->relative_residual = summary.relative_residual;
  origin->effects = {"defocus"};
  if (falloff) origin->effects.emplace_back("falloff");
}

}  // namespace

bool FunctionalOptions::IsValid(std::string* why) const {
  const auto fail = [why](std::string reason) {
    if (why != nullptr) *why = std::move(reason);
    return false;
  };
  if (!(gamma > 0) || !std::isfinite(gamma)) {
    return fail(fmt::format("gamma is {}: it must be finite and > 0", gamma));
  }
  if (ridge && (!(*ridge > 0) || !std::isfinite(*ridge))) {
    return fail(fmt::format("ridge is {}: it must be finite and > 0", *ridge));
  }
  if (!(tolerance > 0) || !(tolerance < 1)) {
    return fail(fmt::format("tolerance is {}: it must be > 0 and < 1", tolerance));
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

model::LightField EstimateFunctional(const EstimateInput& input, const FunctionalOptions& options,
                                     FunctionalSummary* summary) {
  std::string why;
  if (!options.IsValid(&why)) throw Error("functional solver: " + why);
  CheckInput(input);
  const auto start = Clock::now();
  *summary = FunctionalSummary();
  const int threads = model::ResolveThreads(options.threads);
  const auto views = static_cast<int>(input.weights.size());
  const int channels = input.picture.channels;
  const Eigen::Vector2d landing_step_px =
      input.grid ? LandingStepPx(*input.camera, *input.grid) : Eigen::Vector2d::Zero();
  const bool same_rays = ShowsSameRays(input, landing_step_px);
  summary->threads = threads;
  summary->gamma = options.gamma;
  summary->ridge = options.ridge.value_or(1e-2 / views);
  const double fixed_bytes = ResidentBytes() + FixedBytes(input, threads);
  CheckMemory(options, fixed_bytes + LeastRayBytes(input, same_rays ? 1 : 2));

  const int iterations = ExpectedIterations(options, summary->ridge, views);
  const int made_views = same_rays ? views : 2 * views;
  Progress progress(options.progress, made_views + channels * (iterations + views));
  const auto count = [&] { progress.Count(); };
  SceneRays rays(PhotographDisparity(input.disparity, landing_step_px), input.weights, threads,
                 count);
  std::unique_ptr<SceneRays> other_rays;
  if (!same_rays) {
    const Eigen::ArrayXXd alike =
        Eigen::ArrayXXd::Constant(input.weights.rows(), input.weights.cols(), 1.0 / views);
    other_rays = std::make_unique<SceneRays>(input.disparity, alike, threads, count);
  }
  const SceneRays& shown_rays = same_rays ? rays : *other_rays;
  const double bytes = fixed_bytes + rays.bytes() + (same_rays ? 0 : other_rays->bytes());
  summary->predicted_memory_mib = bytes / kBytesPerMib;
  CheckMemory(options, bytes);

  const bool falloff = options.falloff && input.camera.has_value();
  const model::LinearPicture radiance =
      falloff ? WithoutFalloff(input.picture, *input.grid, *input.camera, input.weights, threads)
              : input.picture;
  AperturePrior prior(static_cast<int>(input.weights.cols()),
                      static_cast<int>(input.weights.rows()), options.gamma, summary->ridge);
  FunctionalSystem system(&rays, &prior, threads);
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
    const Outcome outcome = system.Solve(options, [&] { progress.CountUpTo(solved); });
    progress.SkipTo(solved);
    summary->iterations = std::max(summary->iterations, outcome.iterations);
    summary->relative_residual = std::max(summary->relative_residual, outcome.relative_residual);
    const auto views_start = Clock::now();
    summary->solve_seconds += std::chrono::duration<double>(views_start - solve_start).count();
    model::ParallelFor(views, threads, [&](int view) {
      const int k = view % light_field.u_count, l = view / light_field.u_count;
      shown_rays.Show(static_cast<std::size_t>(view), system.plane(static_cast<std::size_t>(view)),
                      light_field.values.data() + light_field.ViewStart(channel, k, l));
      progress.Count();
    });
    summary->views_seconds += SecondsSince(views_start);
  }
  summary->converged = summary->relative_residual <= options.tolerance;
  summary->message = MessageOf(options, *summary);
  FillOrigin(*summary, falloff, &light_field.origin);
  return light_field;
}

}  // namespace thicklens::estimator
