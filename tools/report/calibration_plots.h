#ifndef THICKLENS_TOOLS_REPORT_CALIBRATION_PLOTS_H_
#define THICKLENS_TOOLS_REPORT_CALIBRATION_PLOTS_H_

#include <string>
#include <utility>
#include <vector>

#include "thicklens/calib/calibrate.h"
#include "tools/report/calibration_summary.h"
#include "tools/report/svg_plot.h"

namespace thicklens::tools {

// Elements that the figures of a calibration share.

using CurvePoints = std::vector<std::pair<double, double>>;

PlotSeries Curve(std::string label, Ink ink, Stroke stroke, const CurvePoints& points);
PlotSeries Points(std::string label, Ink ink, Mark mark);
void AddPoint(PlotSeries* series, double x, double y, std::string name);
// A horizontal line without a label, solid at 0.
PlotLine Level(double position);

// The abscissa of a frame in the figures. Without a bench offset there are no depths; the readings
// then still show the shape of a curve.
struct Abscissa {
  bool is_depth = false;
  std::string label;

  double Of(const calib::FrameMeasurement& frame) const;
};
Abscissa AbscissaOf(const calib::Calibration& calibration);

// Returns the text that is shown when a point is pointed at.
std::string PointName(const calib::FrameMeasurement& frame, const Abscissa& abscissa,
                      const std::string& quantity, double value);

// Vertical lines at the plane of focus by each method.
std::vector<PlotLine> FocusLines(const std::vector<ResultRow>& rows);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_CALIBRATION_PLOTS_H_
