#include "tools/report/calibration_figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "tools/report/calibration_text.h"
#include "tools/report/page_style.h"
#include "tools/report/rounding.h"

namespace thicklens::tools {
namespace {

using calib::Calibration;
using calib::FocusSweep;
using calib::FrameMeasurement;

constexpr int kExampleWidthPx = 290;
constexpr int kExampleHeightPx = 250;
constexpr std::size_t kMaxExamples = 3;

// Adds the plane of focus of the normalised index, if its frame differs from that of the raw index.
void AddNormalisedSharpest(const calib::SourceRecipe& source, Plot* plot) {
  if (!source.done || source.sharpest_normalised_frame < 0 ||
      source.sharpest_normalised_frame == source.sharpest_frame)
    return;
  plot->lines.push_back(
      {fmt::format("sharpest over mean grey: {:.5g} mm", source.normalised_focus_depth_mm),
       Ink::kPeak, Stroke::kDotted, true, source.normalised_focus_depth_mm});
}

// 1/scale against the reading and, if there is a model, the residual of each reading.
struct ScalePoints {
  PlotSeries fitted = Points("in the fit", Ink::kFit, Mark::kDot);
  PlotSeries left_out = Points("left out", Ink::kData, Mark::kCross);
  PlotSeries fitted_residuals = Points("", Ink::kFit, Mark::kDot);
  PlotSeries left_out_residuals = Points("", Ink::kData, Mark::kCross);
};

ScalePoints ScalePointsOf(const FocusSweep& sweep, const Calibration& calibration) {
  const calib::ScaleModel& scale = calibration.diagnostics.scale;
  const double sign = model::DirectionSign(sweep.direction);
  ScalePoints points;
  for (const FrameMeasurement& frame : calibration.frames) {
    if (!frame.image_scale || !(*frame.image_scale > 0)) continue;
    const double inverse = 1 / *frame.image_scale;
    const double inverse_sigma = frame.image_scale_sigma * inverse * inverse;
    std::string name = fmt::format("{}: b = {:.6g} mm, 1/scale = {:.5g}", FrameName(frame.image),
                                   frame.reading_mm, inverse);
    PlotSeries* series = frame.in_scale_fit ? &points.fitted : &points.left_out;
    series->y_error.push_back(inverse_sigma);
    if (!scale.done) {
      AddPoint(series, frame.reading_mm, inverse, name);
      continue;
    }
    const double model_reading_mm =
        sign * (scale.reference_depth_mm * inverse - scale.line_zero_mm());
    const double residual_mm = frame.reading_mm - model_reading_mm;
    name += fmt::format(", reading error {:+.2g} mm", residual_mm);
    AddPoint(series, frame.reading_mm, inverse, name);
    PlotSeries* residuals =
        frame.in_scale_fit ? &points.fitted_residuals : &points.left_out_residuals;
    residuals->y_error.push_back(inverse_sigma * scale.reference_depth_mm);
    AddPoint(residuals, frame.reading_mm, residual_mm, name);
  }
  return points;
}

Plot ScalePlot() {
  Plot plot;
  plot.id = "scale";
  plot.title = "Image scale against bench reading";
  plot.x_axis.label = "bench reading b [mm]";
  plot.y_axis.label = "1 / image scale";
  plot.height_px = 290;
  return plot;
}

ReportFigure ScaleWithoutModel(const calib::ScaleModel& scale, ScalePoints points) {
  points.fitted.label.clear();
  points.left_out.label.clear();
  Plot plot = ScalePlot();
  plot.series = {std::move(points.fitted), std::move(points.left_out)};
  std::string caption = "The image scale does not determine the bench offset";
  if (scale.kind != calib::ScaleKind::kUnknown)
    caption += fmt::format("; its dependence on the reading: {}", ScaleKindWords(scale.kind));
  return FigureOf({plot}, caption + ". If it did, the points would lie on a straight line.");
}

std::string ShortenedName(const std::string& image) {
  constexpr std::size_t kMax = 18;
  const std::string name = FrameName(image);
  const bool ascii = std::all_of(name.begin(), name.end(), [](char c) { return (c & 0x80) == 0; });
  return name.size() <= kMax || !ascii ? name : "…" + name.substr(name.size() - kMax);
}

Plot ExamplePlot(const calib::BlurExample& example, const FrameMeasurement& frame, std::size_t i) {
  Plot plot;
  plot.id = fmt::format("example-{}", i + 1);
  plot.heading = ShortenedName(frame.image);
  if (frame.depth_mm > 0) plot.heading += fmt::format(", z = {:.4g} mm", frame.depth_mm);
  plot.title = fmt::format("{} of {}", example.is_edge ? "Edge profile" : "Transfer",
                           FrameName(frame.image));
  plot.x_axis.label = example.is_edge ? "distance from edge [px]" : "frequency [cycles/px]";
  plot.y_axis.label = example.is_edge ? "grey, dark 0, bright 1" : "transfer";
  plot.width_px = kExampleWidthPx;
  plot.height_px = kExampleHeightPx;
  PlotSeries measured = Points("measured", Ink::kData, Mark::kDot);
  measured.x = example.x;
  measured.y = example.measured;
  plot.series.push_back(std::move(measured));
  const auto add_curve = [&](const char* label, Stroke stroke, const std::vector<double>& values) {
    CurvePoints curve;
    for (std::size_t k = 0; k < std::min(values.size(), example.x.size()); ++k)
      curve.emplace_back(example.x[k], values[k]);
    std::sort(curve.begin(), curve.end());
    if (!curve.empty()) plot.series.push_back(Curve(label, Ink::kFit, stroke, curve));
  };
  add_curve("Gaussian", Stroke::kSolid, example.gaussian);
  add_curve("disc", Stroke::kDashed, example.disc);
  return plot;
}

}  // namespace

ReportFigure FigureOf(const std::vector<Plot>& plots, const std::string& caption) {
  ReportFigure figure;
  for (const Plot& plot : plots) figure.drawings.push_back({plot.id, SvgPlot(plot)});
  figure.caption = caption;
  return figure;
}

ReportFigure SharpnessFigure(const Calibration& calibration, const std::vector<ResultRow>& rows,
                             const Abscissa& abscissa) {
  double raw_max = 0, normalised_max = 0;
  int shown = 0;
  for (const FrameMeasurement& frame : calibration.frames) {
    if (!frame.rejection.empty()) continue;
    raw_max = std::max(raw_max, frame.mean_edge_slope);
    normalised_max = std::max(normalised_max, frame.normalised_edge_slope);
    if (frame.normalised_edge_slope > 0) ++shown;
  }
  if (shown < 2 || !(raw_max > 0)) return {};

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
    if (!(frame.normalised_edge_slope > 0)) continue;
    AddPoint(&normalised, abscissa.Of(frame), frame.normalised_edge_slope / normalised_max,
             PointName(frame, abscissa, "normalised MES per px", frame.normalised_edge_slope));
  }
  plot.series = {std::move(raw), std::move(normalised)};
  const calib::SharpnessPeak& peak = calibration.diagnostics.sharpness;
  if (peak.done && abscissa.is_depth && peak.reference_depth_mm > 0) {
    CurvePoints curve;
    for (int i = 0; i <= 100; ++i) {
      const double z_mm = peak.from_depth_mm + (peak.to_depth_mm - peak.from_depth_mm) * i / 100.0;
      const double x = peak.reference_depth_mm / z_mm - 1;
      const Eigen::Vector3d& c = peak.log_parabola;
      curve.emplace_back(z_mm, std::exp(c[0] + c[1] * x + c[2] * x * x) / normalised_max);
    }
    plot.series.push_back(Curve("log-parabola, fitted frames", Ink::kPeak, Stroke::kSolid, curve));
  }
  if (abscissa.is_depth) {
    plot.lines = FocusLines(rows);
    AddNormalisedSharpest(calibration.diagnostics.paper_recipe, &plot);
  }
  return FigureOf(
      {plot},
      "There should be one clear peak with frames on both sides; if the raw sharpness (rings) "
      "peaks elsewhere than the normalised one (dots), the falling brightness of the lamp has "
      "shifted it. An index in image pixels is also shifted by the image scale, which changes "
      "along the sweep, so that both may peak elsewhere than the fit.");
}

