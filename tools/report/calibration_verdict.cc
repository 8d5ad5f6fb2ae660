#include <fmt/format.h>

#include <utility>

#include "thicklens/base/printable_text.h"
#include "tools/report/calibration_answers.h"
#include "tools/report/calibration_sections.h"
#include "tools/report/calibration_text.h"
#include "tools/report/determined.h"
#include "tools/report/rounding.h"
#include "tools/report/target_words.h"

namespace thicklens::tools {
namespace {

using calib::Calibration;
using calib::FocusSweep;

std::string Paragraph(const std::string& text) {
  return text.empty() ? "" : fmt::format("<p>{}</p>\n", EscapeXml(text));
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
  add("The bench offset is determined ", OffsetOriginLine(calibration));
  add("The target was ", TargetLine(calibration.diagnostics.target));
  add("", PatternLine(calibration.diagnostics.fixed_pattern));
  if (calibration.summary.outcome != calib::Outcome::kRefused) return html;
  add("", ScaleChangeLine(calibration.diagnostics.scale));
  for (const std::string& line : DiagnosisLines(calibration)) add("Compared: ", line);
  return html;
}

// The five answers, in the order in which they are asked.
std::string AnswersInWords(const FocusSweep& sweep, const Calibration& calibration) {
  const CalibrationAnswers answers = AnswersOf(sweep, calibration);
  std::string html;
  for (const auto& [question, answer] :
       {std::pair("Where is focus?", answers.focus), std::pair("What is the blur?", answers.blur),
        std::pair("Can I trust it?", answers.trust),
        std::pair("What is the largest error?", answers.error),
        std::pair("What next?", answers.next)}) {
    if (!answer.empty())
      html +=
          fmt::format("<p><b>{}</b> {}</p>\n", question, EscapeXml(Typeset(AsSentence(answer))));
  }
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
  html += AnswersInWords(sweep, calibration);
  html += Paragraph(AsSentence(FrameCountText(calibration)));
  html += DeterminedInWords(calibration);
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
