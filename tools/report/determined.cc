#include "tools/report/determined.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "thicklens/base/printable_text.h"
#include "tools/report/calibration_summary.h"
#include "tools/report/rounding.h"

namespace thicklens::tools {
namespace {

constexpr std::size_t kReportedCauses = 4;  // for one symptom in the text; the rest is in the JSON

nlohmann::json FiniteNumber(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

nlohmann::json ErrorJson(const std::optional<model::Estimate>& estimate) {
  if (!estimate) return nullptr;
  return {{"value", FiniteNumber(estimate->value)}, {"sigma", FiniteNumber(estimate->sigma)}};
}

std::string SharpestImage(const calib::Calibration& calibration) {
  const int index = calibration.diagnostics.sharpest.sharpest_frame;
  if (index < 0 || index >= static_cast<int>(calibration.frames.size())) return "";
  return calibration.frames[static_cast<std::size_t>(index)].image;
}

// Unit of the readings in words; counts of unknown length have no other.
const char* UnitOfReadings(const calib::Calibration& calibration) {
  return calibration.diagnostics.step_length_mm ? "steps" : "mm";
}

}  // namespace

std::string SharpestLine(const calib::Calibration& calibration) {
  const calib::SharpestReading& sharpest = calibration.diagnostics.sharpest;
  if (!sharpest.done && sharpest.message == calib::SharpestReading().message) return "";
  const std::string image = SharpestImage(calibration);
  const std::string frame =
      image.empty() ? "" : fmt::format("; {} is the sharpest", FrameName(image));
  if (!sharpest.done) return fmt::format("no peak, {}{}", sharpest.message, frame);
  return fmt::format(
      "reading {}, by {} frames{}",
      WithError(sharpest.reading_mm.value, sharpest.reading_mm.sigma, UnitOfReadings(calibration)),
      sharpest.frames_used, frame);
}

std::string OffsetOriginLine(const calib::Calibration& calibration) {
  const calib::CalibrationDiagnostics& diagnostics = calibration.diagnostics;
  if (diagnostics.bench_offset_from.empty() ||
      calibration.summary.outcome == calib::Outcome::kRefused)
    return "";
  std::string line = "by " + diagnostics.bench_offset_from;
  if (const auto& step = diagnostics.step_length_mm)
    line += fmt::format("; 1 step = {}", WithError(step->value, step->sigma, "mm"));
  if (const auto& m = diagnostics.magnification_at_focus; m && calibration.summary.focus_depth_mm)
    line += fmt::format("; magnification at focus {}", WithError(m->value, m->sigma, ""));
  std::vector<std::string> agreeing;
  for (const calib::ComparedFocus& other : diagnostics.compared_focus) {
    if (!other.agrees) continue;
    agreeing.push_back(
        fmt::format("{} (zf {})", other.name,
                    WithError(other.focus_depth_mm.value, other.focus_depth_mm.sigma, "mm")));
  }
  if (!agreeing.empty())
    line += fmt::format("; {} {} with it", fmt::join(agreeing, ", "),
                        agreeing.size() == 1 ? "agrees" : "agree");
  return line;
}

std::string ScaleChangeLine(const calib::ScaleModel& scale) {
  if (!scale.change_over_sweep) return "";
  const model::Estimate& change = *scale.change_over_sweep;
  const bool is_seen = std::abs(change.value) > 4 * change.sigma;
  return fmt::format("1/scale changes by {} over the sweep: {}",
                     SignedWithError(100 * change.value, 100 * change.sigma, "%"),
                     !is_seen           ? "not significant"
                     : change.value > 0 ? "the target looks smaller at larger readings"
                                        : "the target looks larger at larger readings");
}

std::vector<std::string> DiagnosisLines(const calib::Calibration& calibration) {
  std::vector<std::string> lines;
  for (const calib::Diagnosis& diagnosis : calibration.diagnostics.diagnoses) {
    std::vector<std::string> causes;
    for (std::size_t i = 0; i < std::min(diagnosis.causes.size(), kReportedCauses); ++i)
      causes.push_back(fmt::format("{} (chi2 {:.3g}{})", diagnosis.causes[i].cause,
                                   diagnosis.causes[i].chi2, i < diagnosis.named ? ", named" : ""));
    causes.push_back(fmt::format("no cause (chi2 {:.3g})", diagnosis.chi2_of_none));
    lines.push_back(fmt::format("{}: {}", diagnosis.symptom, fmt::join(causes, "; ")));
  }
  return lines;
}

std::string PatternLine(const calib::FixedPattern& pattern) { return pattern.InWords(); }

std::string ResponseLine(const calib::CameraResponse& response) {
  std::vector<std::string> found;
  if (response.light_exponent)
    found.push_back(
        fmt::format("the light is the value as read to the power {}",
                    WithError(response.light_exponent->value, response.light_exponent->sigma, "")));
  if (response.weak_detail_loss)
    found.push_back(fmt::format("weak detail loses {} per factor e of contrast",
                                SignedWithError(100 * response.weak_detail_loss->value,
                                                100 * response.weak_detail_loss->sigma, "%")));
  return fmt::format("{}", fmt::join(found, "; "));
}

nlohmann::json SharpestJson(const calib::Calibration& calibration) {
  const calib::SharpestReading& sharpest = calibration.diagnostics.sharpest;
  nlohmann::json out = {{"done", sharpest.done}, {"message", PrintableUtf8(sharpest.message)}};
  out["reading_mm"] = sharpest.done ? ErrorJson(sharpest.reading_mm) : nlohmann::json(nullptr);
  out["frames_used"] =
      sharpest.done ? nlohmann::json(sharpest.frames_used) : nlohmann::json(nullptr);
  const std::string image = SharpestImage(calibration);
  out["sharpest_image"] =
      image.empty() ? nlohmann::json(nullptr) : nlohmann::json(PrintableUtf8(image));
  out["focus_by_blur_mm"] = ErrorJson(calibration.diagnostics.focus_reading_mm);
  out["blur_slope_px_per_mm"] = ErrorJson(calibration.diagnostics.blur_slope_px_per_mm);
  return out;
}

nlohmann::json DiagnosesJson(const calib::Calibration& calibration) {
  nlohmann::json out = nlohmann::json::array();
  for (const calib::Diagnosis& diagnosis : calibration.diagnostics.diagnoses) {
    nlohmann::json causes = nlohmann::json::array();
    for (std::size_t i = 0; i < diagnosis.causes.size(); ++i)
      causes.push_back({{"cause", PrintableUtf8(diagnosis.causes[i].cause)},
                        {"chi2", FiniteNumber(diagnosis.causes[i].chi2)},
                        {"named", i < diagnosis.named}});
    out.push_back({{"symptom", PrintableUtf8(diagnosis.symptom)},
                   {"chi2_of_none", FiniteNumber(diagnosis.chi2_of_none)},
                   {"causes", std::move(causes)},
                   {"separates", diagnosis.separates.empty()
                                     ? nlohmann::json(nullptr)
                                     : nlohmann::json(PrintableUtf8(diagnosis.separates))}});
  }
  return out;
}

nlohmann::json StructureJson(const calib::FrameStructureFinding& structure) {
  if (!structure.measured) return nullptr;
  nlohmann::json out = {{"ln_corner_over_centre", ErrorJson(structure.vignetting)},
                        {"fixed_structure", ErrorJson(structure.fixed_structure)},
                        {"bands", ErrorJson(structure.bands)}};
  out["bands_run_along"] = !structure.HasBands()         ? nlohmann::json(nullptr)
                           : structure.bands_are_columns ? nlohmann::json("columns")
                                                         : nlohmann::json("rows");
  return out;
}

nlohmann::json PatternJson(const calib::FixedPattern& pattern) {
  if (!pattern.measured) return nullptr;
  return {{"message", PrintableUtf8(pattern.message)},
          {"corner_stops", ErrorJson(pattern.corner_stops)},
          {"shading_removed", pattern.shading_removed},
          {"specks", pattern.specks},
          {"deepest_speck", FiniteNumber(pattern.deepest_speck)},
          {"defective_px", pattern.defective_px},
          {"divided_share", FiniteNumber(pattern.divided_share)},
          {"filled_share", FiniteNumber(pattern.filled_share)},
          {"column_deviation", FiniteNumber(pattern.column_deviation)},
          {"row_deviation", FiniteNumber(pattern.row_deviation)}};
}

nlohmann::json StageJson(const calib::StageErrors& stage) {
  if (!stage.compared) return nullptr;
  nlohmann::json out = {{"message", PrintableUtf8(stage.message)},
                        {"backlash_mm", ErrorJson(stage.backlash_mm)},
                        {"slip_mm", ErrorJson(stage.slip_mm)}};
  out["slip_from_frame"] =
      stage.slip_mm ? nlohmann::json(stage.slip_from_frame) : nlohmann::json(nullptr);
  out["periodic"] = nullptr;
  if (stage.periodic) {
    out["periodic"] = {{"amplitude_mm", ErrorJson(stage.periodic->amplitude_mm)},
                       {"period_mm", ErrorJson(stage.periodic->period_mm)},
                       {"phase_deg", FiniteNumber(stage.periodic->phase_deg)}};
  }
  out["also_possible"] = nlohmann::json::array();
  for (const std::string& cause : stage.also_possible)
    out["also_possible"].push_back(PrintableUtf8(cause));
  return out;
}

nlohmann::json LightJson(const calib::FrameLight& light) {
  const auto number = [](const std::optional<double>& value) {
    return value ? FiniteNumber(*value) : nlohmann::json(nullptr);
  };
  nlohmann::json out = {
      {"bands", ErrorJson(light.bands)},
      {"bands_removed", light.bands_removed},
      {"band_period_px", number(light.band_period_px)},
      {"exposure_range_stops", number(light.exposure_range_stops)},
      {"exposure_trend_stops", light.exposure_range_stops ? FiniteNumber(light.exposure_trend_stops)
                                                          : nlohmann::json(nullptr)},
      {"red_over_green_change", number(light.red_change)},
      {"blue_over_green_change", number(light.blue_change)}};
  out["bands_run_along"] = !light.bands              ? nlohmann::json(nullptr)
                           : light.bands_are_columns ? nlohmann::json("columns")
                                                     : nlohmann::json("rows");
  return out;
}

nlohmann::json ResponseJson(const calib::CameraResponse& response) {
  if (!response.measured) return nullptr;
  nlohmann::json out = {{"light_exponent", ErrorJson(response.light_exponent)},
                        {"weak_detail_loss", ErrorJson(response.weak_detail_loss)},
                        {"noise_rise", ErrorJson(response.noise_rise)},
                        {"block_grid", ErrorJson(response.block_grid)}};
  out["contradicts_transfer"] = response.ContradictsTransfer();
  out["loses_weak_detail"] = response.LosesWeakDetail();
  out["is_sharpened"] = response.IsSharpened();
  out["is_compressed"] = response.IsCompressed();
  out["better_transfer"] = response.better_transfer.empty()
                               ? nlohmann::json(nullptr)
                               : nlohmann::json(PrintableUtf8(response.better_transfer));
  return out;
}

}  // namespace thicklens::tools
