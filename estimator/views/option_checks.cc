#include "estimator/views/option_checks.h"

#include <cmath>

namespace thicklens::estimator {

bool IsPositive(const char* field, std::optional<double> value, std::string* why) {
  if (!value || (*value > 0 && std::isfinite(*value))) return true;
  return Fail(why, fmt::format("{} is {}: it must be finite and > 0", field, *value));
}

bool IsNonNegative(const char* field, std::optional<double> value, std::string* why) {
  if (!value || (*value >= 0 && std::isfinite(*value))) return true;
  return Fail(why, fmt::format("{} is {}: it must be finite and >= 0", field, *value));
}

bool IsTolerance(const char* field, std::optional<double> value, std::string* why) {
  if (!value || (*value > 0 && *value < 1)) return true;
  return Fail(why, fmt::format("{} is {}: it must be > 0 and < 1", field, *value));
}

bool IsAtLeast(int least, const char* field, std::optional<int> value, std::string* why) {
  if (!value || *value >= least) return true;
  return Fail(why, fmt::format("{} is {}: it must be >= {}", field, *value, least));
}

bool SolverRun::IsValid(std::string* why) const {
  return IsAtLeast(0, "threads", threads, why) &&
         IsPositive("memory_limit_mib", memory_limit_mib, why);
}

void CheckRun(const std::string& solver, const SolverRun& run, RunUse use) {
  std::string why;
  if (!run.IsValid(&why)) throw Error(solver + ": " + why);
  if (run.store != nullptr && use != RunUse::kStore) {
    throw Error(solver + ": a store of blocks is given, but only the block solver uses one");
  }
  if (run.sink != nullptr && use != RunUse::kSink) {
    throw Error(solver + ": a sink of views is given, but only the scene solver uses one");
  }
}

}  // namespace thicklens::estimator
