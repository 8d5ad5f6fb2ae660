#include "tools/report/calibration_summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>

#include "thicklens/base/printable_text.h"
#include "thicklens/calib/error_budget.h"
#include "tools/report/calibration_answers.h"
#include "tools/report/calibration_text.h"
#include "tools/report/determined.h"
#include "tools/report/grid_words.h"
#include "tools/report/rejection_words.h"
#include "tools/report/target_words.h"

namespace thicklens::tools {
namespace {

constexpr char kNotRun[] = "not run";
constexpr char kHeld[] = "(held)";         // beside a value that was not fitted
constexpr std::size_t kReportedTerms = 4;  // of the error in the text; the rest is in the JSON

std::optional<std::string> ImageOf(const calib::Calibration& calibration, int index) {
  if (index < 0 || index >= static_cast<int>(calibration.frames.size())) return std::nullopt;
  return PrintableUtf8(calibration.frames[static_cast<std::size_t>(index)].image);
}

// A table of text with the first column aligned left, the others right, and two spaces between.
std::string AlignedTable(const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> widths;
  for (const std::vector<std::string>& row : rows) {
    widths.resize(std::max(widths.size(), row.size()), 0);
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  std::string text;
  for (const std::vector<std::string>& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i)
      text += i == 0 ? fmt::format("{:<{}}", row[i], widths[i])
                     : fmt::format("  {:>{}}", row[i], widths[i]);
    text += '\n';
  }
  return text;
}

std::string ResultTable(const std::vector<ResultRow>& results, bool has_truth) {
  std::vector<std::vector<std::string>> rows;
  rows.push_back({"", "paper's recipe", "fit +- sigma", "systematic interval"});
  if (has_truth)
    for (const char* name : {"truth", "fit - truth", "paper - truth"})
      rows.back().emplace_back(name);
  for (const ResultRow& result : results) {
    const double sigma = result.fit ? result.fit->sigma : 0;
    const auto rounded = [&](const std::optional<double>& value) {
      return value ? RoundedTo(*value, sigma) : std::string("-");
    };
    std::vector<std::string> row = {
        result.unit.empty() ? result.label : fmt::format("{} [{}]", result.label, result.unit),
        rounded(result.source), "-", "-"};
    if (result.fit) {
      // A value without a sigma was not fitted: it was given, or assumed within the interval.
      row[2] =
          !std::isfinite(result.fit->value) ? std::string("not determined")
          : UsableSigma(sigma)
              ? fmt::format("{} +- {}", RoundedTo(result.fit->value, sigma), RoundedSigma(sigma))
              : fmt::format("{} {}", RoundedTo(result.fit->value, sigma), kHeld);
      if (result.fit->systematic)
        row[3] = fmt::format("{} .. {}", RoundedTo(result.fit->systematic->x(), sigma),
                             RoundedTo(result.fit->systematic->y(), sigma));
    }
    if (has_truth) {
      row.push_back(rounded(result.truth));
      std::string error = "-";
      if (result.truth && result.fit && std::isfinite(result.fit->value)) {
        const double off = result.fit->value - *result.truth;
        const auto& interval = result.fit->systematic;
        const bool is_within =
            interval && interval->x() <= *result.truth && *result.truth <= interval->y();
        error = SignedRoundedTo(off, sigma);
        // sigma is only the statistical part.
        if (is_within && std::abs(off) > 2 * sigma) {
          error += " (within the interval)";
        } else if (UsableSigma(sigma)) {
          error += fmt::format(" ({:+.1f} sigma)", off / sigma);
        }
      }
      row.push_back(error);
      row.push_back(result.truth && result.source
                        ? SignedRoundedTo(*result.source - *result.truth, sigma)
                        : "-");
    }
    rows.push_back(std::move(row));
  }
  std::string text = AlignedTable(rows);
  if (text.find(kHeld) != std::string::npos)
    text += fmt::format("{}: stated or assumed, and not fitted\n", kHeld);
  return text;
}

void AddLine(const char* about, const std::string& line, std::string* text) {
  if (!line.empty()) *text += fmt::format("{}: {}\n", about, PrintableUtf8(line));
}

// The five answers, one line each, and an empty line behind them.
std::string AnswersText(const calib::FocusSweep& sweep, const calib::Calibration& calibration) {
  const CalibrationAnswers answers = AnswersOf(sweep, calibration);
  std::string text;
  AddLine("focus", answers.focus, &text);
  AddLine("blur", answers.blur, &text);
  AddLine("trust", answers.trust, &text);
  AddLine("largest error", answers.error, &text);
  AddLine("next", answers.next, &text);
  return text + '\n';
}

std::string SecondaryLines(const calib::Calibration& calibration,
                           const std::vector<ResultRow>& rows) {
  std::string text;
  const calib::SourceRecipe& source = calibration.diagnostics.paper_recipe;
  text +=
      source.done
          ? fmt::format("paper's recipe: zf is the depth of {}, blur ratio from {} frames\n",
                        FrameName(ImageOf(calibration, source.sharpest_frame).value_or("unknown")),
                        source.ratio_frames)
          : fmt::format("paper's recipe: none, {}\n", PrintableUtf8(source.message));
  for (const ResultRow& row : rows) {
    if (row.key != "focus_depth_mm") continue;
    if (!row.peak) {
      text += fmt::format("normalised sharpness: no peak, {}\n",
                          PrintableUtf8(calibration.diagnostics.sharpness.message));
      continue;
    }
    text += fmt::format("normalised sharpness: peak at {} +- {} mm, {} frames",
                        RoundedTo(row.peak->value, row.peak->sigma), RoundedSigma(row.peak->sigma),
                        calibration.diagnostics.sharpness.frames_used);
    if (row.truth)
      text += fmt::format(", error {} mm",
                          SignedRoundedTo(row.peak->value - *row.truth, row.peak->sigma));
    text += '\n';
  }
  AddLine("sharpest", SharpestLine(calibration), &text);
  AddLine("bench offset", OffsetOriginLine(calibration), &text);
  const calib::ScaleModel& scale = calibration.diagnostics.scale;
  if (!scale.done) AddLine("image scale", ScaleChangeLine(scale), &text);
  text +=
      scale.done
          ? fmt::format(
                "image scale: bench offset {} +- {} mm, residual of the readings {:.2g} mm rms, "
                "{} frames\n",
                RoundedTo(scale.offset_mm.value, scale.offset_mm.sigma),
                RoundedSigma(scale.offset_mm.sigma), scale.reading_rms_mm, scale.frames_used)
          : fmt::format("image scale: no model, {}\n", PrintableUtf8(scale.message));
  const calib::BlurFit& blur = calibration.diagnostics.blur;
  AddLine("image scale", DistortionLine(scale), &text);
  AddLine("magnification", MagnificationLine(calibration), &text);
  for (const std::string& line : GridLines(calibration.diagnostics.grid))
    AddLine("grid", line, &text);
  AddLine("sheet", MarksLine(calibration), &text);
  text +=
      blur.done
          ? fmt::format("blur fit: chi2/dof {:.2f}, {} frames{}\n", blur.chi2_per_dof,
                        blur.frames_used, blur.estimator.empty() ? "" : ", by " + blur.estimator)
          : fmt::format("blur fit: none, {}\n", PrintableUtf8(WithNamesForKeys(blur.message)));
  for (const std::string& name : blur.undetermined)
    text += fmt::format("blur fit: the data do not determine {}\n",
                        PrintableUtf8(WithNamesForKeys(name)));
  AddLine("blur fit", WorstKnownLine(blur), &text);
  AddLine("blur fit", OutsideLine(blur), &text);
  return text;
}

// The additional findings of the frames: shape of the blur, sides, field, colours.
std::string DetailLines(const calib::FocusSweep& sweep, const calib::Calibration& calibration) {
  std::string text;
  AddLine("target", TargetLine(calibration.diagnostics.target), &text);
  AddLine("blur shape", ShapeLine(sweep, calibration.diagnostics.blur), &text);
  if (calibration.diagnostics.nearer.done || calibration.diagnostics.farther.done)
    AddLine("sides of focus", SidesLine(calibration), &text);
  for (const std::string& line : FieldLines(calibration.diagnostics.field))
    AddLine("field", line, &text);
  if (!calibration.diagnostics.field.done && calibration.diagnostics.field.message != kNotRun)
    AddLine("field", "no map, " + calibration.diagnostics.field.message, &text);
  AddLine("colours", ChannelLine(calibration.diagnostics.channels), &text);
  AddLine("fixed to the frame", PatternLine(calibration.diagnostics.fixed_pattern), &text);
  AddLine("camera response", ResponseLine(calibration.diagnostics.response), &text);
  const std::vector<calib::ErrorTerm> terms = calib::ErrorTerms(calibration);
  for (std::size_t i = 0; i < std::min(terms.size(), kReportedTerms); ++i) {
    const std::string errors = TermErrors(terms[i]);
    if (!errors.empty()) AddLine("error", fmt::format("{}: {}", terms[i].name, errors), &text);
  }
  if (calibration.summary.outcome == calib::Outcome::kRefused)
    for (const std::string& line : DiagnosisLines(calibration)) AddLine("compared", line, &text);
  return text;
}

}  // namespace

std::vector<ResultRow> ResultRows(const calib::Calibration& calibration,
                                  const model::SweepTruth* truth) {
  std::vector<ResultRow> rows(5);
  rows[0] = {"image_distance_mm",
             "image distance d1",
             "mm",
             calibration.summary.image_distance_mm,
             {},
             {},
             {}};
  rows[1] = {"focus_depth_mm",
             "in-focus object distance zf",
             "mm",
             calibration.summary.focus_depth_mm,
             {},
             {},
             {}};
  rows[2] = {"blur_ratio", "blur ratio kappa", "", calibration.summary.blur_ratio, {}, {}, {}};
  rows[3] = {"blur_floor_px", "blur floor", "px", calibration.summary.blur_floor_px, {}, {}, {}};
  rows[4] = {
      "bench_offset_mm", "bench offset", "mm", calibration.summary.bench_offset_mm, {}, {}, {}};
  if (model::MovesFocus(calibration.diagnostics.moves)) rows[4].label = "d1 at reading 0";
  if (calibration.diagnostics.paper_recipe.done) {
    rows[0].source = calibration.diagnostics.paper_recipe.image_distance_mm;
    rows[1].source = calibration.diagnostics.paper_recipe.focus_depth_mm;
    rows[2].source = calibration.diagnostics.paper_recipe.blur_ratio;
  }
  if (calibration.diagnostics.sharpness.done)
    rows[1].peak = calib::Result{calibration.diagnostics.sharpness.focus_depth_mm,
                                 calibration.diagnostics.sharpness.sigma_mm, std::nullopt};
  if (truth != nullptr) {
    rows[0].truth = truth->image_distance_mm;
    rows[1].truth = truth->focus_depth_mm;
    rows[2].truth = truth->blur_ratio;
    rows[3].truth = truth->blur_floor_px;
    rows[4].truth = truth->bench_offset_mm;
  }
  return rows;
}

std::string FrameName(const std::string& image) {
  const std::string name = std::filesystem::path(image).filename().string();
  return PrintableUtf8(name.empty() ? image : name);
}

std::string CalibrationText(const calib::FocusSweep& sweep, const calib::Calibration& calibration,
                            const model::SweepTruth* truth, const std::string& camera_file) {
  const std::vector<ResultRow> rows = ResultRows(calibration, truth);
  std::string text = AnswersText(sweep, calibration);
  text +=
      fmt::format("camera {}, {}\n", PrintableUtf8(sweep.camera.name), FrameCountText(calibration));
  for (const std::string& line : LeftOutLines(calibration)) text += fmt::format("  {}\n", line);
  text += RejectionLines(calibration.frames) + '\n';
  if (std::any_of(rows.begin(), rows.end(),
                  [](const ResultRow& row) { return row.fit || row.source || row.peak; }))
    text += ResultTable(rows, truth != nullptr) + '\n';
  text += SecondaryLines(calibration, rows) + DetailLines(sweep, calibration);
  for (const std::string& warning : calibration.summary.warnings)
    text += fmt::format("warning: {}\n", PrintableUtf8(warning));
  text += fmt::format("{} ({:.1f} s)\n", PrintableUtf8(OutcomeLine(calibration, camera_file)),
                      calibration.summary.seconds);
  return text;
}

}  // namespace thicklens::tools
