#include "estimator/functional/functional_run.h"

#include <fmt/format.h>

#include <cmath>

#include "estimator/views/input_checks.h"
#include "estimator/views/option_checks.h"
#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/residual_guard.h"
#include "thicklens/base/run_cost.h"

namespace thicklens::estimator {
namespace {

std::string MessageOf(const WholeImageOptions& options, const FunctionalSummary& summary) {
  std::string message = fmt::format("gamma {:.3g}, ridge {:.3g}, {} iterations", summary.gamma,
                                    summary.ridge, summary.iterations);
  if (!summary.converged) {
    message +=
        fmt::format("; stopped at a relative residual of {:.2g}, above the tolerance of {:.2g}",
                    summary.relative_residual, options.tolerance);
  }
  return message;
}

}  // namespace

bool WholeImageOptions::IsValid(std::string* why) const {
  return IsPositive("gamma", gamma, why) && IsPositive("ridge", ridge, why) &&
         IsTolerance("tolerance", tolerance, why) &&
         IsAtLeast(1, "max_iterations", max_iterations, why);
}

void StartRun(const std::string& solver, const EstimateInput& input,
              const WholeImageOptions& options, const SolverRun& run, FunctionalSummary* summary) {
  CheckOptions(solver, options);
  CheckRun(solver, run, RunUse::kNone);
  CheckInput(input);
  *summary = FunctionalSummary();
  summary->threads = ResolveThreads(run.threads);
  summary->device = "cpu";
  summary->gamma = options.gamma;
  summary->ridge = options.ridge.value_or(1e-2 / static_cast<double>(input.weights.size()));
}

void RequireMemory(const SolverRun& run, double bytes) {
  if (!run.memory_limit_mib || bytes <= *run.memory_limit_mib * kBytesPerMib) return;
  throw Error(
      fmt::format("memory limit {:.0f} MiB: all rays of the image together need {:.0f} MiB; the "
                  "limit must be at least as large, or use fewer views or a smaller image",
                  *run.memory_limit_mib, std::ceil(bytes / kBytesPerMib)));
}

void FillOrigin(const std::string& method, const FunctionalSummary& summary, bool falloff,
                model::LightFieldOrigin* origin) {
  origin->method = method;
  origin->device = summary.device;
  origin->gamma = summary.gamma;
  origin->ridge = summary.ridge;
  origin->iterations = summary.iterations;
  origin->relative_residual = summary.relative_residual;
  origin->effects = {"defocus"};
  if (falloff) origin->effects.emplace_back("falloff");
}

void EndRun(const std::string& solver, const WholeImageOptions& options,
            FunctionalSummary* summary) {
  RequireProgress(
      solver, summary->relative_residual, summary->iterations,
      "allow more iterations, or use a smaller gamma, a larger ridge or double precision");
  summary->converged = summary->relative_residual <= options.tolerance;
  summary->message = MessageOf(options, *summary);
}

}  // namespace thicklens::estimator
