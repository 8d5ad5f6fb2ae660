#include "thicklens/estimator/grid_solver.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "estimator/functional/conjugate_gradients.h"
#include "estimator/functional/functional_run.h"
#include "estimator/functional/grid_links.h"
#include "estimator/projection/grid_photograph.h"
#include "estimator/views/input_checks.h"
#include "estimator/views/ray_irradiance.h"
#include "estimator/views/ray_landing.h"
#include "estimator/views/warped_views.h"
#include "thicklens/base/error.h"
#include "thicklens/base/iteration_progress.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/residual_guard.h"
#include "thicklens/base/run_cost.h"
#include "thicklens/kernels/image_filter.h"

namespace thicklens::estimator {
namespace {

// Expected iterations of conjugate gradients, measured: the eigenvalues are many and evenly spread.
int ExpectedIterations(const GridOptions& options, double ridge) {
  const double ratio = 1 + 8 * options.gamma / ridge;
  return static_cast<int>(std::clamp(0.25 * std::sqrt(ratio) * std::log(2 / options.tolerance), 1.0,
                                     static_cast<double>(options.max_iterations)));
}

// The system, solved for one channel after the other.
template <typename Real>
class GridSystem {
 public:
  GridSystem(const GridPhotograph<Real>* photograph, const GridLinks* links,
             const kernels::BlockGeometry* image, double gamma, double mu, int threads)
      : photograph_(*photograph),
        links_(*links),
        image_(*image),
        gamma_(gamma),
        mu_(mu),
        threads_(threads),
        answer_(static_cast<std::size_t>(image->views()) *
                static_cast<std::size_t>(image->s_count) *
                static_cast<std::size_t>(image->t_count)),
        pixels_(photograph->pixels()),
        solver_(answer_.size(), threads) {}

  // Solves in place, from L0 to the solution.
  IterationOutcome Solve(const std::vector<Real>& photograph, const IterationLimits& limits,
                         const std::function<void()>& on_iteration, float* light_field) {
    LinearSystem<Real> system;
    system.multiply = [this](const auto& x, auto* product) { Multiply(x, product); };
    system.set_residual = [&](const auto& x, auto* residual) {
      SetResidual(photograph, light_field, x, residual);
    };
    std::fill(answer_.begin(), answer_.end(), Real{0});
    SetResidual(photograph, light_field, answer_, solver_.residual());
    ClearBeside(solver_.residual());
    const std::vector<Real>& right = *solver_.residual();
    system.right_squared =
        kernels::Dot<Real>(right.data(), right.data(), nullptr, right.size(), threads_);
    answer_.assign(light_field, light_field + answer_.size());
    SetResidual(photograph, light_field, answer_, solver_.residual());
    const IterationOutcome outcome = solver_.Solve(system, limits, on_iteration, &answer_);
    ForViews([&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) light_field[i] = static_cast<float>(answer_[i]);
    });
    return outcome;
  }

  // of the size of all rays
  static constexpr int kVectors = 1 + ConjugateGradients<Real>::kVectors;

 private:
  template <typename Work>
  void ForViews(const Work& work) const {
    const std::size_t view_size = answer_.size() / static_cast<std::size_t>(image_.views());
    ParallelFor(image_.views(), threads_, [&](int view) {
      work(static_cast<std::size_t>(view) * view_size,
           static_cast<std::size_t>(view + 1) * view_size);
    });
  }

  void Multiply(const std::vector<Real>& x, std::vector<Real>* product) {
    links_.Apply(gamma_, mu_, x.data(), product->data());
    photograph_.Apply(x.data(), pixels_.data());
    photograph_.AddTransposed(pixels_.data(), product->data());
  }

  // Residual H^T (I - H x) - gamma D^T D x + mu (L0 - x). For rays outside the image it is exactly
  // 0 where x is L0.
  void SetResidual(const std::vector<Real>& photograph, const float* prior,
                   const std::vector<Real>& x, std::vector<Real>* residual) {
    links_.Apply(gamma_, 0, x.data(), residual->data());
    const auto mu = static_cast<Real>(mu_);
    ForViews([&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) {
        (*residual)[i] = mu * (static_cast<Real>(prior[i]) - x[i]) - (*residual)[i];
      }
    });
    photograph_.Apply(x.data(), pixels_.data());
    for (std::size_t i = 0; i < pixels_.size(); ++i) pixels_[i] = photograph[i] - pixels_[i];
    photograph_.AddTransposed(pixels_.data(), residual->data());
  }

  // Sets the rays that land outside of the image to 0.
  void ClearBeside(std::vector<Real>* rays) const {
    std::size_t ray = 0;
    for (int l = 0; l < image_.v_count; ++l) {
      for (int k = 0; k < image_.u_count; ++k) {
        const LandingRect inside = LandingIn(image_, k, l);
        const int s_shift = image_.s_shift[static_cast<std::size_t>(k)];
        const int t_shift = image_.t_shift[static_cast<std::size_t>(l)];
        for (int t = 0; t < image_.t_count; ++t) {
          for (int s = 0; s < image_.s_count; ++s, ++ray) {
            const int x = s + s_shift, y = t + t_shift;
            if (x < inside.x_begin || x >= inside.x_end || y < inside.y_begin ||
                y >= inside.y_end) {
              (*rays)[ray] = 0;
            }
          }
        }
      }
    }
  }

