// The four solvers of the library and a program's own behind one call.
#include "tools/interface/solve.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>
#include <type_traits>
#include <utility>
#include <variant>

#include "thicklens/base/memory_available.h"
#include "thicklens/base/parallel.h"
#include "thicklens/estimator/block_store.h"
#include "thicklens/estimator/solve.h"
#include "thicklens/kernels/device.h"

namespace thicklens {
namespace {

// No part of an image that is solved for as a whole is larger: the memory grows, and nothing gets
// better by it.
constexpr double kMaxBandPixels = 3e6;

std::shared_ptr<kernels::Backend> Open(const std::string& device, RunScope* run) {
  std::string notice;
  auto backend = kernels::OpenBackend(kernels::ParseDeviceRequest(device), &notice,
                                      [] { ThrowIfCancelled(); });
  if (!notice.empty()) run->Warn(notice);
  run->Detail("device: " + backend->description());
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

estimator::SolverOptions OptionsOf(const SceneSolver& solver, const PreparedProblem& prepared,
                                   const EstimateDiagnostics& found) {
  const auto pixels = static_cast<double>(prepared.input->disparity.disparity.size());
  estimator::SceneOptions settings;
  settings.prior = PriorOf(solver.prior);
  settings.strength_rule = RuleOf(solver.strength_rule);
  settings.strength = solver.strength;
  settings.tolerance = solver.tolerance;
  settings.max_iterations = solver.max_iterations;
  settings.double_precision = solver.double_precision;
  settings.falloff = prepared.effects.on.Has(Effect::kFalloff);
  settings.least_bands = std::max(1, static_cast<int>(std::ceil(pixels / kMaxBandPixels)));
  settings.photo_aperture = found.used_photo_aperture;
  return settings;
}

estimator::SolverOptions OptionsOf(const BlockSolver& solver, const PreparedProblem& prepared,
                                   const EstimateDiagnostics& /*found*/) {
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
  settings.falloff = prepared.effects.on.Has(Effect::kFalloff);
  return settings;
}

estimator::WholeImageOptions WholeImageOf(const FunctionalSolver& solver,
                                          const PreparedProblem& prepared) {
  estimator::WholeImageOptions settings;
  settings.gamma = solver.gamma;
  settings.ridge = solver.ridge;
  settings.tolerance = solver.tolerance;
  settings.max_iterations = solver.max_iterations;
  settings.double_precision = solver.double_precision;
  settings.falloff = prepared.effects.on.Has(Effect::kFalloff);
  return settings;
}

estimator::SolverOptions OptionsOf(const FunctionalSolver& solver, const PreparedProblem& prepared,
                                   const EstimateDiagnostics& /*found*/) {
  return estimator::FunctionalOptions{WholeImageOf(solver, prepared)};
}

estimator::SolverOptions OptionsOf(const GridSolver& solver, const PreparedProblem& prepared,
                                   const EstimateDiagnostics& /*found*/) {
  return estimator::GridOptions{WholeImageOf(solver, prepared)};
}

void TakeDiagnostics(const estimator::SceneDiagnostics& found, EstimateDiagnostics* diagnostics) {
  diagnostics->strength = found.strength;
  diagnostics->noise_sigma = found.noise_sigma;
  diagnostics->residual_rms = found.residual_rms;
  diagnostics->row_share = found.row_share;
  diagnostics->occluded_fraction = found.occluded_fraction;
  diagnostics->bands = found.bands;
  diagnostics->brightest = found.brightest;
  diagnostics->reweightings = found.reweightings;
}

void TakeDiagnostics(const estimator::BlockDiagnostics& found, EstimateDiagnostics* diagnostics) {
  diagnostics->gamma = found.gamma;
  diagnostics->ridge = diagnostics->strength = found.ridge;
  diagnostics->block_px = found.block_px;
  diagnostics->blocks_from_store = found.blocks_from_store;
}

void TakeDiagnostics(const estimator::FunctionalDiagnostics& found,
                     EstimateDiagnostics* diagnostics) {
  diagnostics->gamma = found.gamma;
  diagnostics->ridge = diagnostics->strength = found.ridge;
}

void TakeDiagnostics(std::monostate /*none*/, EstimateDiagnostics* /*diagnostics*/) {}

void TakeSummary(const estimator::SolverSummary& found, Solved* solved) {
  SolverSummary& summary = solved->summary;
  summary.message = found.message;
  summary.iterations = found.iterations;
  summary.converged = found.converged;
  summary.relative_residual = found.relative_residual;
  summary.rcond_min = found.rcond_min;
  summary.setup_seconds = found.setup_seconds;
  summary.solve_seconds = found.solve_seconds;
  summary.views_seconds = found.views_seconds;
  summary.predicted_memory_mib = found.predicted_memory_mib;
  summary.device = found.device;
  for (const estimator::BlockReport& block : found.blocks) {
    solved->blocks.push_back({block.x, block.y, block.width_px, block.height_px, block.unknowns,
                              block.iterations, block.rcond, block.relative_residual});
  }
}

// Objects that a run of one of the library's solvers needs until its end.
struct LibraryRun {
  std::shared_ptr<kernels::Backend> backend;
  std::optional<estimator::SceneViewSink> views;
  estimator::SolverRun how;
  double photo_aperture = 1;  // the used share
};

// Complete the run by what only this solver uses, and do what comes before it.
void CompleteRun(const SceneSolver& solver, const PreparedProblem& prepared,
                 const EstimateOptions& options, ViewSink* sink, RunScope* run, LibraryRun* library,
                 Solved* solved) {
  const estimator::EstimateInput& input = *prepared.input;
  // A device is worth its start where it is asked for.
  library->backend = Open(options.device == "auto" ? "cpu" : options.device, run);
  std::optional<double>& memory_limit_mib = library->how.memory_limit_mib;
  if (!memory_limit_mib) memory_limit_mib = UsualMemoryLimitMib();
  // The check compares the photograph with the whole aperture.
  if (solver.check_blur && library->photo_aperture != 1) {
    run->Inform(fmt::format(
        "the blur is not checked, because the photograph has a smaller aperture than the views; {} "
        "captured compares it with the whole one",
        run->Option("solver.photo")));
  } else if (solver.check_blur) {
    estimator::BlurCheckOptions check;
    check.falloff = prepared.effects.on.Has(Effect::kFalloff);
    check.compression_sigma = prepared.compression_sigma;
    check.threads = run->threads();
    check.memory_limit_mib = memory_limit_mib;
    check.progress = run->ProgressOf("checking the blur");
    solved->blur = estimator::CheckBlur(input, check);
  }
  solved->maps.emplace();
  // Hidden rays that are inpainted need all views.
  solved->is_scene =
      options.form == LightFieldForm::kScene && options.hidden_rays == HiddenRays::kSolver;
  if (solved->is_scene) {
    library->views.emplace().wants_views = false;
    library->how.sink = &*library->views;
    return;
  }
  solved->views_in_sink = sink != nullptr && options.hidden_rays == HiddenRays::kSolver;
  if (!solved->views_in_sink) return;
  library->views = SinkOf(sink, static_cast<double>(input.image.values.size()));
  library->how.sink = &*library->views;
}

void CompleteRun(const BlockSolver& solver, const PreparedProblem& /*prepared*/,
                 const EstimateOptions& options, ViewSink* /*sink*/, RunScope* run,
                 LibraryRun* library, Solved* /*solved*/) {
  library->backend = Open(options.device, run);
  library->how.store = solver.store.get();
}

void CompleteRun(const FunctionalSolver& /*solver*/, const PreparedProblem& /*prepared*/,
                 const EstimateOptions& /*options*/, ViewSink* /*sink*/, RunScope* run,
                 LibraryRun* /*library*/, Solved* /*solved*/) {
  run->Detail("device: cpu");
}

// Finds the aperture of the photograph; only SceneSolver knows of one.
void FindPhotoAperture(const SceneSolver& solver, const PreparedProblem& prepared, RunScope* run,
                       EstimateDiagnostics* found) {
  if (solver.photo == PhotoKind::kSharp) found->used_photo_aperture = 0;
  if (solver.photo != PhotoKind::kAuto) return;
  estimator::PhotoApertureOptions options;
  options.threads = run->threads();
  options.compression_sigma = prepared.compression_sigma;
  found->photo_aperture = estimator::MeasurePhotoAperture(*prepared.input, options);
  found->used_photo_aperture = found->photo_aperture->used_share();
}

template <typename Other>
void FindPhotoAperture(const Other& /*solver*/, const PreparedProblem& /*prepared*/,
                       RunScope* /*run*/, EstimateDiagnostics* /*found*/) {}

template <typename Given>
Solved SolveByLibrary(const Given& solver, const PreparedProblem& prepared,
                      const EstimateOptions& options, ViewSink* sink,
                      EstimateDiagnostics* diagnostics, RunScope* run) {
  LibraryRun library;
  library.how.threads = run->threads();
  library.how.memory_limit_mib = options.memory_limit_mib;
  library.how.progress = run->ProgressOf("estimating");
  Solved solved;
  FindPhotoAperture(solver, prepared, run, diagnostics);
  library.photo_aperture = diagnostics->used_photo_aperture;
  CompleteRun(solver, prepared, options, sink, run, &library, &solved);
  library.how.backend = library.backend.get();
  estimator::SolverSummary summary;
  solved.light_field =
      estimator::Solve(*prepared.input, OptionsOf(solver, prepared, *diagnostics), library.how,
                       &summary, solved.maps ? &*solved.maps : nullptr);
  if (solved.maps && !solved.is_scene) {  // the middle of the light field contains it
    solved.maps->radiance = {};
    solved.maps->of_points = {};
  }
  TakeSummary(summary, &solved);
  std::visit([&](const auto& found) { TakeDiagnostics(found, diagnostics); }, summary.diagnostics);
  return solved;
}

Solved SolveByProgram(const Solver& solver, const PreparedProblem& prepared, RunScope* run) {
  Problem problem(prepared.input);
  problem.set_falloff(prepared.effects.on.Has(Effect::kFalloff));
  Solved solved;
  const auto start = std::chrono::steady_clock::now();
  solved.light_field = solver.Solve(problem, run->control(), &solved.summary);
  // Time that the solver does not count as set-up or views is its solve.
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
        if constexpr (std::is_same_v<Given, std::shared_ptr<const Solver>>) {
          return SolveByProgram(*solver, prepared, run);
        } else if constexpr (!std::is_same_v<Given, SolverChooser>) {
          return SolveByLibrary(solver, prepared, options, sink, diagnostics, run);
        } else {
          throw Error("solver: the chooser has not been asked");
        }
      },
      options.solver);
  diagnostics->predicted_memory_mib = solved.summary.predicted_memory_mib;
  if (const auto* scene = std::get_if<SceneSolver>(&options.solver)) {
    diagnostics->strength_rule = scene->strength_rule;
  }
  return solved;
}

}  // namespace thicklens