ReportFigure ScaleFigure(const FocusSweep& sweep, const Calibration& calibration) {
  const calib::ScaleModel& scale = calibration.diagnostics.scale;
  ScalePoints points = ScalePointsOf(sweep, calibration);
  if (points.fitted.x.size() + points.left_out.x.size() < 2) return {};
  if (!scale.done || !(scale.reference_depth_mm > 0))
    return ScaleWithoutModel(scale, std::move(points));
  const double sign = model::DirectionSign(sweep.direction);
  // z = 0, where 1/scale = (offset + sign b)/z_reference vanishes: b = -sign offset.
  const double zero_reading_mm = -sign * scale.offset_mm.value;
  std::pair<double, double> range = {zero_reading_mm, zero_reading_mm};
  for (const PlotSeries* series : {&points.fitted, &points.left_out})
    for (const double reading_mm : series->x)
      range = {std::min(range.first, reading_mm), std::max(range.second, reading_mm)};
  Plot law = ScalePlot();
  const auto law_at = [&](double reading_mm) {
    return (scale.line_zero_mm() + sign * reading_mm) / scale.reference_depth_mm;
  };
  law.series = {Curve(sign > 0 ? "1/scale = (offset + b)/z of the reference"
                               : "1/scale = (offset − b)/z of the reference",
                      Ink::kFit, Stroke::kSolid,
                      {{range.first, law_at(range.first)}, {range.second, law_at(range.second)}}),
                std::move(points.fitted), std::move(points.left_out)};
  law.lines = {Level(0)};
  law.notes = {{TrueMinus(fmt::format("aperture at reading b = {} ± {} mm",
                                      RoundedTo(zero_reading_mm, scale.offset_mm.sigma),
                                      RoundedSigma(scale.offset_mm.sigma))),
                zero_reading_mm, 0}};
  // Room for the note below zero.
  const double top = std::max(law_at(range.first), law_at(range.second));
  law.y_axis.range = {-0.14 * top, 1.05 * top};

  Plot residuals;
  residuals.id = "scale-residuals";
  residuals.title = "Bench readings against the law of the image scale";
  residuals.x_axis.label = "bench reading b [mm]";
  residuals.y_axis.label = "reading − law [mm]";
  residuals.height_px = 190;
  residuals.lines = {Level(0)};
  residuals.series = {std::move(points.fitted_residuals), std::move(points.left_out_residuals)};
  return FigureOf({law, residuals},
                  "All points should lie on one straight line, which reaches zero where the target "
                  "would touch the aperture plane; below, a single point off zero means a wrong "
                  "reading, and a bow means that the scale does not follow 1/z.");
}

