#include "calibration_summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>

#include "svg_plot.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;

bool UsableSigma(double sigma) { return std::isfinite(sigma) && sigma > 0; }

// Decimals that show two digits of sigma; the exponent is taken after rounding, so that 0.0996 is
// 0.10 with two decimals.
int DecimalsOf(double sigma) {
  const int exponent = std::stoi(fmt::format("{:.1e}", sigma).substr(4));
  return std::clamp(1 - exponent, 0, 12);
}

// What a rejection is about: its words before the numbers of the single frame.
std::string ReasonKind(const std::string& reason) {
  const std::string kind = reason.substr(0, reason.find_first_of("(:,;0123456789"));
  return kind.substr(0, kind.find_last_not_of(" -") + 1);
}

json Number(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }

json Number(const std::optional<double>& value) { return value ? Number(*value) : json(nullptr); }

// A meter that did not run leaves 0, which no meter measures.
json Measured(double value) { return value == 0 ? json(nullptr) : Number(value); }

json ResultJson(const std::optional<calib::Result>& result) {
  if (!result || (!std::isfinite(result->value) && !result->systematic)) return nullptr;
  json out = {{"value", Number(result->value)}, {"sigma", Number(result->sigma)}};
  out["systematic"] = nullptr;
  if (result->systematic && result->systematic->allFinite())
    out["systematic"] = json::array({result->systematic->x(), result->systematic->y()});
  return out;
}

// A value of the source's recipe, which has no error estimate.
json SourceResultJson(const std::optional<double>& value) {
  if (!value || !std::isfinite(*value)) return nullptr;
  return {{"value", *value}, {"sigma", nullptr}, {"systematic", nullptr}};
}

json StatisticsJson(const calib::FrameStatistics& statistics) {
  return {{"mean_stored", Number(statistics.mean_stored)},
          {"mean_linear", Number(statistics.mean_linear)},
          {"contrast", Number(statistics.contrast)},
          {"noise_sigma", Number(statistics.noise_sigma)},
          {"top_gradient_per_px", Number(statistics.top_gradient)},
          {"saturated_fraction", Number(statistics.saturated_fraction)},
          {"saturation_level", Number(statistics.saturation_level)}};
}

json FrameJson(const calib::FrameMeasurement& frame) {
  const bool has_blur = frame.blur_sigma_error_px != 0;
  return {
      {"image", PrintableUtf8(frame.image)},
      {"reading_mm", Number(frame.reading_mm)},
      {"depth_mm", Measured(frame.depth_mm)},
      {"rejection", frame.rejection.empty() ? json(nullptr) : json(PrintableUtf8(frame.rejection))},
      {"statistics", StatisticsJson(frame.statistics)},
      {"mean_edge_slope_per_px", Measured(frame.mean_edge_slope)},
      {"normalised_edge_slope_per_px", Measured(frame.normalised_edge_slope)},
      {"edge_count", frame.edge_count},
      {"source_blur_sigma_px", Measured(frame.source_blur_sigma_px)},
      {"blur_sigma_px", has_blur ? Number(frame.blur_sigma_px) : json(nullptr)},
      {"blur_sigma_error_px", has_blur ? Number(frame.blur_sigma_error_px) : json(nullptr)},
      {"in_blur_fit", frame.in_blur_fit},
      {"blur_fit_weight", Number(frame.blur_fit_weight)},
      {"image_scale", Number(frame.image_scale)},
      {"in_scale_fit", frame.in_scale_fit}};
}

std::optional<std::string> ImageOf(const calib::Calibration& calibration, int index) {
  if (index < 0 || index >= static_cast<int>(calibration.frames.size())) return std::nullopt;
  return PrintableUtf8(calibration.frames[static_cast<std::size_t>(index)].image);
}

json ImageJson(const calib::Calibration& calibration, int index) {
  const std::optional<std::string> image = ImageOf(calibration, index);
  return image ? json(*image) : json(nullptr);
}

json SourceJson(const calib::Calibration& calibration, const std::vector<ResultRow>& rows) {
  json out = {{"done", calibration.source.done},
              {"message", PrintableUtf8(calibration.source.message)},
              {"sharpest_image", ImageJson(calibration, calibration.source.sharpest_frame)},
              {"ratio_frames", calibration.source.ratio_frames}};
  for (const ResultRow& row : rows)
    if (row.source || row.key == "image_distance_mm" || row.key == "focus_depth_mm" ||
        row.key == "blur_ratio")
      out[row.key] = SourceResultJson(row.source);
  return out;
}

