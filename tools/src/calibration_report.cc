#include "calibration_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>

#include "calibration_summary.h"
#include "page_style.h"
#include "svg_plot.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::tools {
namespace {

using calib::Calibration;
using calib::FocusSweep;
using calib::FrameMeasurement;

std::vector<double> Column(const std::vector<std::pair<double, double>>& points, bool first) {
  std::vector<double> column;
  column.reserve(points.size());
  for (const std::pair<double, double>& point : points)
    column.push_back(first ? point.first : point.second);
  return column;
}

PlotSeries Curve(std::string label, Ink ink, Stroke stroke,
                 const std::vector<std::pair<double, double>>& points) {
  PlotSeries series;
  series.label = std::move(label);
  series.ink = ink;
  series.mark = Mark::kNone;
  series.stroke = stroke;
  series.x = Column(points, true);
  series.y = Column(points, false);
  return series;
}

PlotSeries Points(std::string label, Ink ink, Mark mark) {
  PlotSeries series;
  series.label = std::move(label);
  series.ink = ink;
  series.mark = mark;
  return series;
}

void AddPoint(PlotSeries* series, double x, double y, std::string name) {
  series->x.push_back(x);
  series->y.push_back(y);
  series->names.push_back(std::move(name));
}

PlotLine Level(double position) {
  PlotLine line;
  line.ink = Ink::kMuted;
  line.stroke = position == 0 ? Stroke::kSolid : Stroke::kDotted;
  line.vertical = false;
  line.position = position;
  return line;
}

bool IsDepth(double depth_mm) { return std::isfinite(depth_mm) && depth_mm > 0; }

// Where a frame stands in the figures. Without a bench zero there are no depths; the readings then
// still show the shape of a curve.
struct Abscissa {
  bool is_depth = false;
  std::string label;

  double Of(const FrameMeasurement& frame) const {
    return is_depth ? frame.depth_mm : frame.reading_mm;
  }
};

Abscissa AbscissaOf(const Calibration& calibration) {
  int depths = 0;
  double lo = 0, hi = 0;
  for (const FrameMeasurement& frame : calibration.frames) {
    if (!IsDepth(frame.depth_mm)) continue;
    lo = depths == 0 ? frame.depth_mm : std::min(lo, frame.depth_mm);
    hi = depths == 0 ? frame.depth_mm : std::max(hi, frame.depth_mm);
    ++depths;
  }
  if (depths >= 2 && hi > lo) return {true, "object depth z from Ap [mm]"};
  return {false, "bench reading b [mm] (no depths: the bench zero is not known)"};
}

// Blur by the fitted law, sigma = sqrt(S0 + (kappa r_defocus/p)^2), px per axis, without the pixel
// box. Exact for all depths z > 0; at z = zf it is the floor.
class BlurLaw {
 public:
  // Nothing where the fit gave no image distance or no blur ratio.
  static std::optional<BlurLaw> Of(const FocusSweep& sweep, const Calibration& calibration) {
    if (!calibration.blur.done || !calibration.image_distance_mm || !calibration.blur_ratio)
      return std::nullopt;
    BlurLaw law(sweep, calibration.image_distance_mm->value, calibration.blur_ratio->value);
    const model::ThickLens& lens = sweep.camera.lens;
    const double d_mm = law.image_distance_mm_ - lens.lens_thickness_mm;
    if (!std::isfinite(law.blur_ratio_) || !(d_mm >= lens.rear_focal_length_mm))
      return std::nullopt;
    if (calibration.blur_floor_px && std::isfinite(calibration.blur_floor_px->value)) {
      law.floor_squared_px2_ = std::pow(calibration.blur_floor_px->value, 2);
    } else {
      law.floor_squared_px2_ = law.FloorSquaredFromFrames(calibration);
      law.floor_from_frames_ = true;
    }
    return law;
  }

  // The law that a simulated sweep was made with.
  static BlurLaw OfTruth(const FocusSweep& sweep, const model::SweepTruth& truth) {
    BlurLaw law(sweep, truth.image_distance_mm, truth.blur_ratio);
    law.floor_squared_px2_ = truth.blur_floor_px * truth.blur_floor_px;
    return law;
  }

  double SigmaPx(double depth_mm) const {
    return std::sqrt(floor_squared_px2_ + std::pow(DefocusPx(depth_mm), 2));
  }

  // d sigma/d z, px per mm: how an error of the reading goes into the blur. Central difference.
  double SlopePxPerMm(double depth_mm) const {
    const double step_mm = 1e-4 * depth_mm;
    return (SigmaPx(depth_mm + step_mm) - SigmaPx(depth_mm - step_mm)) / (2 * step_mm);
  }

  bool floor_from_frames() const { return floor_from_frames_; }

