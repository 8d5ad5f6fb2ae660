#ifndef THICKLENS_ESTIMATOR_VIEWS_OPTION_CHECKS_H_
#define THICKLENS_ESTIMATOR_VIEWS_OPTION_CHECKS_H_

#include <fmt/format.h>

#include <optional>
#include <string>
#include <type_traits>

#include "thicklens/base/error.h"
#include "thicklens/base/validity.h"
#include "thicklens/estimator/solver_run.h"

namespace thicklens::estimator {

// Checks of one option. Each returns false, and "FIELD is VALUE: it must be CONSTRAINT" in `why`
// (may be null), if the value is not valid. NaN never is, and an absent value always is.
bool IsPositive(const char* field, std::optional<double> value, std::string* why);     // and finite
bool IsNonNegative(const char* field, std::optional<double> value, std::string* why);  // and finite
bool IsTolerance(const char* field, std::optional<double> value, std::string* why);  // > 0 and < 1
bool IsAtLeast(int least, const char* field, std::optional<int> value, std::string* why);

// An enumeration without gaps from 0 to `last`: a number that was converted may be none of it.
template <typename Enum>
bool IsEnumerator(Enum last, const char* field, Enum value, std::string* why) {
  const auto number = static_cast<std::underlying_type_t<Enum>>(value);
  const auto largest = static_cast<std::underlying_type_t<Enum>>(last);
  if (number >= 0 && number <= largest) return true;
  return Fail(why,
              fmt::format("{} is {}: it must be an enumerator, 0 to {}", field, number, largest));
}

// Which members of a run, besides those of all solvers, a solver uses.
enum class RunUse { kNone, kStore, kSink };

// Throws Error that begins with the name of the solver if the run is not valid, or has something
// that the solver does not use.
void CheckRun(const std::string& solver, const SolverRun& run, RunUse use);

// Throws Error that begins with the name of the solver if its options are not valid.
template <typename Options>
void CheckOptions(const std::string& solver, const Options& options) {
  std::string why;
  if (!options.IsValid(&why)) throw Error(solver + ": " + why);
}

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_VIEWS_OPTION_CHECKS_H_
