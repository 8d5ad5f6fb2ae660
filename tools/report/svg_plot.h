#ifndef THICKLENS_TOOLS_REPORT_SVG_PLOT_H_
#define THICKLENS_TOOLS_REPORT_SVG_PLOT_H_

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace thicklens::tools {

// Returns round positions within [lo, hi], with the smallest step of 1, 2 or 5 times a power of ten
// that gives at most `at_most` of them. Empty unless lo < hi, both finite, and at_most >= 1.
std::vector<double> NiceTicks(double lo, double hi, int at_most);

// Returns positions on a logarithmic axis, for 0 < lo < hi: powers of ten, or 1, 2 and 5 times
// these, or, if the axis is shorter, those of NiceTicks.
std::vector<double> NiceLogTicks(double lo, double hi, int at_most);

// A tick's label with the digits that its step needs, and a true minus sign.
std::string TickLabel(double value, double step);

// The origin of a curve; its colour means the same in every figure of a page.
enum class Ink { kFit, kSource, kPeak, kData, kMuted, kTruth };
enum class Mark { kNone, kDot, kRing, kCross, kDiamond };
enum class Stroke { kNone, kSolid, kDashed, kDotted };

// Points that are not finite are left out and break the line. Points above or below the plotted
// range are drawn as a triangle at its edge.
struct PlotSeries {
  std::string label;  // in the legend; empty: not in the legend
  Ink ink = Ink::kData;
  Mark mark = Mark::kDot;
  Stroke stroke = Stroke::kNone;
  bool thin = false;  // a thinner line
  std::vector<double> x, y;
  std::vector<double> y_error;     // half lengths of the error bars; empty: none
  std::vector<std::string> names;  // of the points, shown when pointed at; empty: none
};

// The area between two curves over the same abscissas. It does not widen the plot.
struct PlotBand {
  std::string label;  // in the legend; empty: not in the legend
  Ink ink = Ink::kFit;
  std::vector<double> x, lo, hi;
};

// A line across the whole plot. A line far outside the data is left out, and the legend says so.
struct PlotLine {
  std::string label;
  Ink ink = Ink::kFit;
  Stroke stroke = Stroke::kSolid;
  bool vertical = true;
  double position = 0;
};

// A word below a point, kept inside the plot.
struct PlotNote {
  std::string text;
  double x = 0, y = 0;
};

struct PlotAxis {
  std::string label;                               // with its unit
  std::optional<std::pair<double, double>> range;  // absent: from the data
  // The axis is logarithmic; values that are not above 0 are left out.
  bool logarithmic = false;
};

struct Plot {
  std::string id;     // unique on the page; letters, digits and '-'
  std::string title;  // for readers who cannot see the figure
  PlotAxis x_axis, y_axis;
  std::string heading;  // shown above; empty: none
  std::vector<PlotBand> bands;
  std::vector<PlotSeries> series;
  std::vector<PlotLine> lines;
  std::vector<PlotNote> notes;
  int width_px = 860;
  int height_px = 320;
};

// Returns an <svg> element for an HTML page that has the style below.
std::string SvgPlot(const Plot& plot);

// The style rules of every plot, light and dark.
std::string SvgPlotStyle();

// Returns an <svg> element of class "plot" as a file of its own, with its style and a background.
std::string SvgFile(const std::string& element);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_SVG_PLOT_H_