 private:
  BlurLaw(const FocusSweep& sweep, double image_distance_mm, double blur_ratio)
      : sweep_(&sweep), image_distance_mm_(image_distance_mm), blur_ratio_(blur_ratio) {}

  double DefocusPx(double depth_mm) const {
    return blur_ratio_ * model::BlurRadiusMm(sweep_->camera.lens, image_distance_mm_, depth_mm) /
           sweep_->camera.sensor.pixel_pitch_mm;
  }

  // Weighted mean of sigma^2 - (kappa r_defocus/p)^2: the floor that best continues the fit where
  // it gives none of its own. var(sigma^2) = (2 sigma)^2 var(sigma).
  double FloorSquaredFromFrames(const Calibration& calibration) const {
    double sum = 0, weight_sum = 0;
    for (const FrameMeasurement& frame : calibration.frames) {
      if (!frame.in_blur_fit || !IsDepth(frame.depth_mm) || !(frame.blur_sigma_error_px > 0) ||
          !(frame.blur_sigma_px > 0))
        continue;
      const double sd_px2 = 2 * frame.blur_sigma_px * frame.blur_sigma_error_px;
      const double weight = frame.blur_fit_weight / (sd_px2 * sd_px2);
      sum += weight * (std::pow(frame.blur_sigma_px, 2) - std::pow(DefocusPx(frame.depth_mm), 2));
      weight_sum += weight;
    }
    return weight_sum > 0 ? std::max(0.0, sum / weight_sum) : 0;
  }

  const FocusSweep* sweep_;
  double image_distance_mm_ = 0;
  double blur_ratio_ = 0;
  double floor_squared_px2_ = 0;
  bool floor_from_frames_ = false;
};

bool HasBlur(const FrameMeasurement& frame) { return frame.blur_sigma_error_px > 0; }

std::string PointName(const FrameMeasurement& frame, const Abscissa& abscissa,
                      const std::string& quantity, double value) {
  return fmt::format("{}: {} = {:.6g} mm, {} = {:.4g}{}", FrameName(frame.image),
                     abscissa.is_depth ? "z" : "b", abscissa.Of(frame), quantity, value,
                     frame.rejection.empty() ? "" : ", rejected: " + frame.rejection);
}

// Vertical lines at the plane of focus by each method.
std::vector<PlotLine> FocusLines(const std::vector<ResultRow>& rows) {
  std::vector<PlotLine> lines;
  for (const ResultRow& row : rows) {
    if (row.key != "focus_depth_mm") continue;
    const double sigma = row.fit ? row.fit->sigma : 0;
    const auto add = [&](const std::string& who, Ink ink, Stroke stroke, double zf_mm, double sd) {
      if (!std::isfinite(zf_mm)) return;
      lines.push_back(
          {fmt::format("zf, {}: {} mm", who, RoundedTo(zf_mm, sd)), ink, stroke, true, zf_mm});
    };
    if (row.source) add("source's recipe", Ink::kSource, Stroke::kDotted, *row.source, sigma);
    if (row.peak)
      add("sharpness peak", Ink::kPeak, Stroke::kDashed, row.peak->value, row.peak->sigma);
    if (row.fit) add("blur fit", Ink::kFit, Stroke::kSolid, row.fit->value, sigma);
    if (row.truth) add("truth", Ink::kTruth, Stroke::kDashed, *row.truth, sigma);
  }
  return lines;
}

// The figures in the order in which they are added, numbered.
class Figures {
 public:
  void Add(const std::vector<Plot>& plots, const std::string& caption) {
    html_ += "<figure>\n";
    for (const Plot& plot : plots) html_ += SvgPlot(plot);
    html_ += fmt::format("<figcaption><b>Figure {}.</b> {}</figcaption>\n</figure>\n", ++count_,
                         EscapeXml(caption));
  }
  const std::string& html() const { return html_; }

