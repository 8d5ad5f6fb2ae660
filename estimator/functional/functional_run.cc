#include "estimator/functional/functional_run.h"

#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "estimator/views/input_checks.h"
#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/residual_guard.h"
#include "thicklens/base/run_cost.h"

namespace thicklens::estimator {
namespace {

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

void StartRun(const std::string& solver, const EstimateInput& input,
              const FunctionalOptions& options, FunctionalSummary* summary) {
  std::string why;
  if (!options.IsValid(&why)) throw Error(solver + ": " + why);
  CheckInput(input);
  *summary = FunctionalSummary();
  summary->threads = ResolveThreads(options.threads);
  summary->gamma = options.gamma;
  summary->ridge = options.ridge.value_or(1e-2 / static_cast<double>(input.weights.size()));
}

void RequireMemory(const FunctionalOptions& options, double bytes) {
  if (!options.memory_limit_mib || bytes <= *options.memory_limit_mib * kBytesPerMib) return;
  throw Error(
      fmt::format("memory limit {:.0f} MiB: all rays of the image together need {:.0f} MiB; the "
                  "limit must be at least as large, or use fewer views or a smaller image",
                  *options.memory_limit_mib, std::ceil(bytes / kBytesPerMib)));
}

void FillOrigin(const std::string& method, const FunctionalSummary& summary, bool falloff,
                model::LightFieldOrigin* origin) {
  origin->method = method;
  origin->device = "cpu";
  origin->gamma = summary.gamma;
  origin->ridge = summary.ridge;
  origin->iterations = summary.iterations;
  origin->relative_residual = summary.relative_residual;
  origin->effects = {"defocus"};
  if (falloff) origin->effects.emplace_back("falloff");
}

void EndRun(const std::string& solver, const FunctionalOptions& options,
            FunctionalSummary* summary) {
  RequireProgress(
      solver, summary->relative_residual, summary->iterations,
      "allow more iterations, or use a smaller gamma, a larger ridge or double precision");
  summary->converged = summary->relative_residual <= options.tolerance;
  summary->message = MessageOf(options, *summary);
}

}  // namespace thicklens::estimator
