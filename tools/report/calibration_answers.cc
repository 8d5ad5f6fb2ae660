#include "tools/report/calibration_answers.h"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <optional>

#include "thicklens/base/printable_text.h"
#include "tools/report/calibration_text.h"
#include "tools/report/determined.h"
#include "tools/report/rounding.h"

namespace thicklens::tools {
namespace {

using calib::Calibration;

bool IsFound(const std::optional<calib::Result>& result) {
  return result && std::isfinite(result->value);
}

// "56.22 +- 0.62 mm (51.49 .. 62.14)".
std::string WithInterval(const calib::Result& result, const std::string& unit) {
  std::string text = WithError(result.value, result.sigma, unit);
  if (result.systematic && result.systematic->allFinite())
    text += fmt::format(" ({} .. {})", RoundedTo(result.systematic->x(), result.sigma),
                        RoundedTo(result.systematic->y(), result.sigma));
  return text;
}

std::string JoinedBy(const char* mark, const std::vector<std::string>& parts) {
  return fmt::format("{}", fmt::join(parts, mark));
}

std::string FocusAnswer(const Calibration& calibration) {
  const calib::CalibrationDiagnostics& found = calibration.diagnostics;
  const calib::CalibrationSummary& summary = calibration.summary;
  const char* unit = found.step_length_mm ? "steps" : "mm";
  std::vector<std::string> parts;
  if (found.focus_reading_mm) {
    parts.push_back("reading " +
                    WithError(found.focus_reading_mm->value, found.focus_reading_mm->sigma, unit));
  } else if (found.sharpest.done) {
    parts.push_back(fmt::format(
        "reading {} by sharpness alone",
        WithError(found.sharpest.reading_mm.value, found.sharpest.reading_mm.sigma, unit)));
  }
  if (IsFound(summary.focus_depth_mm))
    parts.push_back("in-focus object distance zf = " + WithInterval(*summary.focus_depth_mm, "mm"));
  if (IsFound(summary.image_distance_mm))
    parts.push_back("image distance d1 = " + WithInterval(*summary.image_distance_mm, "mm"));
  return JoinedBy("; ", parts);
}

std::string BlurAnswer(const Calibration& calibration) {
  const calib::CalibrationDiagnostics& found = calibration.diagnostics;
  const calib::CalibrationSummary& summary = calibration.summary;
  std::vector<std::string> parts;
  if (IsFound(summary.blur_ratio))
    parts.push_back("blur ratio kappa = " + WithInterval(*summary.blur_ratio, ""));
  if (found.blur_slope_px_per_mm)
    parts.push_back(fmt::format(
        "it grows by {} per {}",
        WithError(found.blur_slope_px_per_mm->value, found.blur_slope_px_per_mm->sigma, "px"),
        found.step_length_mm ? "step" : "mm of reading"));
  if (IsFound(summary.blur_floor_px)) {
    parts.push_back("blur floor " + WithInterval(*summary.blur_floor_px, "px"));
  } else if (summary.blur_floor_px && summary.blur_floor_px->systematic) {
    parts.push_back(fmt::format("blur floor between {:.2g} and {:.2g} px",
                                summary.blur_floor_px->systematic->x(),
                                summary.blur_floor_px->systematic->y()));
  }
  return JoinedBy("; ", parts);
}

std::string TrustAnswer(const Calibration& calibration) {
  const calib::CalibrationSummary& summary = calibration.summary;
  const calib::BlurFit& blur = calibration.diagnostics.blur;
  if (summary.outcome == calib::Outcome::kRefused) return "no, the sweep was refused";
  std::string text;
  const std::size_t warnings = summary.warnings.size();
  if (!blur.done) {
    text = "there is no fit of the blur";
  } else {
    // Errors were widened where the frames deviate by more than theirs.
    const std::string widened = WidenedLine(blur);
    text = !widened.empty()
               ? widened
               : fmt::format("{} frames follow the blur law (chi2/dof {:.2f}, 1 is expected)",
                             blur.frames_used, blur.chi2_per_dof);
  }
  text = (warnings == 0 ? "yes: " : "with care: ") + text;
  if (summary.outcome == calib::Outcome::kPartial) text += "; " + summary.reason;
  if (warnings > 0)
    text += fmt::format("; {} warning{} below {} what the checks found", warnings,
                        warnings == 1 ? "" : "s", warnings == 1 ? "says" : "say");
  return text;
}

std::string ErrorAnswer(const std::vector<calib::ErrorTerm>& terms) {
  double all = 0;
  for (const calib::ErrorTerm& term : terms) all += term.effect;
  if (!(all > 0)) return "";
  const calib::ErrorTerm& largest = terms.front();
  return fmt::format("{} ({:.0f} % of the error): {}", calib::TermInWords(largest.name),
                     100 * largest.effect / all, TermErrors(largest));
}

std::string ChangeInWords(const char* name, const std::optional<calib::ExpectedChange>& change,
                          const char* unit, bool is_bound) {
  if (!change || !(change->now > 0) || change->afterwards >= 0.995 * change->now) return "";
  const double digits = 0.5 * change->afterwards;
  return fmt::format("{} +-{}{} now, +-{}{} {}", name, RoundedTo(change->now, digits), unit,
                     RoundedTo(change->afterwards, digits), unit,
                     is_bound ? "at most afterwards" : "expected afterwards");
}

std::string NextAnswer(const calib::NextMeasurement& next,
                       const std::vector<calib::ErrorTerm>& terms) {
  if (!next.done) return terms.empty() ? "" : next.message;
  std::string text = next.action;
  if (!next.larger_term.empty())
    text = fmt::format("no measurement makes {} smaller; against {} ({:.0f} %): {}",
                       calib::TermInWords(next.larger_term), calib::TermInWords(next.term),
                       100 * next.share, text);
  const bool is_bound = next.term != calib::kNoiseTerm && next.term != calib::kOffsetTerm;
  std::vector<std::string> changes;
  for (const std::string& change : {ChangeInWords("zf", next.focus_depth_mm, " mm", is_bound),
                                    ChangeInWords("kappa", next.blur_ratio, "", is_bound)}) {
    if (!change.empty()) changes.push_back(change);
  }
  if (!changes.empty()) text += fmt::format(" [95 %: {}]", JoinedBy("; ", changes));
  return text;
}

nlohmann::json FiniteValue(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

nlohmann::json ChangeJson(const std::optional<calib::ExpectedChange>& change) {
  if (!change) return nullptr;
  return {{"now", FiniteValue(change->now)}, {"afterwards", FiniteValue(change->afterwards)}};
}

}  // namespace

std::string TermErrors(const calib::ErrorTerm& term) {
  // A term below this, in mm or of kappa, is what two fits differ by in rounding.
  constexpr double kRounding = 1e-9;
  std::vector<std::string> parts;
  const auto add = [&parts](const char* name, double value, const char* unit) {
    if (value > kRounding)
      parts.push_back(fmt::format("{} +-{}{}", name, RoundedSigma(value), unit));
  };
  add("zf", term.focus_depth_mm, " mm");
  add("d1", term.image_distance_mm, " mm");
  add("kappa", term.blur_ratio, "");
  return JoinedBy(", ", parts);
}

CalibrationAnswers AnswersOf(const calib::FocusSweep& sweep, const Calibration& calibration) {
  const std::vector<calib::ErrorTerm> terms = calib::ErrorTerms(calibration);
  CalibrationAnswers answers;
  answers.focus = FocusAnswer(calibration);
  answers.blur = BlurAnswer(calibration);
  answers.trust = TrustAnswer(calibration);
  answers.error = ErrorAnswer(terms);
  answers.next = NextAnswer(calib::ProposeNext(sweep, calibration), terms);
  return answers;
}

std::string FrameCountText(const Calibration& calibration) {
  int rejected = 0, left_out = 0;
  for (const calib::FrameMeasurement& frame : calibration.frames) {
    if (!frame.rejection.empty()) {
      ++rejected;
    } else if (!frame.not_in_fit.empty()) {
      ++left_out;
    }
  }
  const auto count = static_cast<int>(calibration.frames.size());
  std::string text =
      fmt::format("{} frames: {} used, {} rejected", count, count - rejected - left_out, rejected);
  if (left_out > 0) text += fmt::format(", {} left out", left_out);
  return text;
}

std::vector<std::string> LeftOutLines(const Calibration& calibration) {
  std::map<std::string, int> counts;
  for (const calib::FrameMeasurement& frame : calibration.frames) {
    if (frame.rejection.empty() && !frame.not_in_fit.empty()) ++counts[frame.not_in_fit];
  }
  std::vector<std::string> lines;
  for (const auto& [reason, count] : counts)
    lines.push_back(fmt::format("left out of the fit ({} frame{}): {}", count,
                                count == 1 ? "" : "s", PrintableUtf8(reason)));
  return lines;
}

nlohmann::json ErrorTermsJson(const std::vector<calib::ErrorTerm>& terms) {
  nlohmann::json out = nlohmann::json::array();
  for (const calib::ErrorTerm& term : terms)
    out.push_back({{"name", PrintableUtf8(term.name)},
                   {"statistical", term.is_statistical},
                   {"focus_depth_mm", FiniteValue(term.focus_depth_mm)},
                   {"image_distance_mm", FiniteValue(term.image_distance_mm)},
                   {"blur_ratio", FiniteValue(term.blur_ratio)},
                   {"effect", FiniteValue(term.effect)},
                   {"remedy", PrintableUtf8(term.remedy)}});
  return out;
}

nlohmann::json NextMeasurementJson(const calib::NextMeasurement& next) {
  if (!next.done) return nullptr;
  return {
      {"term", PrintableUtf8(next.term)},
      {"larger_term", next.larger_term.empty() ? nlohmann::json(nullptr)
                                               : nlohmann::json(PrintableUtf8(next.larger_term))},
      {"share", next.share},
      {"action", PrintableUtf8(next.action)},
      {"focus_depth_mm", ChangeJson(next.focus_depth_mm)},
      {"blur_ratio", ChangeJson(next.blur_ratio)}};
}

}  // namespace thicklens::tools