 private:
  std::string html_;
  int count_ = 0;
};

void AddSharpnessFigure(const Calibration& calibration, const std::vector<ResultRow>& rows,
                        const Abscissa& abscissa, Figures* figures) {
  double raw_max = 0, normalised_max = 0;
  int shown = 0;
  for (const FrameMeasurement& frame : calibration.frames) {
    if (!frame.rejection.empty()) continue;
    raw_max = std::max(raw_max, frame.mean_edge_slope);
    normalised_max = std::max(normalised_max, frame.normalised_edge_slope);
    if (frame.normalised_edge_slope > 0) ++shown;
  }
  if (shown < 2 || !(raw_max > 0)) return;

  Plot plot;
  plot.id = "sharpness";
  plot.title = "Sharpness against depth";
  plot.x_axis.label = abscissa.label;
  plot.y_axis.label = "sharpness / its maximum";
  PlotSeries raw = Points("MES, raw", Ink::kSource, Mark::kRing);
  PlotSeries normalised = Points("MES over mean grey", Ink::kPeak, Mark::kDot);
  for (const FrameMeasurement& frame : calibration.frames) {
    if (!frame.rejection.empty() || !(frame.mean_edge_slope > 0)) continue;
    AddPoint(&raw, abscissa.Of(frame), frame.mean_edge_slope / raw_max,
             PointName(frame, abscissa, "raw MES per px", frame.mean_edge_slope));
    AddPoint(&normalised, abscissa.Of(frame), frame.normalised_edge_slope / normalised_max,
             PointName(frame, abscissa, "normalised MES per px", frame.normalised_edge_slope));
  }
  plot.series = {std::move(raw), std::move(normalised)};
  const calib::SharpnessPeak& peak = calibration.sharpness;
  if (peak.done && abscissa.is_depth && peak.reference_depth_mm > 0) {
    std::vector<std::pair<double, double>> curve;
    for (int i = 0; i <= 100; ++i) {
      const double z_mm = peak.from_depth_mm + (peak.to_depth_mm - peak.from_depth_mm) * i / 100.0;
      const double x = peak.reference_depth_mm / z_mm - 1;
      const Eigen::Vector3d& c = peak.log_parabola;
      curve.emplace_back(z_mm, std::exp(c[0] + c[1] * x + c[2] * x * x) / normalised_max);
    }
    plot.series.push_back(Curve("log-parabola, fitted frames", Ink::kPeak, Stroke::kSolid, curve));
  }
  if (abscissa.is_depth) plot.lines = FocusLines(rows);
  figures->Add({plot},
               "Look for one clear peak with frames on both sides of it; where the raw sharpness "
               "(rings) peaks elsewhere than the normalised one (dots), the lamp's falling "
               "brightness has pulled it.");
}

void AddBlurFigures(const FocusSweep& sweep, const Calibration& calibration,
                    const std::vector<ResultRow>& rows, const model::SweepTruth* truth,
                    const Abscissa& abscissa, Figures* figures) {
  PlotSeries fitted = Points("in the fit", Ink::kFit, Mark::kDot);
  PlotSeries doubted = Points("down-weighted", Ink::kFit, Mark::kRing);
  PlotSeries left_out = Points("left out", Ink::kData, Mark::kCross);
  PlotSeries zhuo_sim = Points("source's meter (Zhuo-Sim)", Ink::kMuted, Mark::kDiamond);
  PlotSeries fitted_residuals = fitted, doubted_residuals = doubted;
  fitted_residuals.label.clear();
  doubted_residuals.label.clear();

  const std::optional<BlurLaw> law =
      abscissa.is_depth ? BlurLaw::Of(sweep, calibration) : std::nullopt;
  std::vector<double> xs;
  double largest_residual = 0;
  for (const FrameMeasurement& frame : calibration.frames) {
    const double x = abscissa.Of(frame);
    if (frame.rejection.empty() && frame.source_blur_sigma_px > 0)
      AddPoint(&zhuo_sim, x, frame.source_blur_sigma_px,
               PointName(frame, abscissa, "Zhuo-Sim sigma [px]", frame.source_blur_sigma_px));
    if (!HasBlur(frame)) continue;
    const bool in_fit = frame.in_blur_fit && frame.rejection.empty();
    const bool full = frame.blur_fit_weight >= 0.5;
    PlotSeries* series = !in_fit ? &left_out : full ? &fitted : &doubted;
    AddPoint(series, x, frame.blur_sigma_px,
             PointName(frame, abscissa, "sigma [px]", frame.blur_sigma_px));
    series->y_error.push_back(frame.blur_sigma_error_px);
    xs.push_back(x);
    if (!law || !in_fit || !IsDepth(frame.depth_mm)) continue;
    const double sd_px = std::hypot(frame.blur_sigma_error_px,
                                    law->SlopePxPerMm(frame.depth_mm) * sweep.reading_sigma_mm);
    const double residual = (frame.blur_sigma_px - law->SigmaPx(frame.depth_mm)) / sd_px;
    AddPoint(full ? &fitted_residuals : &doubted_residuals, x, residual,
             PointName(frame, abscissa, "residual/sd", residual));
    if (std::isfinite(residual)) largest_residual = std::max(largest_residual, std::abs(residual));
  }
  if (xs.size() < 2) return;

  Plot plot;
  plot.id = "blur";
  plot.title = "Blur against depth";
  plot.x_axis.label = abscissa.label;
  plot.y_axis.label = "blur sigma [px]";
  plot.height_px = 360;
  const auto [lo, hi] = std::minmax_element(xs.begin(), xs.end());
  if (abscissa.is_depth) plot.lines = FocusLines(rows);
  // Both figures share this range, which reaches to a focus not far outside the sweep.
  const double span = *hi - *lo;
  std::pair<double, double> x_range = {*lo, *hi};
  for (const PlotLine& line : plot.lines)
    if (line.position > *lo - span / 2 && line.position < *hi + span / 2)
      x_range = {std::min(x_range.first, line.position), std::max(x_range.second, line.position)};
  const auto curve_of = [&](const BlurLaw& blur_law) {
    std::vector<std::pair<double, double>> curve;
    for (int i = 0; i <= 400; ++i) {
      const double z_mm = x_range.first + (x_range.second - x_range.first) * i / 400.0;
      if (IsDepth(z_mm)) curve.emplace_back(z_mm, blur_law.SigmaPx(z_mm));
    }
    return curve;
  };
  plot.series = {std::move(zhuo_sim), std::move(left_out), std::move(fitted), std::move(doubted)};
  if (law) plot.series.push_back(Curve("fitted law", Ink::kFit, Stroke::kSolid, curve_of(*law)));
  if (truth != nullptr && abscissa.is_depth)
    plot.series.push_back(
        Curve("true law", Ink::kTruth, Stroke::kDashed, curve_of(BlurLaw::OfTruth(sweep, *truth))));
  x_range = {x_range.first - 0.04 * span, x_range.second + 0.04 * span};
  plot.x_axis.range = x_range;
  std::string caption =
      "No law was fitted to these points: look for a smallest blur with frames on both sides of "
      "it.";
  if (law)
    caption =
        "A good sweep shows its smallest blur inside the sweep and both arms on the fitted curve; "
        "rings were down-weighted and crosses left out";
  if (law && law->floor_from_frames())
    caption +=
        ", and the height of the curve's bottom is taken from the points, since the floor was not "
        "determined";
  if (law) caption += '.';
  figures->Add({plot}, caption);

  if (fitted_residuals.x.size() + doubted_residuals.x.size() < 2) return;
  Plot residuals;
  residuals.id = "blur-residuals";
  residuals.title = "Residuals of the blur fit";
  residuals.x_axis.label = abscissa.label;
  residuals.x_axis.range = x_range;
  residuals.y_axis.label = "residual / sd";
  const double limit = 1.1 * std::clamp(largest_residual, 3.0, 8.0);
  residuals.y_axis.range = {-limit, limit};
  residuals.height_px = 210;
  residuals.lines = {Level(0), Level(2), Level(-2)};
  residuals.series = {std::move(fitted_residuals), std::move(doubted_residuals)};
  figures->Add({residuals},
               "Nearly all points should scatter between the dotted lines without a trend; a bow "
               "says that lens and law differ, one far point that its reading or its frame is bad "
               "(each residual is in units of its standard deviation, from blur and reading).");
}

void AddScaleFigure(const FocusSweep& sweep, const Calibration& calibration, Figures* figures) {
  const calib::ScaleLaw& scale = calibration.scale;
  if (!scale.done || !(scale.reference_depth_mm > 0)) return;
  const double sign = model::DirectionSign(sweep.direction);
  PlotSeries fitted = Points("in the fit", Ink::kFit, Mark::kDot);
  PlotSeries left_out = Points("left out", Ink::kData, Mark::kCross);
  PlotSeries fitted_residuals = Points("", Ink::kFit, Mark::kDot);
  PlotSeries left_out_residuals = Points("", Ink::kData, Mark::kCross);
  // z = 0, where 1/scale = (offset + sign b)/z_reference vanishes: b = -sign offset.
  const double zero_reading_mm = -sign * scale.offset_mm.value;
  std::pair<double, double> range = {zero_reading_mm, zero_reading_mm};
  for (const FrameMeasurement& frame : calibration.frames) {
    if (!frame.image_scale || !(*frame.image_scale > 0)) continue;
    const double inverse = 1 / *frame.image_scale;
    const double law_reading_mm =
        sign * (scale.reference_depth_mm * inverse - scale.offset_mm.value);
    const double residual_mm = frame.reading_mm - law_reading_mm;
    const std::string name =
        fmt::format("{}: b = {:.6g} mm, 1/scale = {:.5g}, reading off by {:+.2g} mm",
                    FrameName(frame.image), frame.reading_mm, inverse, residual_mm);
    AddPoint(frame.in_scale_fit ? &fitted : &left_out, frame.reading_mm, inverse, name);
    AddPoint(frame.in_scale_fit ? &fitted_residuals : &left_out_residuals, frame.reading_mm,
             residual_mm, name);
    range = {std::min(range.first, frame.reading_mm), std::max(range.second, frame.reading_mm)};
  }
  if (fitted.x.size() < 2) return;

  Plot law;
  law.id = "scale";
  law.title = "Image scale against bench reading";
  law.x_axis.label = "bench reading b [mm]";
  law.y_axis.label = "1 / image scale";
  law.height_px = 290;
  const auto law_at = [&](double reading_mm) {
    return (scale.offset_mm.value + sign * reading_mm) / scale.reference_depth_mm;
  };
  law.series = {Curve(sign > 0 ? "1/scale = (offset + b)/z of the reference"
                               : "1/scale = (offset − b)/z of the reference",
                      Ink::kFit, Stroke::kSolid,
                      {{range.first, law_at(range.first)}, {range.second, law_at(range.second)}}),
                std::move(fitted), std::move(left_out)};
  law.lines = {Level(0)};
  law.notes = {{TrueMinus(fmt::format("Ap at b = {} ± {} mm",
                                      RoundedTo(zero_reading_mm, scale.offset_mm.sigma),
                                      RoundedSigma(scale.offset_mm.sigma))),
                zero_reading_mm, 0}};
  // Room below zero for the note.
  const double top = std::max(law_at(range.first), law_at(range.second));
  law.y_axis.range = {-0.14 * top, 1.05 * top};

  Plot residuals;
  residuals.id = "scale-residuals";
  residuals.title = "Bench readings against the law of the image scale";
  residuals.x_axis.label = "bench reading b [mm]";
  residuals.y_axis.label = "reading − law [mm]";
  residuals.height_px = 190;
  residuals.lines = {Level(0)};
  residuals.series = {std::move(fitted_residuals), std::move(left_out_residuals)};
  figures->Add({law, residuals},
               "All points should lie on one straight line, which reaches zero where the target "
               "would touch the aperture plane Ap; below, a single point off zero is a wrong "
               "reading, and a bow a camera whose scale does not follow 1/z.");
}

constexpr char kNone[] = "–";

// With no-break spaces. Without a sigma it was not fitted: given, or taken for granted.
std::string WithSigma(const calib::Result& result) {
  if (!std::isfinite(result.value)) return "not determined";
  if (!(result.sigma > 0)) return RoundedTo(result.value, 0) + "\u00A0(held)";
  return fmt::format("{}\u00A0±\u00A0{}", RoundedTo(result.value, result.sigma),
                     RoundedSigma(result.sigma));
}

std::string RowName(const ResultRow& row) {
  return fmt::format("<tr><th scope=\"row\">{}{}</th>", EscapeXml(row.label),
                     row.unit.empty() ? "" : fmt::format(" [{}]", EscapeXml(row.unit)));
}

std::string ResultsTable(const std::vector<ResultRow>& rows) {
  std::string html =
      "<div class=\"wide\"><table>\n<thead><tr><th>quantity</th>"
      "<th class=\"number\">blur fit ± statistical</th>"
      "<th class=\"number\">systematic interval</th><th class=\"number\">source's recipe</th>"
      "<th class=\"number\">sharpness peak</th></tr></thead>\n<tbody>\n";
  for (const ResultRow& row : rows) {
    const double sigma = row.fit ? row.fit->sigma : 0;
    html += RowName(row);
    html += TableCell(row.fit ? WithSigma(*row.fit) : kNone, "number chosen");
    html += TableCell(row.fit && row.fit->systematic
                          ? fmt::format("{} … {}", RoundedTo(row.fit->systematic->x(), sigma),
                                        RoundedTo(row.fit->systematic->y(), sigma))
                          : kNone);
    html += TableCell(row.source ? RoundedTo(*row.source, sigma) : kNone);
    html += TableCell(row.peak ? WithSigma(*row.peak) : kNone) + "</tr>\n";
  }
  html += "</tbody></table></div>\n";
  html +=
      "<p class=\"soft\">Statistical: one standard deviation from noise and readings. Systematic: "
      "the interval that the lens floor where it is not known, the two sides of focus where they "
      "disagree, the blur meter and the stated tolerances leave open. The source's recipe has no "
      "error estimate.</p>\n";
  return html;
}

std::string ErrorsTable(const std::vector<ResultRow>& rows) {
  std::string html =
      "<h3>Errors against the truth of the simulation</h3>\n<div class=\"wide\"><table>\n"
      "<thead><tr><th>quantity</th><th class=\"number\">truth</th>"
      "<th class=\"number\">blur fit</th><th class=\"number\">in standard deviations</th>"
      "<th class=\"number\">source's recipe</th><th class=\"number\">sharpness peak</th></tr>"
      "</thead>\n<tbody>\n";
  for (const ResultRow& row : rows) {
    if (!row.truth) continue;
    const double sigma = row.fit ? row.fit->sigma : 0;
    html += RowName(row) + TableCell(RoundedTo(*row.truth, sigma));
    html += TableCell(row.fit ? SignedRoundedTo(row.fit->value - *row.truth, sigma) : kNone,
                      "number chosen");
    html += TableCell(sigma > 0 ? fmt::format("{:+.1f}", (row.fit->value - *row.truth) / sigma)
                                : kNone);
    html += TableCell(row.source ? SignedRoundedTo(*row.source - *row.truth, sigma) : kNone);
    html += TableCell(row.peak ? SignedRoundedTo(row.peak->value - *row.truth, row.peak->sigma)
                               : kNone);
    html += "</tr>\n";
  }
  return html + "</tbody></table></div>\n";
}

std::string CorrelationTable(const Calibration& calibration) {
  const Eigen::MatrixXd& covariance = calibration.covariance;
  const auto count = static_cast<Eigen::Index>(calibration.covariance_order.size());
  if (count == 0 || covariance.rows() != count || covariance.cols() != count) return "";
  std::string html =
      "<h2>Covariance of the fit</h2>\n<div "
      "class=\"wide\"><table>\n<thead><tr><th>correlation</th>";
  for (const std::string& name : calibration.covariance_order)
    html += fmt::format("<th class=\"number\">{}</th>", EscapeXml(name));
  html += "<th class=\"number\">standard deviation</th></tr></thead>\n<tbody>\n";
  for (Eigen::Index i = 0; i < count; ++i) {
    html += fmt::format("<tr><th scope=\"row\">{}</th>",
                        EscapeXml(calibration.covariance_order[static_cast<std::size_t>(i)]));
    for (Eigen::Index j = 0; j < count; ++j) {
      const double scale = std::sqrt(covariance(i, i) * covariance(j, j));
      html += TableCell(scale > 0 ? fmt::format("{:+.3f}", covariance(i, j) / scale) : kNone);
    }
    html += TableCell(fmt::format("{:.3g}", std::sqrt(covariance(i, i)))) + "</tr>\n";
  }
  html += "</tbody></table></div>\n";
  return html;
}

std::string RejectedFrames(const Calibration& calibration) {
  const std::vector<RejectionRun> runs = RejectionRuns(calibration.frames);
  std::string html = "<h2>Rejected frames</h2>\n";
  if (runs.empty()) return html + "<p>None.</p>\n";
  const auto frame_at = [&](int index) -> const FrameMeasurement& {
    return calibration.frames[static_cast<std::size_t>(index)];
  };
  int rejected = 0;
  html +=
      "<div class=\"wide\"><table>\n<thead><tr><th>frames</th><th class=\"number\">how many</th>"
      "<th>reason</th></tr></thead>\n<tbody>\n";
  for (const RejectionRun& run : runs) {
    const int count = run.last - run.first + 1;
    rejected += count;
    const std::string first = FrameName(frame_at(run.first).image);
    html +=
        "<tr>" +
        TableCell(
            count == 1 ? first : fmt::format("{} … {}", first, FrameName(frame_at(run.last).image)),
            "name") +
        TableCell(fmt::format("{}", count)) +
        TableCell(run.reason + (run.identical ? "" : " (numbers of the first of them)"), "") +
        "</tr>\n";
  }
  html += "</tbody></table></div>\n";
  html += fmt::format(
      "<details><summary>Each of the {} with its levels</summary>\n<div class=\"wide\"><table>\n"
      "<thead><tr><th>frame</th><th class=\"number\">reading [mm]</th><th class=\"number\">mean "
      "stored</th><th class=\"number\">contrast</th><th class=\"number\">saturated</th>"
      "<th>reason</th></tr></thead>\n<tbody>\n",
      rejected);
  for (const FrameMeasurement& frame : calibration.frames) {
    if (frame.rejection.empty()) continue;
    html += "<tr>" + TableCell(FrameName(frame.image), "name") +
            TableCell(fmt::format("{:.6g}", frame.reading_mm)) +
            TableCell(fmt::format("{:.4f}", frame.statistics.mean_stored)) +
            TableCell(fmt::format("{:.3f}", frame.statistics.contrast)) +
            TableCell(fmt::format("{:.1f} %", 100 * frame.statistics.saturated_fraction)) +
            TableCell(frame.rejection, "") + "</tr>\n";
  }
  html += "</tbody></table></div></details>\n";
  return html;
}

// What limits the depth of focus, noise or the systematic interval, in words.
std::string LimitInWords(const FocusSweep& sweep, const Calibration& calibration) {
  if (!calibration.focus_depth_mm) return "";
  const calib::Result& focus = *calibration.focus_depth_mm;
  if (!focus.systematic || !focus.systematic->allFinite() || !(focus.sigma > 0)) return "";
  const double half_mm =
      std::max(focus.systematic->y() - focus.value, focus.value - focus.systematic->x());
  const std::string numbers = fmt::format(
      "noise and readings leave ±{} mm of the depth of focus open, the systematic interval up to "
      "{:.2g} mm",
      RoundedSigma(focus.sigma), half_mm);
  if (half_mm > 2 * focus.sigma)
    return fmt::format(
        "What limits it is systematic: {}. More frames would not help; {}both sides of focus and "
        "tighter tolerances would.",
        numbers, sweep.floor.given_px ? "" : "a blur floor measured on a knife edge, ");
  if (half_mm < 0.5 * focus.sigma)
    return fmt::format(
        "What limits it is statistical: {}. More frames, more light or better readings would help.",
        numbers);
  return fmt::format("Noise and systematic errors limit it alike: {}.", numbers);
}

std::string Verdict(const FocusSweep& sweep, const Calibration& calibration) {
  std::string outcome_class = "refused", outcome = "Refused";
  if (calibration.outcome == calib::Outcome::kOk) {
    outcome_class = "ok";
    outcome = "Calibrated";
  } else if (calibration.outcome == calib::Outcome::kPartial) {
    outcome_class = "partial";
    outcome = "Partly calibrated";
  }
  if (calibration.outcome != calib::Outcome::kOk) outcome += ": " + calibration.reason;
  std::string html = fmt::format("<div class=\"verdict {}\">\n<p class=\"outcome\">{}</p>\n",
                                 outcome_class, EscapeXml(outcome));
  const auto paragraph = [&](const std::string& text) {
    if (!text.empty()) html += fmt::format("<p>{}</p>\n", EscapeXml(text));
  };
  std::vector<std::string> found;
  if (calibration.image_distance_mm)
    found.push_back(
        fmt::format("image distance d1 = {} mm", WithSigma(*calibration.image_distance_mm)));
  if (calibration.focus_depth_mm)
    found.push_back(
        fmt::format("depth of focus zf = {} mm", WithSigma(*calibration.focus_depth_mm)));
  if (calibration.blur_ratio)
    found.push_back(fmt::format("blur ratio κ = {}", WithSigma(*calibration.blur_ratio)));
  if (!found.empty())
    paragraph(fmt::format("Found: {}, from {} of {} frames{}.", fmt::join(found, ", "),
                          calibration.frames_used, calibration.frames.size(),
                          calibration.blur.done ? fmt::format(", χ²/dof {:.2f} (1 is expected)",
                                                              calibration.blur.chi2_per_dof)
                                                : ""));
  paragraph(LimitInWords(sweep, calibration));
  if (!calibration.blur.undetermined.empty())
    paragraph(fmt::format("The data do not determine {}.",
                          fmt::join(calibration.blur.undetermined, ", ")));
  html += "</div>\n";
  if (!calibration.warnings.empty()) {
    html += "<ul class=\"warnings\">\n";
    for (const std::string& warning : calibration.warnings)
      html += fmt::format("<li>{}</li>\n", EscapeXml(warning));
    html += "</ul>\n";
  }
  return html;
}

std::string MethodMessages(const Calibration& calibration) {
  std::string html;
  const auto say = [&](const char* method, bool done, const std::string& message) {
    if (!done) html += fmt::format("<li>{}: {}</li>\n", EscapeXml(method), EscapeXml(message));
  };
  say("source's recipe", calibration.source.done, calibration.source.message);
  say("sharpness peak", calibration.sharpness.done, calibration.sharpness.message);
  say("law of the image scale", calibration.scale.done, calibration.scale.message);
  say("blur fit", calibration.blur.done, calibration.blur.message);
  return html.empty() ? "" : "<p>Without a result:</p>\n<ul>\n" + html + "</ul>\n";
}

std::string CameraRow(const model::Camera& camera, const char* label, const std::string& field,
                      double value) {
  std::string remark;
  const auto statement = camera.statements.find(field);
  if (statement != camera.statements.end()) {
    if (statement->second.tolerance > 0)
      remark = fmt::format("± {:.3g}", statement->second.tolerance);
    if (statement->second.assumed) remark += remark.empty() ? "assumed" : ", assumed";
  }
  return fmt::format("<tr><th scope=\"row\">{}</th>", EscapeXml(label)) +
         TableCell(fmt::format("{:.6g}", value)) + TableCell(remark, "soft") + "</tr>\n";
}

std::string HowItWasMade(const FocusSweep& sweep, const Calibration& calibration,
                         const ReportOrigin& origin) {
  const model::Camera& camera = sweep.camera;
  std::string html =
      "<h2>How it was made</h2>\n<div class=\"wide\"><table>\n<thead><tr><th>given of the "
      "camera</th><th class=\"number\">value</th><th>tolerance</th></tr></thead>\n<tbody>\n";
  html += CameraRow(camera, "front focal length f1 [mm]", "lens.front_focal_length_mm",
                    camera.lens.front_focal_length_mm);
  html += CameraRow(camera, "rear focal length f2 [mm]", "lens.rear_focal_length_mm",
                    camera.lens.rear_focal_length_mm);
  html += CameraRow(camera, "lens thickness rho [mm]", "lens.lens_thickness_mm",
                    camera.lens.lens_thickness_mm);
  html += CameraRow(camera, "aperture radius r [mm]", "lens.aperture_radius_mm",
                    camera.lens.aperture_radius_mm);
  html += CameraRow(camera, "pixel pitch p [mm]", "sensor.pixel_pitch_mm",
                    camera.sensor.pixel_pitch_mm);
  html += "</tbody></table></div>\n<ul>\n";
  const auto item = [&](const std::string& text) {
    html += fmt::format("<li>{}</li>\n", EscapeXml(text));
  };
  item(fmt::format("Camera {}: {} × {} px, transfer {}, point spread function {}.", camera.name,
                   camera.sensor.width_px, camera.sensor.height_px, camera.sensor.transfer.Name(),
                   model::PsfName(camera.psf)));
  if (!sweep.frames.empty()) {
    const auto [lo, hi] =
        std::minmax_element(sweep.frames.begin(), sweep.frames.end(),
                            [](const model::SweepFrame& a, const model::SweepFrame& b) {
                              return a.reading_mm < b.reading_mm;
                            });
    item(
        fmt::format("{} frames, bench readings {:.6g} to {:.6g} mm, direction {}, standard "
                    "deviation of a reading {:.3g} mm.",
                    sweep.frames.size(), lo->reading_mm, hi->reading_mm,
                    model::BenchDirectionName(sweep.direction), sweep.reading_sigma_mm));
  }
  item(sweep.offset_mm ? fmt::format("Bench offset given: {:.6g} ± {:.3g} mm.",
                                     sweep.offset_mm->value, sweep.offset_mm->sigma)
                       : std::string("Bench offset not given: taken from the image scale."));
  if (sweep.floor.given_px)
    item(fmt::format("Blur floor given: {:.4g} ± {:.3g} px.", sweep.floor.given_px->value,
                     sweep.floor.given_px->sigma));
  else if (sweep.floor.from_px && sweep.floor.to_px)
    item(fmt::format("Blur floor given as an interval: {:.4g} to {:.4g} px.", *sweep.floor.from_px,
                     *sweep.floor.to_px));
  else
    item("Blur floor not given.");
  item(fmt::format("Target: {}.", model::SweepTargetName(sweep.target)));
  item(fmt::format("thicklens {}, {}; the calibration took {:.1f} s.", origin.version, origin.date,
                   calibration.seconds));
  for (const std::string& note : origin.notes) item(note);
  html += "</ul>\n";
  return html;
}

}  // namespace

