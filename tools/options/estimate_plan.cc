#include "tools/options/estimate_plan.h"

#include <fmt/format.h>

#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/base/memory_available.h"
#include "thicklens/base/stopwatch.h"
#include "thicklens/estimator/solve.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;

template <typename Value>
Value FieldOf(const json& fields, const char* name, const std::string& where) {
  const auto found = fields.find(name);
  if (found == fields.end()) throw Error(fmt::format("{}: the plan has no '{}'", where, name));
  try {
    return found->get<Value>();
  } catch (const json::exception&) {
    throw Error(fmt::format("{}: {}: the value {} is not allowed", where, name, found->dump()));
  }
}

template <typename Value>
std::optional<Value> OptionalFieldOf(const json& fields, const char* name,
                                     const std::string& where) {
  const auto found = fields.find(name);
  if (found == fields.end() || found->is_null()) return std::nullopt;
  return FieldOf<Value>(fields, name, where);
}

// Returns the options of the plan's solver; what the plan does not state has the solver's default.
estimator::SolverOptions SolverOptionsOf(const estimator::EstimatePlan& plan) {
  if (plan.solver == "scene") {
    estimator::SceneOptions scene;
    if (!plan.prior.empty()) scene.prior = estimator::PriorFromName(plan.prior);
    scene.tolerance = plan.tolerance;
    scene.double_precision = plan.double_precision;
    return scene;
  }
  if (plan.solver == "blocks") {
    estimator::BlockOptions blocks;
    if (!plan.block_solver.empty()) {
      blocks.solver = estimator::BlockSolverFromName(plan.block_solver);
    }
    blocks.tolerance = plan.tolerance.value_or(blocks.tolerance);
    blocks.block_px = plan.block_px;
    return blocks;
  }
  estimator::WholeImageOptions whole;
  whole.tolerance = plan.tolerance.value_or(whole.tolerance);
  whole.double_precision = plan.double_precision;
  if (plan.solver == "grid") return estimator::GridOptions{whole};
  return estimator::FunctionalOptions{whole};
}

}  // namespace

std::vector<std::string> PlanWords(const estimator::EstimatePlan& plan) {
  std::vector<std::string> words = {"--solver", plan.solver};
  const auto add = [&words](const char* option, const std::string& value) {
    words.insert(words.end(), {option, value});
  };
  if (!plan.prior.empty()) add("--prior", plan.prior);
  if (!plan.block_solver.empty()) add("--block-solver", plan.block_solver);
  if (plan.block_px) add("--block-px", fmt::format("{}", *plan.block_px));
  if (plan.tolerance) add("--tolerance", fmt::format("{:g}", *plan.tolerance));
  if (plan.double_precision) words.emplace_back("--double");
  if (plan.on_opencl) add("--device", "opencl");
  // Otherwise the best device is used; ViennaCL selects one itself.
  if (!plan.on_opencl && plan.solver == "blocks" && plan.block_solver != "viennacl") {
    add("--device", "cpu");
  }
  return words;
}

std::string PlanArguments(const estimator::EstimatePlan& plan) {
  return fmt::format("{}", fmt::join(PlanWords(plan), " "));
}

json PlanJson(const estimator::EstimatePlan& plan) {
  const auto or_null = [](const auto& value) { return value ? json(*value) : json(); };
  const auto name_or_null = [](const std::string& name) {
    return name.empty() ? json() : json(name);
  };
  return {{"solver", plan.solver},
          {"prior", name_or_null(plan.prior)},
          {"block_solver", name_or_null(plan.block_solver)},
          {"tolerance", or_null(plan.tolerance)},
          {"double", plan.double_precision},
          {"block_px", or_null(plan.block_px)},
          {"device", plan.on_opencl ? "opencl" : "cpu"}};
}

estimator::EstimatePlan PlanFromJson(const json& fields, const std::string& where) {
  if (!fields.is_object()) {
    throw Error(fmt::format("{}: a plan's fields are expected, found {}", where, fields.dump()));
  }
  estimator::EstimatePlan plan;
  plan.solver = FieldOf<std::string>(fields, "solver", where);
  plan.prior = OptionalFieldOf<std::string>(fields, "prior", where).value_or("");
  plan.block_solver = OptionalFieldOf<std::string>(fields, "block_solver", where).value_or("");
  plan.tolerance = OptionalFieldOf<double>(fields, "tolerance", where);
  plan.double_precision = OptionalFieldOf<bool>(fields, "double", where).value_or(false);
  plan.block_px = OptionalFieldOf<int>(fields, "block_px", where);
  const std::string device = OptionalFieldOf<std::string>(fields, "device", where).value_or("cpu");
  if (device != "cpu" && device != "opencl") {
    throw Error(fmt::format("{}: device: cpu or opencl is expected, found '{}'", where, device));
  }
  plan.on_opencl = device == "opencl";
  if (plan.solver != "scene" && plan.solver != "blocks" && plan.solver != "functional" &&
      plan.solver != "grid") {
    throw Error(fmt::format("{}: solver: scene, blocks, functional or grid is expected, found '{}'",
                            where, plan.solver));
  }
  // A file must not contain what the command line of estimate would refuse.
  EstimateOptions options;
  ApplyPlan(plan, &options);
  try {
    CheckSolverUsage(options);
    std::string why;
    if (!estimator::IsValid(SolverOptionsOf(plan), &why)) throw Error(why);
  } catch (const Error& error) {
    throw Error(fmt::format("{}: {}", where, error.what()));
  }
  return plan;
}

void ApplyPlan(const estimator::EstimatePlan& plan, EstimateOptions* options) {
  const auto given = [](const std::string& name) {
    return name.empty() ? std::nullopt : std::optional<std::string>(name);
  };
  options->solver = plan.solver;
  options->prior = given(plan.prior);
  options->block_solver = given(plan.block_solver);
  options->tolerance = plan.tolerance;
  options->double_precision = plan.double_precision;
  options->block_px = plan.block_px;
  // ViennaCL selects a device itself.
  const char* processor = plan.block_solver == "viennacl" ? "auto" : "cpu";
  options->device = plan.on_opencl ? "opencl" : processor;
}

PlanRun RunPlan(const estimator::EstimatePlan& plan, const estimator::EstimateInput& input,
                int threads, kernels::Backend* backend) {
  estimator::SolverRun how;
  how.threads = threads;
  how.backend = backend;
  if (plan.solver == "scene") {
    how.memory_limit_mib = UsualMemoryLimitMib();  // which `estimate` respects as well
  }
  estimator::SolverSummary summary;
  PlanRun run;
  run.light_field = estimator::Solve(input, SolverOptionsOf(plan), how, &summary);
  run.setup_seconds = summary.setup_seconds;
  run.solve_seconds = summary.solve_seconds;
  run.views_seconds = summary.views_seconds;
  run.iterations = summary.iterations;
  run.converged = summary.converged;
  run.relative_residual = summary.relative_residual;
  run.rcond = summary.rcond_min;
  if (plan.solver == "scene" || plan.solver == "blocks") run.device = summary.device;
  return run;
}

PlanRun RunWarping(const estimator::EstimateInput& input, int threads) {
  PlanRun run;
  const auto start = Clock::now();
  run.light_field = estimator::WarpedLightField(input, true, threads);
  run.views_seconds = SecondsSince(start);
  return run;
}

}  // namespace thicklens::tools
