#ifndef THICKLENS_TOOLS_INTERFACE_VALIDATION_H_
#define THICKLENS_TOOLS_INTERFACE_VALIDATION_H_

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

#include "thicklens/model/camera.h"
#include "thicklens/run.h"

// Checks of option structs. Every bound is written so that NaN fails. A failed check writes
// "FIELD: CONSTRAINT is expected, found VALUE" to `why`, from which RequireValid makes an
// OptionError.
namespace thicklens::checks {

inline bool Fail(std::string* why, const std::string& field, const std::string& message) {
  if (why != nullptr) *why = field + ": " + message;
  return false;
}

template <typename Number>
bool Unexpected(std::string* why, const std::string& field, const char* constraint, Number found) {
  return Fail(why, field, fmt::format("{} is expected, found {}", constraint, found));
}

inline bool Finite(std::string* why, const std::string& field, double value) {
  return std::isfinite(value) || Unexpected(why, field, "a finite number", value);
}
inline bool Positive(std::string* why, const std::string& field, double value) {
  return (value > 0 && std::isfinite(value)) ||
         Unexpected(why, field, "a finite number > 0", value);
}
inline bool NonNegative(std::string* why, const std::string& field, double value) {
  return (value >= 0 && std::isfinite(value)) ||
         Unexpected(why, field, "a finite number >= 0", value);
}
// lo < value <= hi.
inline bool AboveUpTo(std::string* why, const std::string& field, double lo, double hi,
                      double value) {
  return (value > lo && value <= hi) ||
         Unexpected(why, field, fmt::format("a number > {:g} and <= {:g}", lo, hi).c_str(), value);
}
// A relative residual: 0 < value < 1.
inline bool Residual(std::string* why, const std::string& field, double value) {
  return (value > 0 && value < 1) || Unexpected(why, field, "a number > 0 and < 1", value);
}
inline bool WholeBetween(std::string* why, const std::string& field, int lo, int hi, int value) {
  return (value >= lo && value <= hi) ||
         Unexpected(why, field, fmt::format("a whole number from {} to {}", lo, hi).c_str(), value);
}

// An enumerator that a cast made of a number without a name is not valid.
template <typename Enum>
bool OneOf(std::string* why, const std::string& field, Enum last, Enum value) {
  using Number = std::underlying_type_t<Enum>;
  const auto number = static_cast<Number>(value);
  return (number >= 0 && number <= static_cast<Number>(last)) ||
         Unexpected(why, field, "an enumerator", static_cast<int>(number));
}

// Applies a check to a value that may be absent; an absent one is valid.
template <typename Value, typename CheckOne>
bool IfGiven(const std::optional<Value>& value, const CheckOne& check) {
  return !value || check(*value);
}

// Applies IsValid of a member, whose field names get the member's name in front.
template <typename Options>
bool Member(std::string* why, const std::string& name, const Options& options) {
  std::string reason;
  if (options.IsValid(&reason)) return true;
  if (why != nullptr) *why = name + "." + reason;
  return false;
}

// Throws OptionError unless the options are valid.
template <typename Options>
void RequireValid(const Options& options) {
  std::string why;
  if (options.IsValid(&why)) return;
  throw OptionError(why.substr(0, why.find(':')), why);
}

// Throws OptionError unless the argument `field` of a call is an enumerator.
template <typename Enum>
void RequireOneOf(const std::string& field, Enum last, Enum value) {
  std::string why;
  if (!OneOf(&why, field, last, value)) throw OptionError(field, why);
}

// Throws Error, which begins with `name`, unless the light field, camera or other input is valid.
template <typename Input>
void RequireValidInput(const std::string& name, const Input& input) {
  std::string why;
  if (!input.IsValid(&why)) throw Error(fmt::format("{}: {}", name, why));
}

// Throws Error, which names the camera, unless it is valid.
inline void RequireValidCamera(const model::Camera& camera) {
  RequireValidInput(camera.source.empty() ? fmt::format("camera '{}' is not valid", camera.name)
                                          : camera.source + ": the camera is not valid",
                    camera);
}

}  // namespace thicklens::checks

#endif  // THICKLENS_TOOLS_INTERFACE_VALIDATION_H_