json SharpnessPeakJson(const calib::Calibration& calibration, const std::vector<ResultRow>& rows) {
  const calib::SharpnessPeak& peak = calibration.sharpness;
  json out = {{"done", peak.done},
              {"message", PrintableUtf8(peak.message)},
              {"frames_used", peak.frames_used}};
  for (const ResultRow& row : rows)
    if (row.key == "focus_depth_mm") out[row.key] = ResultJson(row.peak);
  out["fitted_depths_mm"] = nullptr;
  if (peak.done)
    out["fitted_depths_mm"] = json::array({Number(peak.from_depth_mm), Number(peak.to_depth_mm)});
  return out;
}

json ScaleLawJson(const calib::Calibration& calibration) {
  const calib::ScaleLaw& scale = calibration.scale;
  const bool done = scale.done;
  return {{"done", done},
          {"message", PrintableUtf8(scale.message)},
          {"reference_image", ImageJson(calibration, scale.reference_frame)},
          {"offset_mm", done ? ResultJson(scale.offset_mm) : json(nullptr)},
          {"reference_depth_mm", done ? Number(scale.reference_depth_mm) : json(nullptr)},
          {"reading_rms_mm", done ? Number(scale.reading_rms_mm) : json(nullptr)},
          {"frames_used", scale.frames_used}};
}

json CovarianceJson(const calib::Calibration& calibration) {
  if (calibration.covariance_order.empty() || calibration.covariance.size() == 0) return nullptr;
  json rows = json::array();
  for (Eigen::Index i = 0; i < calibration.covariance.rows(); ++i) {
    json row = json::array();
    for (Eigen::Index j = 0; j < calibration.covariance.cols(); ++j)
      row.push_back(Number(calibration.covariance(i, j)));
    rows.push_back(std::move(row));
  }
  return {{"order", calibration.covariance_order}, {"rows", std::move(rows)}};
}

json TruthJson(const std::vector<ResultRow>& rows) {
  json fit = json::object(), source = json::object(), peak = json::object(), out;
  for (const ResultRow& row : rows) {
    out[row.key] = Number(row.truth);
    if (!row.truth) continue;
    if (row.fit) fit[row.key] = Number(row.fit->value - *row.truth);
    if (row.source) source[row.key] = Number(*row.source - *row.truth);
    if (row.peak) peak[row.key] = Number(row.peak->value - *row.truth);
  }
  out["errors"] = {{"fit", fit}, {"source", source}, {"sharpness_peak", peak}};
  return out;
}

// A table of text: the first column to the left, the others to the right, two spaces between.
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
  rows.push_back({"", "source's recipe", "fit +- sigma", "systematic interval"});
  if (has_truth)
    for (const char* name : {"truth", "fit - truth", "source - truth"})
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
      // Without a sigma it was not fitted: given, or taken for granted within the interval.
      row[2] = !std::isfinite(result.fit->value) ? std::string("not determined")
               : UsableSigma(sigma) ? fmt::format("{} +- {}", RoundedTo(result.fit->value, sigma),
                                                  RoundedSigma(sigma))
                                    : fmt::format("{} (held)", RoundedTo(result.fit->value, sigma));
      if (result.fit->systematic)
        row[3] = fmt::format("{} .. {}", RoundedTo(result.fit->systematic->x(), sigma),
                             RoundedTo(result.fit->systematic->y(), sigma));
    }
    if (has_truth) {
      row.push_back(rounded(result.truth));
      std::string error = "-";
      if (result.truth && result.fit && std::isfinite(result.fit->value)) {
        error = SignedRoundedTo(result.fit->value - *result.truth, sigma);
        if (UsableSigma(sigma))
          error += fmt::format(" ({:+.1f} sigma)", (result.fit->value - *result.truth) / sigma);
      }
      row.push_back(error);
      row.push_back(result.truth && result.source
                        ? SignedRoundedTo(*result.source - *result.truth, sigma)
                        : "-");
    }
    rows.push_back(std::move(row));
  }
  return AlignedTable(rows);
}

std::string RejectionLine(const calib::Calibration& calibration, const RejectionRun& run) {
  const std::string first = ImageOf(calibration, run.first).value_or("");
  const std::string last = ImageOf(calibration, run.last).value_or("");
  const std::string reason = PrintableUtf8(run.reason);
  if (run.first == run.last) return fmt::format("  {}: {}\n", FrameName(first), reason);
  return fmt::format("  {} .. {} ({} frames): {}{}\n", FrameName(first), FrameName(last),
                     run.last - run.first + 1, reason,
                     run.identical ? "" : " [the first frame's numbers]");
}