  const GridPhotograph<Real>& photograph_;
  const GridLinks& links_;
  const kernels::BlockGeometry& image_;
  const double gamma_, mu_;
  const int threads_;
  std::vector<Real> answer_;
  std::vector<Real> pixels_;
  ConjugateGradients<Real> solver_;
};

// Bytes without H and D: the light field, vectors, and the working memory of each thread that makes
// a view.
template <typename Real>
double FixedBytes(const EstimateInput& input, int threads) {
  constexpr double kImages = 3;
  constexpr double kPerViewMade = 40;
  const auto pixels = static_cast<double>(input.disparity.disparity.size());
  const auto views = static_cast<double>(input.weights.size());
  return pixels *
         (sizeof(float) * (views + 2) * input.image.channels +
          sizeof(Real) * (views * GridSystem<Real>::kVectors + kImages) + kPerViewMade * threads);
}
// Bytes of H and D that are known beforehand: the disparities, and the irradiance if there is one.
double LeastGridBytes(const EstimateInput& input, bool falloff) {
  return (falloff ? 2 : 1) * static_cast<double>(sizeof(float)) *
         static_cast<double>(input.disparity.disparity.size()) *
         static_cast<double>(input.weights.size());
}

std::vector<std::vector<float>> IrradianceOfViews(const EstimateInput& input, int threads) {
  const auto u_count = static_cast<int>(input.weights.cols());
  std::vector<std::vector<float>> irradiance(static_cast<std::size_t>(input.weights.size()));
  ParallelFor(static_cast<int>(irradiance.size()), threads, [&](int view) {
    irradiance[static_cast<std::size_t>(view)] = RelativeFalloff(
        *input.grid, input.camera_of_falloff(), input.weights, view % u_count, view / u_count);
  });
  return irradiance;
}

// The options and the input are checked already.
template <typename Real>
model::LightField SolveOnGrid(const EstimateInput& input, const GridOptions& options,
                              const SolverRun& run, FunctionalSummary* summary) {
  const auto start = Clock::now();
  const int threads = summary->threads, channels = input.image.channels;
  const bool falloff = options.falloff && input.camera.has_value();
  const double fixed_bytes = ResidentBytes() + FixedBytes<Real>(input, threads);
  RequireMemory(run, fixed_bytes + LeastGridBytes(input, falloff));

  const int iterations = ExpectedIterations(options, summary->ridge);
  IterationProgress progress(run.progress, 2 + channels * iterations);
  std::vector<std::vector<float>> disparity;
  model::LightField light_field = WarpToAllViews(input, falloff, threads, &disparity);
  progress.Count();
  const kernels::BlockGeometry image =
      BlockOf(light_field, {0, 0, input.image.width_px, input.image.height_px}, input.weights);
  const GridLinks links(input.disparity, std::move(disparity), image, threads);
  const GridPhotograph<Real> photograph(
      image, falloff ? IrradianceOfViews(input, threads) : std::vector<std::vector<float>>(),
      threads);
  const double bytes = fixed_bytes + links.bytes() + photograph.bytes();
  summary->predicted_memory_mib = bytes / kBytesPerMib;
  RequireMemory(run, bytes);
  GridSystem<Real> system(&photograph, &links, &image, options.gamma, summary->ridge, threads);
  progress.Count();
  summary->setup_seconds = SecondsSince(start);

  const auto solve_start = Clock::now();
  std::vector<Real> channel_values(photograph.pixels());
  for (int channel = 0; channel < channels; ++channel) {
    for (std::size_t i = 0; i < channel_values.size(); ++i) {
      channel_values[i] =
          input.image
              .values[i * static_cast<std::size_t>(channels) + static_cast<std::size_t>(channel)];
    }
    const int solved = 2 + (channel + 1) * iterations;
    const IterationOutcome outcome = system.Solve(
        channel_values, {options.tolerance, options.max_iterations},
        [&] { progress.CountUpTo(solved); },
        light_field.values.data() + light_field.ViewStart(channel, 0, 0));
    progress.SkipTo(solved);
    summary->iterations = std::max(summary->iterations, outcome.iterations);
    summary->relative_residual =
        LargerResidual(summary->relative_residual, outcome.relative_residual);
  }
  summary->solve_seconds = SecondsSince(solve_start);
  FillOrigin("grid", *summary, falloff, &light_field.origin);
  return light_field;
}

}  // namespace

model::LightField EstimateOnGrid(const EstimateInput& input, const GridOptions& options,
                                 const SolverRun& run, FunctionalSummary* summary) {
  FunctionalSummary unused;
  if (summary == nullptr) summary = &unused;
  StartRun("grid solver", input, options, run, summary);
  const auto solve = options.double_precision ? SolveOnGrid<double> : SolveOnGrid<float>;
  model::LightField light_field = solve(input, options, run, summary);
  EndRun("grid", options, summary);
  return light_field;
}

}  // namespace thicklens::estimator
