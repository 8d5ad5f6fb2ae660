#include "tools/report/rounding.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace thicklens::tools {
namespace {

// Returns the number of decimals that show two digits of sigma; the exponent is determined after
// rounding, so that 0.0996 becomes 0.10 with two decimals.
int DecimalsOf(double sigma) {
  const int exponent = std::stoi(fmt::format("{:.1e}", sigma).substr(4));
  return std::clamp(1 - exponent, 0, 12);
}

}  // namespace

bool UsableSigma(double sigma) { return std::isfinite(sigma) && sigma > 0; }

std::string RoundedTo(double value, double sigma) {
  if (!std::isfinite(value)) return fmt::format("{}", value);
  std::string text = UsableSigma(sigma) ? fmt::format("{:.{}f}", value, DecimalsOf(sigma))
                                        : fmt::format("{:.5g}", value);
  // Avoids "-0.00": the sign of a value that is rounded away has no meaning.
  if (text[0] == '-' && text.find_first_of("123456789") == std::string::npos) text.erase(0, 1);
  return text;
}

std::string RoundedSigma(double sigma) {
  return UsableSigma(sigma) ? fmt::format("{:.{}f}", sigma, DecimalsOf(sigma)) : "-";
}

std::string SignedRoundedTo(double value, double sigma) {
  const std::string text = RoundedTo(value, sigma);
  return std::isfinite(value) && text[0] != '-' ? "+" + text : text;
}

std::string WithError(double value, double sigma, const std::string& unit) {
  return RoundedTo(value, sigma) + (UsableSigma(sigma) ? " +- " + RoundedSigma(sigma) : "") +
         (unit.empty() ? "" : " " + unit);
}

std::string SignedWithError(double value, double sigma, const std::string& unit) {
  const std::string text = WithError(value, sigma, unit);
  return std::isfinite(value) && text[0] != '-' ? "+" + text : text;
}

}  // namespace thicklens::tools