std::string SecondaryLines(const calib::Calibration& calibration,
                           const std::vector<ResultRow>& rows) {
  std::string text;
  const calib::SourceRecipe& source = calibration.source;
  text +=
      source.done
          ? fmt::format("source's recipe: sharpest frame {}, blur ratio from {} frames\n",
                        FrameName(ImageOf(calibration, source.sharpest_frame).value_or("unknown")),
                        source.ratio_frames)
          : fmt::format("source's recipe: none, {}\n", PrintableUtf8(source.message));
  for (const ResultRow& row : rows) {
    if (row.key != "focus_depth_mm") continue;
    if (!row.peak) {
      text += fmt::format("normalised sharpness: no peak, {}\n",
                          PrintableUtf8(calibration.sharpness.message));
      continue;
    }
    text += fmt::format("normalised sharpness: peak at {} +- {} mm, {} frames",
                        RoundedTo(row.peak->value, row.peak->sigma), RoundedSigma(row.peak->sigma),
                        calibration.sharpness.frames_used);
    if (row.truth)
      text += fmt::format(", error {} mm",
                          SignedRoundedTo(row.peak->value - *row.truth, row.peak->sigma));
    text += '\n';
  }
  const calib::ScaleLaw& scale = calibration.scale;
  text += scale.done
              ? fmt::format(
                    "image scale: bench offset {} +- {} mm, readings {:.2g} mm rms about the law, "
                    "{} frames\n",
                    RoundedTo(scale.offset_mm.value, scale.offset_mm.sigma),
                    RoundedSigma(scale.offset_mm.sigma), scale.reading_rms_mm, scale.frames_used)
              : fmt::format("image scale: no law, {}\n", PrintableUtf8(scale.message));
  const calib::BlurFit& blur = calibration.blur;
  text += blur.done ? fmt::format("blur fit: chi2/dof {:.2f}, {} frames\n", blur.chi2_per_dof,
                                  blur.frames_used)
                    : fmt::format("blur fit: none, {}\n", PrintableUtf8(blur.message));
  for (const std::string& name : blur.undetermined)
    text += fmt::format("blur fit: the data do not determine {}\n", PrintableUtf8(name));
  return text;
}

}  // namespace

std::vector<ResultRow> ResultRows(const calib::Calibration& calibration,
                                  const model::SweepTruth* truth) {
  std::vector<ResultRow> rows(5);
  rows[0] = {
      "image_distance_mm", "image distance d1", "mm", calibration.image_distance_mm, {}, {}, {}};
  rows[1] = {"focus_depth_mm", "depth of focus zf", "mm", calibration.focus_depth_mm, {}, {}, {}};
  rows[2] = {"blur_ratio", "blur ratio kappa", "", calibration.blur_ratio, {}, {}, {}};
  rows[3] = {"blur_floor_px", "blur floor", "px", calibration.blur_floor_px, {}, {}, {}};
  rows[4] = {"bench_offset_mm", "bench offset", "mm", calibration.bench_offset_mm, {}, {}, {}};
  if (calibration.source.done) {
    rows[0].source = calibration.source.image_distance_mm;
    rows[1].source = calibration.source.focus_depth_mm;
    rows[2].source = calibration.source.blur_ratio;
  }
  if (calibration.sharpness.done)
    rows[1].peak = calib::Result{calibration.sharpness.focus_depth_mm,
                                 calibration.sharpness.sigma_mm, std::nullopt};
  if (truth != nullptr) {
    rows[0].truth = truth->image_distance_mm;
    rows[1].truth = truth->focus_depth_mm;
    rows[2].truth = truth->blur_ratio;
    rows[3].truth = truth->blur_floor_px;
    rows[4].truth = truth->bench_offset_mm;
  }
  return rows;
}

std::vector<RejectionRun> RejectionRuns(const std::vector<calib::FrameMeasurement>& frames) {
  std::vector<RejectionRun> runs;
  for (int i = 0; i < static_cast<int>(frames.size()); ++i) {
    const std::string& reason = frames[static_cast<std::size_t>(i)].rejection;
    if (reason.empty()) continue;
    if (!runs.empty() && runs.back().last == i - 1 &&
        ReasonKind(runs.back().reason) == ReasonKind(reason)) {
      runs.back().last = i;
      runs.back().identical = runs.back().identical && reason == runs.back().reason;
    } else {
      runs.push_back({i, i, reason, true});
    }
  }
  return runs;
}

