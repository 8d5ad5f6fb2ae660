#include "tools/report/focus_limits.h"

#include <fmt/format.h>

#include <cmath>

#include "tools/report/rounding.h"

namespace thicklens::tools {
namespace {

constexpr double kUmPerMm = 1000;

std::string WithSigmaMm(double value, double sigma) {
  if (!(sigma > 0)) return fmt::format("{:.6g} mm", value);
  return fmt::format("{} +- {} mm", RoundedTo(value, sigma), RoundedSigma(sigma));
}

std::string LimitText(const model::DepthLimit& limit) {
  if (!limit.sigma_mm) {
    return std::isfinite(limit.interval_mm.x())
               ? fmt::format("infinity (within its error from {:.4g} mm)", limit.interval_mm.x())
               : "infinity";
  }
  std::string text = WithSigmaMm(limit.depth_mm, *limit.sigma_mm);
  if (!std::isfinite(limit.interval_mm.y())) text += " (infinity within its error)";
  return text;
}

nlohmann::json LimitNumber(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

// null is infinity.
nlohmann::json LimitJson(const model::DepthLimit& limit) {
  return {{"value", LimitNumber(limit.depth_mm)},
          {"sigma", limit.sigma_mm ? LimitNumber(*limit.sigma_mm) : nlohmann::json(nullptr)},
          {"interval", {LimitNumber(limit.interval_mm.x()), LimitNumber(limit.interval_mm.y())}}};
}

nlohmann::json QuantityJson(const model::Estimate& estimate) {
  return {{"value", LimitNumber(estimate.value)}, {"sigma", LimitNumber(estimate.sigma)}};
}

}  // namespace

std::vector<std::string> FocusLimitsLines(const model::FocusLimits& limits) {
  std::vector<std::string> lines;
  std::string field =
      fmt::format("depth of field for a circle of confusion of {:.4g} um ({:.3g} px): {} to {}",
                  kUmPerMm * limits.circle_of_confusion_mm, limits.circle_of_confusion_px,
                  LimitText(limits.near), LimitText(limits.far));
  if (limits.depth_of_field_mm) {
    field += fmt::format(", in all {}", WithSigmaMm(limits.depth_of_field_mm->value,
                                                    limits.depth_of_field_mm->sigma));
  }
  lines.push_back(field);
  lines.push_back(fmt::format(
      "hyperfocal distance for this circle: {:.6g}{} mm; depth of focus (of the sensor): {}",
      limits.hyperfocal_mm,
      limits.hyperfocal_tolerance_mm > 0
          ? fmt::format(" (tolerance {:.2g})", limits.hyperfocal_tolerance_mm)
          : "",
      WithSigmaMm(limits.depth_of_focus_mm.value, limits.depth_of_focus_mm.sigma)));
  return lines;
}

nlohmann::json FocusLimitsJson(const model::FocusLimits& limits) {
  return {{"circle_of_confusion_um", kUmPerMm * limits.circle_of_confusion_mm},
          {"circle_of_confusion_px", limits.circle_of_confusion_px},
          {"near_mm", LimitJson(limits.near)},
          {"far_mm", LimitJson(limits.far)},
          {"depth_of_field_mm", limits.depth_of_field_mm ? QuantityJson(*limits.depth_of_field_mm)
                                                         : nlohmann::json(nullptr)},
          {"depth_of_focus_mm", QuantityJson(limits.depth_of_focus_mm)},
          {"hyperfocal_mm",
           {{"value", limits.hyperfocal_mm}, {"tolerance", limits.hyperfocal_tolerance_mm}}},
          {"blur_sigma_px", QuantityJson(limits.blur_sigma_px)}};
}

}  // namespace thicklens::tools