std::string CalibrationReportHtml(const FocusSweep& sweep, const Calibration& calibration,
                                  const model::SweepTruth* truth, const ReportOrigin& origin) {
  const std::vector<ResultRow> rows = ResultRows(calibration, truth);
  const Abscissa abscissa = AbscissaOf(calibration);
  Figures figures;
  AddSharpnessFigure(calibration, rows, abscissa, &figures);
  AddBlurFigures(sweep, calibration, rows, truth, abscissa, &figures);
  AddScaleFigure(sweep, calibration, &figures);

  const std::string camera_name = EscapeXml(sweep.camera.name);
  std::string html = PageHead("Calibration of " + sweep.camera.name, SvgPlotStyle());
  html += fmt::format("<h1>Calibration of {}</h1>\n<p class=\"under-title\">{}</p>\n", camera_name,
                      EscapeXml(fmt::format("Focus sweep {}, {} frames · {}", origin.sweep_name,
                                            sweep.frames.size(), origin.date)));
  html += Verdict(sweep, calibration);
  const bool any_result = std::any_of(rows.begin(), rows.end(), [](const ResultRow& row) {
    return row.fit || row.source || row.peak;
  });
  html += "<h2>Results</h2>\n";
  html += any_result ? ResultsTable(rows) : "<p>None.</p>\n";
  if (any_result && truth != nullptr) html += ErrorsTable(rows);
  html += MethodMessages(calibration);
  if (!figures.html().empty()) html += "<h2>What was measured</h2>\n" + figures.html();
  html += RejectedFrames(calibration);
  html += CorrelationTable(calibration);
  html += HowItWasMade(sweep, calibration, origin);
  html += "</main>\n</body>\n</html>\n";
  return html;
}

}  // namespace thicklens::tools