ReportFigure ExampleFigure(const Calibration& calibration) {
  std::vector<Plot> plots;
  bool edges = false;
  for (const calib::BlurExample& example : calibration.examples) {
    if (plots.size() == kMaxExamples) break;
    if (example.frame < 0 || example.frame >= static_cast<int>(calibration.frames.size()) ||
        std::min(example.x.size(), example.measured.size()) < 2)
      continue;
    edges = edges || example.is_edge;
    plots.push_back(ExamplePlot(
        example, calibration.frames[static_cast<std::size_t>(example.frame)], plots.size()));
  }
  if (plots.empty()) return {};
  ReportFigure figure = FigureOf(
      plots,
      edges
          ? "Edges as measured, with the fits: the points should follow a curve from the dark side "
            "to the bright one without overshoot (a sharpened or compressed image has one)."
          : "Remaining contrast at each spatial frequency, relative to the sharpest frame, with "
            "the fits: the points should fall along a curve; a constant floor is noise.");
  figure.beside = true;
  return figure;
}

const std::vector<std::string>& DrawingNames() {
  static const std::vector<std::string> names = {"sharpness",
                                                 "blur",
                                                 "blur-residuals",
                                                 "reading-errors",
                                                 "scale",
                                                 "scale-residuals",
                                                 "field",
                                                 "example-1",
                                                 "example-2",
                                                 "example-3",
                                                 "mtf-through-focus",
                                                 "mtf-in-focus",
                                                 "psf"};
  return names;
}

}  // namespace thicklens::tools
