#include "tools/report/calibration_plots.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "thicklens/calib/blur_model.h"

namespace thicklens::tools {

using calib::Calibration;
using calib::FrameMeasurement;

namespace {

std::vector<double> Coordinates(const CurvePoints& points, bool first) {
  std::vector<double> column;
  column.reserve(points.size());
  for (const std::pair<double, double>& point : points)
    column.push_back(first ? point.first : point.second);
  return column;
}

}  // namespace

PlotSeries Curve(std::string label, Ink ink, Stroke stroke, const CurvePoints& points) {
  PlotSeries series;
  series.label = std::move(label);
  series.ink = ink;
  series.mark = Mark::kNone;
  series.stroke = stroke;
  series.x = Coordinates(points, true);
  series.y = Coordinates(points, false);
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

double Abscissa::Of(const FrameMeasurement& frame) const {
  return is_depth ? frame.depth_mm : frame.reading_mm;
}

Abscissa AbscissaOf(const Calibration& calibration) {
  int depths = 0;
  double lo = 0, hi = 0;
  for (const FrameMeasurement& frame : calibration.frames) {
    if (!calib::IsDepth(frame.depth_mm)) continue;
    lo = depths == 0 ? frame.depth_mm : std::min(lo, frame.depth_mm);
    hi = depths == 0 ? frame.depth_mm : std::max(hi, frame.depth_mm);
    ++depths;
  }
  if (depths >= 2 && hi > lo && model::MovesFocus(calibration.diagnostics.moves))
    return {true, "depth z of the same blur at the calibrated focus [mm]"};
  if (depths >= 2 && hi > lo) return {true, "object depth z from Ap [mm]"};
  return {false, "bench reading b [mm] (no depths: the bench offset is unknown)"};
}

std::string PointName(const FrameMeasurement& frame, const Abscissa& abscissa,
                      const std::string& quantity, double value) {
  return fmt::format("{}: {} = {:.6g} mm, {} = {:.4g}{}", FrameName(frame.image),
                     abscissa.is_depth ? "z" : "b", abscissa.Of(frame), quantity, value,
                     frame.rejection.empty() ? "" : ", rejected: " + frame.rejection);
}

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
    if (row.source) add("paper's recipe", Ink::kSource, Stroke::kDotted, *row.source, sigma);
    if (row.peak)
      add("sharpness peak", Ink::kPeak, Stroke::kDashed, row.peak->value, row.peak->sigma);
    if (row.fit) add("blur fit", Ink::kFit, Stroke::kSolid, row.fit->value, sigma);
    if (row.truth) add("truth", Ink::kTruth, Stroke::kDashed, *row.truth, sigma);
  }
  return lines;
}

}  // namespace thicklens::tools
