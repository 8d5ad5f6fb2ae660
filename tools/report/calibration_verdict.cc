#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "thicklens/base/printable_text.h"
#include "tools/report/calibration_sections.h"
#include "tools/report/calibration_text.h"
#include "tools/report/determined.h"
#include "tools/report/rounding.h"
#include "tools/report/target_words.h"

namespace thicklens::tools {
namespace {

using calib::Calibration;
using calib::FocusSweep;

// The share of the sigma of the in-focus distance from which the bench offset counts as dominant.
constexpr double kDominantShare = 0.7;

std::string Paragraph(const std::string& text) {
  return text.empty() ? "" : fmt::format("<p>{}</p>\n", EscapeXml(text));
}

std::string FoundInWords(const Calibration& calibration) {
  std::vector<std::string> found;
  if (calibration.summary.image_distance_mm)
    found.push_back(fmt::format("image distance d1 = {} mm",
                                WithSigma(*calibration.summary.image_distance_mm)));
  if (calibration.summary.focus_depth_mm)
    found.push_back(fmt::format("in-focus distance zf = {} mm",
                                WithSigma(*calibration.summary.focus_depth_mm)));
  if (calibration.summary.blur_ratio)
    found.push_back(fmt::format("blur ratio κ = {}", WithSigma(*calibration.summary.blur_ratio)));
  if (found.empty()) return "";
  return fmt::format("Found: {}, from {} of {} frames{}.", fmt::join(found, ", "),
                     calibration.summary.frames_used, calibration.frames.size(),
                     calibration.diagnostics.blur.done
                         ? fmt::format(", χ²/dof {:.2f} (1 is expected)",
                                       calibration.diagnostics.blur.chi2_per_dof)
                         : "");
}

// Describes what limits the accuracy of the in-focus distance, noise or the systematic interval,
// and what would help, unless the calibration itself gives advice.
std::string LimitInWords(const FocusSweep& sweep, const Calibration& calibration) {
  if (!calibration.summary.focus_depth_mm) return "";
  const calib::Result& focus = *calibration.summary.focus_depth_mm;
  if (!focus.systematic || !focus.systematic->allFinite() || !(focus.sigma > 0)) return "";
  const double half_mm =
      std::max(focus.systematic->y() - focus.value, focus.value - focus.systematic->x());
  const bool zero_dominates =
      calibration.summary.bench_offset_mm &&
      calibration.summary.bench_offset_mm->sigma > kDominantShare * focus.sigma;
  const std::string numbers = fmt::format(
      "{} an uncertainty of ±{} mm in the in-focus distance, the systematic interval one of up to "
      "{:.2g} mm.",
      zero_dominates ? "the bench offset leaves" : "noise and readings leave",
      RoundedSigma(focus.sigma), half_mm);
  std::string text, help;
  if (half_mm > 2 * focus.sigma) {
    text = "Systematic errors dominate: ";
    help = fmt::format(
        " More frames would not help; {}both sides of focus and tighter tolerances would.",
        sweep.floor.given_px ? "" : "a blur floor measured on a knife edge, ");
  } else if (half_mm < 0.5 * focus.sigma) {
    text = "Statistical errors dominate: ";
    help = zero_dominates ? " Measuring offset_mm, or a longer sweep, would help."
                          : " More frames, more light or better readings would help.";
  } else {
    text = zero_dominates ? "Bench offset and systematic errors contribute alike: "
                          : "Noise and systematic errors contribute alike: ";
  }
  return text + numbers + (calibration.diagnostics.advice.empty() ? help : "");
}

// Describes what does not depend on the bench offset or the camera: most users want to know it
// first, and it is the only result if everything else is refused.
std::string DeterminedInWords(const Calibration& calibration) {
  std::string html;
  const auto add = [&html](const std::string& about, const std::string& line) {
    if (!line.empty()) html += Paragraph(Typeset(AsSentence(about + line)));
  };
  if (calibration.diagnostics.sharpest.done)
    add("The sweep is sharpest at the ", SharpestLine(calibration));
  add("Focus lies at the ", FocusReadingLine(calibration));
  add("The bench offset is determined ", OffsetOriginLine(calibration));
  add("The target was ", TargetLine(calibration.diagnostics.target));
  add("", PatternLine(calibration.diagnostics.fixed_pattern));
  if (calibration.summary.outcome != calib::Outcome::kRefused) return html;
  add("", ScaleChangeLine(calibration.diagnostics.scale));
  add("", fmt::format("{} of {} frames can be used", calibration.summary.frames_used,
                      calibration.frames.size()));
  for (const std::string& line : DiagnosisLines(calibration)) add("Compared: ", line);
  return html;
}

std::string Outcome(const Calibration& calibration) {
  std::string text = OutcomeLine(calibration, "");
  text[0] = static_cast<char>(text[0] - 'a' + 'A');
  return text;
}

}  // namespace

std::string AsSentence(std::string text) {
  if (text.empty()) return text;
  if (text[0] >= 'a' && text[0] <= 'z') text[0] = static_cast<char>(text[0] - 'a' + 'A');
  if (text.back() != '.') text += '.';
  return text;
}

std::string VerdictSection(const FocusSweep& sweep, const Calibration& calibration) {
  std::string html = fmt::format("<div class=\"verdict {}\">\n<p class=\"outcome\">{}</p>\n",
                                 calib::OutcomeName(calibration.summary.outcome),
                                 EscapeXml(Typeset(Outcome(calibration))));
  if (!calibration.diagnostics.advice.empty())
    html += fmt::format("<p><b>What to do next:</b> {}</p>\n",
                        EscapeXml(Typeset(AsSentence(calibration.diagnostics.advice))));
  html += Paragraph(FoundInWords(calibration));
  html += DeterminedInWords(calibration);
  html += Paragraph(LimitInWords(sweep, calibration));
  const calib::BlurFit& blur = calibration.diagnostics.blur;
  html += Paragraph(AsSentence(OutsideLine(blur)));
  html += Paragraph(AsSentence(WorstKnownLine(blur)));
  html += Paragraph(AsSentence(Typeset(ShapeLine(sweep, blur))));
  html += "</div>\n";
  if (calibration.summary.warnings.empty()) return html;
  html += "<ul class=\"warnings\">\n";
  for (const std::string& warning : calibration.summary.warnings)
    html += fmt::format("<li>{}</li>\n", EscapeXml(Typeset(warning)));
  return html + "</ul>\n";
}

}  // namespace thicklens::tools
