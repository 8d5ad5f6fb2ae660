#include "thicklens/estimator/scene_solver.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "estimator/scene/scene_band_run.h"
#include "estimator/scene/scene_bands.h"
#include "estimator/scene/scene_memory.h"
#include "estimator/scene/scene_views.h"
#include "estimator/views/input_checks.h"
#include "estimator/views/option_checks.h"
#include "estimator/views/ray_landing.h"
#include "thicklens/base/error.h"
#include "thicklens/base/iteration_progress.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/run_cost.h"
#include "thicklens/kernels/device.h"

namespace thicklens::estimator {
namespace {

// Number of conjugate-gradient iterations, for the progress only.
int UsualIterations(Prior prior) { return prior == Prior::kPatches ? 120 : 60; }

std::string MessageOf(const SceneOptions& options, const SceneSummary& summary, bool noise_known) {
  std::string message = fmt::format("{} prior of strength {:.3g}, {} iterations",
                                    PriorName(options.prior), summary.strength, summary.iterations);
  if (summary.bands > 1) message += fmt::format(", in {} bands", summary.bands);
  if (!summary.converged) {
    message +=
        fmt::format("; stopped at a relative residual of {:.2g}, above the tolerance of {:.2g}",
                    summary.relative_residual, options.tolerance_or_usual());
  }
  if (!noise_known && options.strength_rule != StrengthRule::kGiven) {
    message += "; no part of the photograph shows its noise: 1/255 is assumed";
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

// Returns the share of the photograph's values that are lower bounds.
double ClippedShare(const EstimateInput& input) {
  const auto clipped = std::count_if(input.clipped.begin(), input.clipped.end(),
                                     [](std::uint8_t value) { return value != 0; });
  return static_cast<double>(clipped) / static_cast<double>(input.image.values.size());
}

// The returned light field has its views only without a sink.
template <typename Real>
model::LightField EstimateIn(const EstimateInput& input, const SceneOptions& options,
                             const SolverRun& how, SceneSummary* summary, SceneMaps* maps) {
  const auto start = Clock::now();
  kernels::Backend* const backend = how.backend;  // of the views
  const SceneViewSink* const sink = how.sink;
  summary->threads = ResolveThreads(how.threads);
  summary->prior = options.prior;
  summary->clipped_share = ClippedShare(input);
  SolverRun iterating = how;
  // Only the processor knows lower bounds [D181]. One value of them takes all bands there, so that
  // the device of the summary is that of all iterations.
  if (summary->clipped_share > 0) iterating.backend = nullptr;
  summary->device = iterating.backend != nullptr ? iterating.backend->name() : "cpu";
  const bool falloff = options.falloff && input.camera.has_value();
  model::LightField light_field = DescriptionOf(input);
  const int reach_px =
      ReachPx(input.disparity, light_field.landing_step_px.y(), light_field.v_count);
  SceneMemory::Keeps keeps;
  keeps.photograph = falloff;
  keeps.maps = maps != nullptr;
  keeps.light_field = sink == nullptr;
  keeps.device = backend != nullptr && backend->is_opencl();
  if (sink != nullptr) keeps.sink_bytes = sink->bytes;
  ReturnFreedMemory(how.memory_limit_mib);
  const SceneMemory memory(input, options, summary->threads, keeps, reach_px);
  const int iterations = std::min(options.max_iterations, UsualIterations(options.prior));
  const bool makes_views = sink == nullptr || sink->wants_views;
  const int view_steps = makes_views ? static_cast<int>(input.weights.size()) : 0;
  IterationProgress progress(how.progress, iterations + view_steps);

  const std::optional<double> noise = EncodedNoiseSigma(input.image, input.transfer, input.clipped);
  summary->noise_sigma = noise.value_or(kDefaultNoise);
  SceneBandRun<Real> run(input, options, iterating, memory, reach_px, iterations, &progress,
                         summary);
  std::optional<model::LinearImage> without_falloff;
  if (falloff) {
    without_falloff = WithoutFalloff(input.image, *input.grid, input.camera_of_falloff(),
                                     input.weights, summary->threads);
  }
  summary->setup_seconds = SecondsSince(start);
  const bool wants_confidence = sink != nullptr ? sink->wants_confidence : maps != nullptr;
  SolvedScene solved = run.Solve(falloff ? *without_falloff : input.image, wants_confidence, maps);
  without_falloff.reset();
  ReturnFreedMemory(how.memory_limit_mib);

  if (!solved.radiance.values.empty()) {
    summary->brightest = static_cast<double>(
        *std::max_element(solved.radiance.values.begin(), solved.radiance.values.end()));
  }

  const auto views_start = Clock::now();
  if (sink == nullptr) {
    const auto views = static_cast<std::size_t>(input.weights.size());
    light_field.values.assign(light_field.ViewStart(light_field.channels, 0, 0), 0.0F);
    if (maps != nullptr) maps->confidence.resize(input.disparity.disparity.size() * views);
    ShowInAllViews(input, solved, summary->threads, backend, &progress,
                   {[&](int k, int l, const model::LinearImage& view,
                        const std::vector<Confidence>& confidence) {
                      model::SetView(&light_field, k, l, view);
                      if (maps != nullptr) {
                        const int index = l * light_field.u_count + k;
                        std::copy(confidence.begin(), confidence.end(),
                                  maps->confidence.begin() +
                                      index * static_cast<std::ptrdiff_t>(confidence.size()));
                      }
                    },
                    0, maps != nullptr});
  } else if (makes_views) {
    ShowInAllViews(input, solved, summary->threads, backend, &progress, *sink);
  }
  summary->views_seconds = SecondsSince(views_start);
  summary->message = MessageOf(options, *summary, noise.has_value());
  FillOrigin(options, *summary, falloff, &light_field.origin);
  if (maps != nullptr) {
    maps->radiance = std::move(solved.radiance);
    maps->of_points = std::move(solved.of_points);
  }
  return light_field;
}

}  // namespace

Prior PriorFromName(const std::string& name) {
  if (name == "ridge") return Prior::kRidge;
  if (name == "gradient") return Prior::kGradient;
  if (name == "tv") return Prior::kTotalVariation;
  if (name == "patches") return Prior::kPatches;
  throw Error(
      fmt::format("prior \"{}\" is unknown: it must be ridge, gradient, tv or patches", name));
}

std::string PriorName(Prior prior) {
  switch (prior) {
    case Prior::kRidge:
      return "ridge";
    case Prior::kGradient:
      return "gradient";
    case Prior::kPatches:
      return "patches";
    case Prior::kTotalVariation:
      break;
  }
  return "tv";
}

double UsualTolerance(Prior prior) {
  return prior == Prior::kTotalVariation || prior == Prior::kPatches ? 1e-4 : 1e-3;
}

namespace {

bool IsShare(const char* name, double value, std::string* why) {
  if (value >= 0 && value <= 1) return true;
  if (why != nullptr) *why = fmt::format("{} is {:g}: it must be from 0 to 1", name, value);
  return false;
}

}  // namespace

bool SceneOptions::IsValid(std::string* why) const {
  return IsEnumerator(Prior::kPatches, "prior", prior, why) &&
         IsEnumerator(StrengthRule::kGiven, "strength_rule", strength_rule, why) &&
         (strength_rule == StrengthRule::kGiven ? IsPositive("strength", strength, why)
                                                : IsNonNegative("strength", strength, why)) &&
         IsTolerance("tolerance", tolerance, why) &&
         IsAtLeast(1, "max_iterations", max_iterations, why) &&
         IsAtLeast(1, "least_bands", least_bands, why) &&
         IsShare("photo_aperture", photo_aperture, why);
}

model::LightField EstimateScene(const EstimateInput& input, const SceneOptions& options,
                                const SolverRun& run, SceneSummary* summary, SceneMaps* maps) {
  CheckOptions("scene solver", options);
  CheckRun("scene solver", run, RunUse::kSink);
  if (options.double_precision && run.backend != nullptr && !run.backend->has_double()) {
    throw Error(fmt::format(
        "device {}: it does not support double precision; use the device cpu, or single precision",
        run.backend->name()));
  }
  CheckInput(input);
  SceneSummary unused;
  if (summary == nullptr) summary = &unused;
  *summary = SceneSummary();
  const auto estimate = options.double_precision ? EstimateIn<double> : EstimateIn<float>;
  return estimate(input, options, run, summary, maps);
}

}  // namespace thicklens::estimator
