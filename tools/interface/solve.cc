// The four solvers of the library and a program's own behind one call.
#include "tools/interface/solve.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <type_traits>
#include <utility>

#include "thicklens/base/memory_available.h"
#include "thicklens/base/parallel.h"
#include "thicklens/estimator/block_solver.h"
#include "thicklens/estimator/block_store.h"
#include "thicklens/estimator/functional_solver.h"
#include "thicklens/estimator/grid_solver.h"
#include "thicklens/kernels/device.h"

namespace thicklens {
namespace {

// No part of an image that is solved for as a whole is larger: the memory grows, and nothing gets
// better by it.
constexpr double kMaxBandPixels = 3e6;

std::optional<double> SceneMemoryLimitMib(const EstimateOptions& options) {
  return options.memory_limit_mib ? options.memory_limit_mib : UsualMemoryLimitMib();
}

std::shared_ptr<kernels::Backend> Open(const std::string& device, RunScope* run) {
  std::string notice;
  auto backend = kernels::OpenBackend(kernels::ParseDeviceRequest(device), &notice,
                                      [] { ThrowIfCancelled(); });
  if (!notice.empty()) run->Warn(notice);
  return backend;
}

estimator::Prior PriorOf(Prior prior) {
  switch (prior) {
    case Prior::kRidge:
      return estimator::Prior::kRidge;
    case Prior::kGradient:
      return estimator::Prior::kGradient;
    case Prior::kTotalVariation:
      return estimator::Prior::kTotalVariation;
    case Prior::kPatches:
      break;
  }
  return estimator::Prior::kPatches;
}

estimator::StrengthRule RuleOf(StrengthRule rule) {
  switch (rule) {
    case StrengthRule::kAuto:
      return estimator::StrengthRule::kAuto;
    case StrengthRule::kGcv:
      return estimator::StrengthRule::kGcv;
    case StrengthRule::kGiven:
      break;
  }
  return estimator::StrengthRule::kGiven;
}

estimator::BlockSolver LinearOf(BlockSolver::Linear linear) {
  switch (linear) {
    case BlockSolver::Linear::kDefault:
      return estimator::DefaultBlockSolver();
    case BlockSolver::Linear::kUmfpack:
      return estimator::BlockSolver::kUmfpack;
    case BlockSolver::Linear::kCholmod:
      return estimator::BlockSolver::kCholmod;
    case BlockSolver::Linear::kEigen:
      return estimator::BlockSolver::kEigen;
    case BlockSolver::Linear::kCg:
      return estimator::BlockSolver::kCg;
    case BlockSolver::Linear::kBicgstab:
      return estimator::BlockSolver::kBicgstab;
    case BlockSolver::Linear::kViennaCl:
      break;
  }
  return estimator::BlockSolver::kViennaCl;
}

template <typename Summary>
void TakeIterations(const Summary& from, SolverSummary* to) {
  to->message = from.message;
  to->iterations = from.iterations;
  to->converged = from.converged;
  to->relative_residual = from.relative_residual;
}

// Takes the views of SceneSolver for a sink of the interface.
estimator::SceneViewSink SinkOf(ViewSink* sink, double values) {
  estimator::SceneViewSink views;
  views.take = [sink](int k, int l, const model::LinearImage& view,
                      const std::vector<estimator::Confidence>& confidence) {
    ThrowIfCancelled();
    sink->TakeView(k, l, view);
    sink->TakeConfidence(k, l, confidence, view.width_px);
  };
  views.bytes = sink->BytesForView(values);
  return views;
}

Solved SolveScene(const SceneSolver& solver, const PreparedProblem& prepared,
                  const EstimateOptions& options, ViewSink* sink, EstimateDiagnostics* diagnostics,
                  RunScope* run) {
  const estimator::EstimateInput& input = *prepared.input;
  const bool falloff = prepared.effects.on.Has(Effect::kFalloff);
  // A device is worth its start where it is asked for.
  const auto backend = Open(options.device == "auto" ? "cpu" : options.device, run);
  estimator::SceneOptions settings;
  settings.prior = PriorOf(solver.prior);
  settings.strength_rule = RuleOf(solver.strength_rule);
  settings.strength = solver.strength;
  settings.tolerance = solver.tolerance;
  settings.max_iterations = solver.max_iterations;
  settings.double_precision = solver.double_precision;
  settings.falloff = falloff;
  settings.threads = run->threads();
  settings.memory_limit_mib = SceneMemoryLimitMib(options);
  settings.least_bands =
      std::max(1, static_cast<int>(std::ceil(static_cast<double>(input.disparity.disparity.size()) /
                                             kMaxBandPixels)));
  settings.progress = run->ProgressOf("estimating");
  Solved solved;
  if (solver.check_blur) {
    estimator::BlurCheckOptions check;
    check.falloff = falloff;
    check.threads = run->threads();
    check.memory_limit_mib = SceneMemoryLimitMib(options);
    check.progress = run->ProgressOf("checking the blur");
    solved.blur = estimator::CheckBlur(input, check);
  }
  estimator::SceneSummary scene;
  solved.maps.emplace();
  // Hidden rays that are inpainted need all views.
  solved.views_in_sink = sink != nullptr && options.hidden_rays == HiddenRays::kSolver;
  solved.light_field =
      solved.views_in_sink
          ? estimator::EstimateSceneViews(
                input, settings, SinkOf(sink, static_cast<double>(input.image.values.size())),
                &scene, &*solved.maps, backend.get())
          : estimator::EstimateScene(input, settings, &scene, &*solved.maps, backend.get());
  solved.maps->radiance = {};  // the middle of the light field contains it
  TakeIterations(scene, &solved.summary);
  solved.summary.setup_seconds = scene.setup_seconds;
  solved.summary.solve_seconds = scene.solve_seconds;
  solved.summary.views_seconds = scene.views_seconds;
  solved.summary.predicted_memory_mib = scene.predicted_memory_mib;
  solved.summary.device = scene.device;
  diagnostics->strength = scene.strength;
  diagnostics->strength_rule = solver.strength_rule;
  diagnostics->noise_sigma = scene.noise_sigma;
  diagnostics->residual_rms = scene.residual_rms;
  diagnostics->row_share = scene.row_share;
  diagnostics->occluded_fraction = scene.occluded_fraction;
  diagnostics->bands = scene.bands;
  diagnostics->reweightings = scene.reweightings;
  return solved;
}

Solved SolveBlocks(const BlockSolver& solver, const PreparedProblem& prepared,
                   const EstimateOptions& options, EstimateDiagnostics* diagnostics,
                   RunScope* run) {
  const auto backend = Open(options.device, run);
  estimator::BlockOptions settings;
  settings.solver = LinearOf(solver.linear);
  settings.stencil = solver.stencil == BlockSolver::Stencil::kWarp ? estimator::Stencil::kWarp
                                                                   : estimator::Stencil::kSource;
  settings.splat = solver.splat == BlockSolver::Splat::kBilinear ? kernels::Splat::kBilinear
                                                                 : kernels::Splat::kNearest;
  settings.gamma = solver.gamma;
  settings.ridge = solver.ridge;
  settings.block_px = solver.block_px;
  if (solver.tolerance) settings.tolerance = *solver.tolerance;
  if (solver.max_iterations) settings.max_iterations = *solver.max_iterations;
  settings.memory_limit_mib = options.memory_limit_mib;
  settings.falloff = prepared.effects.on.Has(Effect::kFalloff);
  settings.threads = run->threads();
  settings.progress = run->ProgressOf("estimating");
  settings.store = solver.store.get();
  estimator::BlockSummary blocks;
  Solved solved;
  solved.light_field =
      estimator::EstimateByBlocks(*prepared.input, settings, backend.get(), &blocks);
  TakeIterations(blocks, &solved.summary);
  solved.summary.rcond_min = blocks.rcond_min;
  if (blocks.rcond_min) solved.summary.iterations.reset();  // a direct solver has none
  solved.summary.setup_seconds = blocks.setup_seconds;
  solved.summary.solve_seconds = blocks.solve_seconds;
  solved.summary.predicted_memory_mib = blocks.predicted_memory_mib;
  solved.summary.device = blocks.device;
  diagnostics->gamma = blocks.gamma;
  diagnostics->ridge = diagnostics->strength = blocks.ridge;
  diagnostics->block_px = blocks.block_px;
  diagnostics->blocks_from_store = blocks.blocks_from_store;
  for (const estimator::BlockReport& block : blocks.blocks) {
    solved.blocks.push_back({block.x, block.y, block.width_px, block.height_px, block.unknowns,
                             block.iterations, block.rcond, block.relative_residual});
  }
  return solved;
}

Solved SolveFunctional(const FunctionalSolver& solver, bool on_grid,
                       const PreparedProblem& prepared, const EstimateOptions& options,
                       EstimateDiagnostics* diagnostics, RunScope* run) {
  estimator::FunctionalOptions settings;
  settings.gamma = solver.gamma;
  settings.ridge = solver.ridge;
  settings.tolerance = solver.tolerance;
  settings.max_iterations = solver.max_iterations;
  settings.double_precision = solver.double_precision;
  settings.falloff = prepared.effects.on.Has(Effect::kFalloff);
  settings.threads = run->threads();
  settings.memory_limit_mib = options.memory_limit_mib;
  settings.progress = run->ProgressOf("estimating");
  const auto estimate = on_grid ? estimator::EstimateOnGrid : estimator::EstimateFunctional;
  estimator::FunctionalSummary functional;
  Solved solved;
  solved.light_field = estimate(*prepared.input, settings, &functional);
  TakeIterations(functional, &solved.summary);
  solved.summary.setup_seconds = functional.setup_seconds;
  solved.summary.solve_seconds = functional.solve_seconds;
  solved.summary.views_seconds = functional.views_seconds;
  solved.summary.predicted_memory_mib = functional.predicted_memory_mib;
  diagnostics->gamma = functional.gamma;
  diagnostics->ridge = diagnostics->strength = functional.ridge;
  return solved;
}

Solved SolveByProgram(const Solver& solver, const PreparedProblem& prepared, RunScope* run) {
  Problem problem(prepared.input);
  problem.set_falloff(prepared.effects.on.Has(Effect::kFalloff));
  Solved solved;
  const auto start = std::chrono::steady_clock::now();
  solved.light_field = solver.Solve(problem, run->control(), &solved.summary);
  // What the solver does not count as set-up or views is its solve.
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  solved.summary.solve_seconds =
      std::max(0.0, seconds.count() - solved.summary.setup_seconds - solved.summary.views_seconds);
  const LightField& found = solved.light_field;
  std::string why;
  if (!found.IsValid(&why)) throw Error(fmt::format("solver {}: {}", solver.Name(), why));
  if (found.u_count != problem.u_count() || found.v_count != problem.v_count() ||
      found.s_count != problem.width_px() || found.t_count != problem.height_px() ||
      found.channels != problem.channels()) {
    throw Error(fmt::format(
        "solver {}: {}x{} views of {}x{} px in {} channel(s) are expected, found {}x{} of {}x{} in "
        "{}",
        solver.Name(), problem.u_count(), problem.v_count(), problem.width_px(),
        problem.height_px(), problem.channels(), found.u_count, found.v_count, found.s_count,
        found.t_count, found.channels));
  }
  const auto wrong = std::find_if(found.values.begin(), found.values.end(),
                                  [](float value) { return !std::isfinite(value); });
  if (wrong != found.values.end()) {
    throw Error(fmt::format("solver {}: its light field contains {}", solver.Name(), *wrong));
  }
  solved.light_field.origin = {};
  solved.light_field.origin.method = solver.Name();
  return solved;
}

}  // namespace

std::string SolverName(const AnySolver& solver) {
  if (std::holds_alternative<SceneSolver>(solver)) return "scene";
  if (std::holds_alternative<BlockSolver>(solver)) return "blocks";
  if (std::holds_alternative<FunctionalSolver>(solver)) return "functional";
  if (std::holds_alternative<GridSolver>(solver)) return "grid";
  if (const auto* own = std::get_if<std::shared_ptr<const Solver>>(&solver)) {
    return *own == nullptr ? "none" : (*own)->Name();
  }
  return "chosen";
}

Solved Solve(const PreparedProblem& prepared, const EstimateOptions& options, ViewSink* sink,
             EstimateDiagnostics* diagnostics, RunScope* run) {
  Solved solved = std::visit(
      [&](const auto& solver) -> Solved {
        using Given = std::decay_t<decltype(solver)>;
        if constexpr (std::is_same_v<Given, SceneSolver>) {
          return SolveScene(solver, prepared, options, sink, diagnostics, run);
        } else if constexpr (std::is_same_v<Given, BlockSolver>) {
          return SolveBlocks(solver, prepared, options, diagnostics, run);
        } else if constexpr (std::is_same_v<Given, FunctionalSolver>) {
          return SolveFunctional(solver, false, prepared, options, diagnostics, run);
        } else if constexpr (std::is_same_v<Given, GridSolver>) {
          return SolveFunctional(solver, true, prepared, options, diagnostics, run);
        } else if constexpr (std::is_same_v<Given, std::shared_ptr<const Solver>>) {
          return SolveByProgram(*solver, prepared, run);
        } else {
          throw Error("solver: the chooser has not been asked");
        }
      },
      options.solver);
  diagnostics->predicted_memory_mib = solved.summary.predicted_memory_mib;
  return solved;
}

}  // namespace thicklens
