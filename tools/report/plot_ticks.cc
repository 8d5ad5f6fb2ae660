#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "tools/report/svg_plot.h"

namespace thicklens::tools {

std::vector<double> NiceTicks(double lo, double hi, int at_most) {
  std::vector<double> ticks;
  if (!std::isfinite(lo) || !std::isfinite(hi) || !(lo < hi) || at_most < 1) return ticks;
  const double span = hi - lo;
  const double power = std::pow(10, std::floor(std::log10(span / at_most)));
  for (double factor : {1.0, 2.0, 5.0, 10.0, 20.0, 50.0}) {
    const double step = factor * power;
    const double first = std::ceil(lo / step - 1e-9);
    const double last = std::floor(hi / step + 1e-9);
    if (last - first + 1 > at_most) continue;
    // Multiples of the step, not a running sum, so that zero is exactly zero.
    for (int i = 0; i <= static_cast<int>(last - first); ++i) ticks.push_back((first + i) * step);
    return ticks;
  }
  return ticks;
}

std::vector<double> NiceLogTicks(double lo, double hi, int at_most) {
  if (!std::isfinite(lo) || !std::isfinite(hi) || !(lo > 0) || !(lo < hi) || at_most < 1) return {};
  const int first = static_cast<int>(std::floor(std::log10(lo)));
  const int last = static_cast<int>(std::floor(std::log10(hi)));
  const auto ticks_of = [&](const std::vector<double>& factors) {
    std::vector<double> ticks;
    for (int power = first; power <= last; ++power) {
      for (const double factor : factors) {
        const double tick = factor * std::pow(10, power);
        if (tick >= lo * (1 - 1e-9) && tick <= hi * (1 + 1e-9)) ticks.push_back(tick);
      }
    }
    return ticks;
  };
  for (const std::vector<double>& factors : {std::vector<double>{1, 2, 5}, {1, 3}, {1}}) {
    const std::vector<double> ticks = ticks_of(factors);
    if (static_cast<int>(ticks.size()) > at_most) continue;
    return ticks.size() < 3 && hi < 10 * lo ? NiceTicks(lo, hi, at_most) : ticks;
  }
  std::vector<double> ticks = ticks_of({1});
  const std::size_t every =
      (ticks.size() + static_cast<std::size_t>(at_most) - 1) / static_cast<std::size_t>(at_most);
  std::vector<double> fewer;
  for (std::size_t i = 0; i < ticks.size(); i += every) fewer.push_back(ticks[i]);
  return fewer;
}

std::string TickLabel(double value, double step) {
  const int decimals =
      step > 0 ? std::clamp(static_cast<int>(std::ceil(-std::log10(step) - 1e-9)), 0, 9) : 0;
  std::string label = std::abs(value) >= 1e6 ? fmt::format("{:.3g}", value)
                                             : fmt::format("{:.{}f}", value, decimals);
  if (label[0] == '-') label.replace(0, 1, "\xE2\x88\x92");  // U+2212
  return label;
}

}  // namespace thicklens::tools
