#include "thicklens/calib/calibration.h"

#include <fmt/format.h>

namespace thicklens::calib {

std::string OutcomeName(Outcome outcome) {
  switch (outcome) {
    case Outcome::kOk:
      return "ok";
    case Outcome::kPartial:
      return "partial";
    default:
      return "refused";
  }
}

std::string CalibrationSummary::BriefReport() const {
  const auto number = [](const char* name, const std::optional<Result>& value, const char* unit) {
    return value ? fmt::format("{} {:.6g} +- {:.2g}{}", name, value->value, value->sigma, unit)
                 : fmt::format("{} not determined", name);
  };
  const char* found = outcome == Outcome::kOk        ? "calibrated"
                      : outcome == Outcome::kPartial ? "partly calibrated"
                                                     : "calibration refused";
  std::string text =
      fmt::format("{}: {}, {}, {}; {} frames used, {} rejected, {:.1f} s", found,
                  number("d1", image_distance_mm, " mm"), number("zf", focus_depth_mm, " mm"),
                  number("kappa", blur_ratio, ""), frames_used, frames_rejected, seconds);
  if (outcome != Outcome::kOk) text += "; " + reason;
  return text;
}

}  // namespace thicklens::calib
