// The solvers behind one call: what each finds is sorted into the one summary.
#include "thicklens/estimator/solve.h"

#include <utility>

#include "thicklens/base/error.h"

namespace thicklens::estimator {
namespace {

// Fills in what the summaries of all solvers have. `Diagnostics` is the part of one solver.
template <typename Diagnostics, typename Summary>
void Take(const Summary& found, SolverSummary* summary) {
  static_cast<SolverResult&>(*summary) = found;
  summary->iterations = found.iterations;
  summary->diagnostics = static_cast<const Diagnostics&>(found);
}

model::LightField SolveBy(const EstimateInput& problem, const SceneOptions& options,
                          const SolverRun& run, SolverSummary* summary, SceneMaps* maps) {
  SceneSummary found;
  model::LightField light_field = EstimateScene(problem, options, run, &found, maps);
  Take<SceneDiagnostics>(found, summary);
  return light_field;
}

model::LightField SolveBy(const EstimateInput& problem, const BlockOptions& options,
                          const SolverRun& run, SolverSummary* summary, SceneMaps* /*none*/) {
  BlockSummary found;
  model::LightField light_field = EstimateByBlocks(problem, options, run, &found);
  Take<BlockDiagnostics>(found, summary);
  if (!IsIterative(options.solver)) summary->iterations.reset();
  summary->rcond_min = found.rcond_min;
  summary->blocks = std::move(found.blocks);
  return light_field;
}

model::LightField SolveBy(const EstimateInput& problem, const FunctionalOptions& options,
                          const SolverRun& run, SolverSummary* summary, SceneMaps* /*none*/) {
  FunctionalSummary found;
  model::LightField light_field = EstimateFunctional(problem, options, run, &found);
  Take<FunctionalDiagnostics>(found, summary);
  return light_field;
}

model::LightField SolveBy(const EstimateInput& problem, const GridOptions& options,
                          const SolverRun& run, SolverSummary* summary, SceneMaps* /*none*/) {
  FunctionalSummary found;
  model::LightField light_field = EstimateOnGrid(problem, options, run, &found);
  Take<FunctionalDiagnostics>(found, summary);
  return light_field;
}

}  // namespace

std::string SolverName(const SolverOptions& options) {
  if (std::holds_alternative<SceneOptions>(options)) return "scene";
  if (std::holds_alternative<BlockOptions>(options)) return "blocks";
  if (std::holds_alternative<FunctionalOptions>(options)) return "functional";
  return "grid";
}

bool IsValid(const SolverOptions& options, std::string* why) {
  return std::visit([why](const auto& given) { return given.IsValid(why); }, options);
}

model::LightField Solve(const EstimateInput& problem, const SolverOptions& options,
                        const SolverRun& run, SolverSummary* summary, SceneMaps* maps) {
  if (maps != nullptr && !std::holds_alternative<SceneOptions>(options)) {
    throw Error(SolverName(options) +
                " solver: maps are asked for, but only the scene solver makes them");
  }
  SolverSummary unused;
  if (summary == nullptr) summary = &unused;
  *summary = SolverSummary();
  summary->solver = SolverName(options);
  return std::visit([&](const auto& given) { return SolveBy(problem, given, run, summary, maps); },
                    options);
}

}  // namespace thicklens::estimator