std::string FrameName(const std::string& image) {
  const std::string name = std::filesystem::path(image).filename().string();
  return PrintableUtf8(name.empty() ? image : name);
}

std::string RoundedTo(double value, double sigma) {
  if (!std::isfinite(value)) return fmt::format("{}", value);
  std::string text = UsableSigma(sigma) ? fmt::format("{:.{}f}", value, DecimalsOf(sigma))
                                        : fmt::format("{:.5g}", value);
  // No "-0.00": the sign of what is rounded away says nothing.
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

std::string CalibrationText(const calib::FocusSweep& sweep, const calib::Calibration& calibration,
                            const model::SweepTruth* truth) {
  const std::vector<ResultRow> rows = ResultRows(calibration, truth);
  const auto rejected =
      std::count_if(calibration.frames.begin(), calibration.frames.end(),
                    [](const calib::FrameMeasurement& frame) { return !frame.rejection.empty(); });
  std::string text =
      fmt::format("camera {}, {} frames: {} used, {} rejected\n", PrintableUtf8(sweep.camera.name),
                  sweep.frames.size(), calibration.frames_used, rejected);
  for (const RejectionRun& run : RejectionRuns(calibration.frames))
    text += RejectionLine(calibration, run);
  text += '\n';
  if (std::any_of(rows.begin(), rows.end(),
                  [](const ResultRow& row) { return row.fit || row.source || row.peak; }))
    text += ResultTable(rows, truth != nullptr) + '\n';
  text += SecondaryLines(calibration, rows);
  for (const std::string& warning : calibration.warnings)
    text += fmt::format("warning: {}\n", PrintableUtf8(warning));
  text += calibration.outcome == calib::Outcome::kOk
              ? fmt::format("{}", calib::OutcomeName(calibration.outcome))
              : fmt::format("{}: {}", calib::OutcomeName(calibration.outcome),
                            PrintableUtf8(calibration.reason));
  text += fmt::format(" ({:.1f} s)\n", calibration.seconds);
  return text;
}

json CalibrationJson(const calib::FocusSweep& sweep, const calib::Calibration& calibration,
                     const model::SweepTruth* truth, bool use_source_recipe) {
  const std::vector<ResultRow> rows = ResultRows(calibration, truth);
  json out;
  if (use_source_recipe) {
    const bool done = calibration.source.done;
    out["status"] = done ? "ok" : "refused";
    out["reason"] = done ? "" : PrintableUtf8(calibration.source.message);
  } else {
    const bool ok = calibration.outcome == calib::Outcome::kOk;
    out["status"] = calib::OutcomeName(calibration.outcome);
    out["reason"] = ok ? "" : PrintableUtf8(calibration.reason);
  }
  out["method"] = use_source_recipe ? "source" : "fit";
  json fit;
  for (const ResultRow& row : rows) {
    fit[row.key] = ResultJson(row.fit);
    out[row.key] = use_source_recipe ? SourceResultJson(row.source) : fit[row.key];
  }
  out["frames_used"] = calibration.frames_used;
  out["frames_rejected"] = json::array();
  out["frames"] = json::array();
  for (const calib::FrameMeasurement& frame : calibration.frames) {
    if (!frame.rejection.empty())
      out["frames_rejected"].push_back(
          {{"image", PrintableUtf8(frame.image)}, {"reason", PrintableUtf8(frame.rejection)}});
    out["frames"].push_back(FrameJson(frame));
  }
  out["chi2_per_dof"] =
      calibration.blur.done ? Number(calibration.blur.chi2_per_dof) : json(nullptr);
  out["other_methods"] = {{"source", SourceJson(calibration, rows)},
                          {"sharpness_peak", SharpnessPeakJson(calibration, rows)}};
  if (use_source_recipe) {
    fit["status"] = calib::OutcomeName(calibration.outcome);
    fit["reason"] =
        calibration.outcome == calib::Outcome::kOk ? "" : PrintableUtf8(calibration.reason);
    out["other_methods"]["fit"] = std::move(fit);
  }
  out["seconds"] = Number(calibration.seconds);
  out["camera"] = PrintableUtf8(sweep.camera.name);
  out["warnings"] = json::array();
  for (const std::string& warning : calibration.warnings)
    out["warnings"].push_back(PrintableUtf8(warning));
  out["undetermined"] = calibration.blur.undetermined;
  out["covariance"] = CovarianceJson(calibration);
  out["scale_law"] = ScaleLawJson(calibration);
  if (truth != nullptr) out["truth"] = TruthJson(rows);
  return out;
}

}  // namespace thicklens::tools
