#include "tools/report/svg_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <limits>

#include "thicklens/base/printable_text.h"

namespace thicklens::tools {
namespace {

constexpr double kFontPx = 12;
// Wide enough for the widest of the common system fonts, so that nothing overlaps in any of them.
constexpr double kCharWidthPx = 7.2;
constexpr double kLegendRowPx = 20;

std::size_t CodePoints(const std::string& text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

double TextWidthPx(const std::string& text) {
  return kCharWidthPx * static_cast<double>(CodePoints(text));
}

const char* ClassOf(Ink ink) {
  switch (ink) {
    case Ink::kFit:
      return "ink-fit";
    case Ink::kSource:
      return "ink-source";
    case Ink::kPeak:
      return "ink-peak";
    case Ink::kData:
      return "ink-data";
    case Ink::kMuted:
      return "ink-muted";
    case Ink::kTruth:
      return "ink-truth";
  }
  return "ink-data";
}

const char* DashOf(Stroke stroke) {
  switch (stroke) {
    case Stroke::kDashed:
      return " stroke-dasharray=\"7 4\"";
    case Stroke::kDotted:
      return " stroke-dasharray=\"2 3\"";
    case Stroke::kNone:
    case Stroke::kSolid:
      break;
  }
  return "";
}

std::string MarkAt(Mark mark, double x, double y) {
  switch (mark) {
    case Mark::kDot:
      return fmt::format("<circle class=\"full\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2.8\"/>", x, y);
    case Mark::kRing:
      return fmt::format("<circle class=\"open\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3\"/>", x, y);
    case Mark::kCross:
      return fmt::format("<path class=\"open\" d=\"M{:.1f} {:.1f}l6 6m0 -6l-6 6\"/>", x - 3, y - 3);
    case Mark::kDiamond:
      return fmt::format("<path class=\"full\" d=\"M{:.1f} {:.1f}l3.4 3.4l-3.4 3.4l-3.4 -3.4z\"/>",
                         x, y - 3.4);
    case Mark::kNone:
      break;
  }
  return "";
}

struct Interval {
  double lo = std::numeric_limits<double>::infinity();
  double hi = -std::numeric_limits<double>::infinity();

  void Include(double value) {
    if (!std::isfinite(value)) return;
    lo = std::min(lo, value);
    hi = std::max(hi, value);
  }
  double span() const { return hi - lo; }
  bool Holds(double value) const { return value >= lo && value <= hi; }
};

// A line or an error bar may extend the plot by at most this share of the data's span.
constexpr double kStretch = 0.5;

Interval Padded(Interval range) {
  if (!(range.lo <= range.hi)) return {0, 1};
  const double pad =
      range.span() > 0 ? 0.04 * range.span() : std::max(std::abs(range.lo) * 0.05, 1e-9);
  return {range.lo - pad, range.hi + pad};
}

Interval RangeOf(const Plot& plot, bool horizontal) {
  const PlotAxis& axis = horizontal ? plot.x_axis : plot.y_axis;
  if (axis.range && axis.range->first < axis.range->second)
    return {axis.range->first, axis.range->second};
  Interval data;
  for (const PlotSeries& series : plot.series)
    for (std::size_t i = 0; i < std::min(series.x.size(), series.y.size()); ++i)
      if (std::isfinite(series.x[i]) && std::isfinite(series.y[i]))
        data.Include(horizontal ? series.x[i] : series.y[i]);
  Interval range = data;
  const auto stretch_to = [&](double value) {
    range.Include(
        std::clamp(value, data.lo - kStretch * data.span(), data.hi + kStretch * data.span()));
  };
  if (data.lo <= data.hi) {
    if (!horizontal)
      for (const PlotSeries& series : plot.series)
        for (std::size_t i = 0; i < std::min(series.y_error.size(), series.y.size()); ++i)
          if (std::isfinite(series.y[i]) && std::isfinite(series.y_error[i])) {
            stretch_to(series.y[i] - series.y_error[i]);
            stretch_to(series.y[i] + series.y_error[i]);
          }
    for (const PlotLine& line : plot.lines)
      if (line.vertical == horizontal && line.position >= data.lo - kStretch * data.span() &&
          line.position <= data.hi + kStretch * data.span())
        range.Include(line.position);
  }
  return Padded(range);
}

// Replaces values on logarithmic axes by their logarithms, so that the drawing code need not
// distinguish.
Plot WithLogarithms(Plot plot) {
  const auto logarithm = [](double value) {
    return value > 0 ? std::log10(value) : std::numeric_limits<double>::quiet_NaN();
  };
  const auto all = [&](std::vector<double>* values) {
    std::transform(values->begin(), values->end(), values->begin(), logarithm);
  };
  for (PlotAxis* axis : {&plot.x_axis, &plot.y_axis}) {
    if (!axis->logarithmic) continue;
    const bool is_x = axis == &plot.x_axis;
    if (axis->range) {
      axis->range = {logarithm(axis->range->first), logarithm(axis->range->second)};
    }
    for (PlotSeries& series : plot.series) {
      if (!is_x) {
        // The upward reach of the bar; the downward one would be longer.
        for (std::size_t i = 0; i < std::min(series.y_error.size(), series.y.size()); ++i) {
          series.y_error[i] = logarithm(1 + series.y_error[i] / series.y[i]);
        }
      }
      all(is_x ? &series.x : &series.y);
    }
    for (PlotBand& band : plot.bands) {
      if (is_x) {
        all(&band.x);
      } else {
        all(&band.lo);
        all(&band.hi);
      }
    }
    for (PlotLine& line : plot.lines) {
      if (line.vertical == is_x) line.position = logarithm(line.position);
    }
    for (PlotNote& note : plot.notes) {
      double& at = is_x ? note.x : note.y;
      at = logarithm(at);
    }
  }
  return plot;
}

// The drawn position of a tick, and its label.
struct Tick {
  double at = 0;
  std::string label;
};

std::vector<Tick> TicksOf(const PlotAxis& axis, const Interval& range, int at_most) {
  std::vector<Tick> ticks;
  if (axis.logarithmic) {
    for (const double value :
         NiceLogTicks(std::pow(10, range.lo), std::pow(10, range.hi), at_most)) {
      ticks.push_back({std::log10(value), fmt::format("{:.4g}", value)});
    }
    return ticks;
  }
  const std::vector<double> values = NiceTicks(range.lo, range.hi, at_most);
  const double step =
      values.size() > 1 ? values[1] - values[0] : std::abs(values.empty() ? 1.0 : values[0]);
  for (const double value : values) ticks.push_back({value, TickLabel(value, step)});
  return ticks;
}

// The drawing area, and the mapping of numbers to it.
struct Frame {
  double left = 0, right = 0, top = 0, bottom = 0;
  Interval x, y;

  double X(double value) const { return left + (value - x.lo) / x.span() * (right - left); }
  double Y(double value) const { return bottom - (value - y.lo) / y.span() * (bottom - top); }
};

struct LegendEntry {
  std::string label;
  Ink ink;
  Mark mark;
  Stroke stroke;
  bool thin = false;
  bool band = false;
};

std::vector<LegendEntry> LegendOf(const Plot& plot, const Interval& x, const Interval& y) {
  std::vector<LegendEntry> entries;
  for (const PlotSeries& series : plot.series)
    if (!series.label.empty() && !series.x.empty())
      entries.push_back({series.label, series.ink, series.mark, series.stroke, series.thin});
  for (const PlotBand& band : plot.bands)
    if (!band.label.empty() && !band.x.empty())
      entries.push_back({band.label, band.ink, Mark::kNone, Stroke::kNone, false, true});
  for (const PlotLine& line : plot.lines) {
    if (line.label.empty()) continue;
    const bool inside = (line.vertical ? x : y).Holds(line.position);
    entries.push_back({inside ? line.label : line.label + " (outside the plot)", line.ink,
                       Mark::kNone, line.stroke, false, false});
  }
  return entries;
}

double EntryWidthPx(const LegendEntry& entry) { return 30 + TextWidthPx(entry.label) + 14; }

// Breaks the legend into rows that fit; returns the positions of the entries relative to the first.
std::vector<std::pair<double, int>> LegendPlaces(const std::vector<LegendEntry>& entries,
                                                 double width_px) {
  std::vector<std::pair<double, int>> places;
  double x = 0;
  int row = 0;
  for (const LegendEntry& entry : entries) {
    if (x > 0 && x + EntryWidthPx(entry) > width_px) {
      x = 0;
      ++row;
    }
    places.emplace_back(x, row);
    x += EntryWidthPx(entry);
  }
  return places;
}

void AppendLegend(const std::vector<LegendEntry>& entries,
                  const std::vector<std::pair<double, int>>& places, double left, double top,
                  std::string* svg) {
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const LegendEntry& entry = entries[i];
    const double x = left + places[i].first;
    const double y = top + 10 + kLegendRowPx * places[i].second;
    *svg += fmt::format("<g class=\"{}\">", ClassOf(entry.ink));
    if (entry.band)
      *svg += fmt::format(
          "<rect class=\"band\" x=\"{:.1f}\" y=\"{:.1f}\" width=\"24\" height=\"10\"/>", x, y - 5);
    if (entry.stroke != Stroke::kNone)
      *svg += fmt::format(
          "<line class=\"{}\" x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\"{}/>",
          entry.thin ? "thin" : "line", x, y, x + 24, y, DashOf(entry.stroke));
    *svg += MarkAt(entry.mark, x + 12, y);
    *svg += "</g>";
    *svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\">{}</text>\n", x + 30, y + 4,
                        EscapeXml(entry.label));
  }
}

void AppendAxes(const Plot& plot, const Frame& frame, const std::vector<Tick>& x_ticks,
                const std::vector<Tick>& y_ticks, std::string* svg) {
  *svg += "<g class=\"grid\">";
  for (const Tick& tick : y_ticks)
    *svg += fmt::format("<line x1=\"{:.1f}\" x2=\"{:.1f}\" y1=\"{:.1f}\" y2=\"{:.1f}\"/>",
                        frame.left, frame.right, frame.Y(tick.at), frame.Y(tick.at));
  *svg += "</g>\n<g class=\"axis\">";
  *svg += fmt::format("<path d=\"M{:.1f} {:.1f}V{:.1f}H{:.1f}\"/>", frame.left, frame.top,
                      frame.bottom, frame.right);
  for (const Tick& tick : x_ticks)
    *svg += fmt::format("<path d=\"M{:.1f} {:.1f}v5\"/>", frame.X(tick.at), frame.bottom);
  *svg += "</g>\n";
  for (const Tick& tick : x_ticks)
    *svg += fmt::format("<text text-anchor=\"middle\" x=\"{:.1f}\" y=\"{:.1f}\">{}</text>",
                        frame.X(tick.at), frame.bottom + 19, tick.label);
  for (const Tick& tick : y_ticks)
    *svg += fmt::format("<text text-anchor=\"end\" x=\"{:.1f}\" y=\"{:.1f}\">{}</text>",
                        frame.left - 7, frame.Y(tick.at) + 4, tick.label);
  *svg +=
      fmt::format("\n<text class=\"name\" text-anchor=\"middle\" x=\"{:.1f}\" y=\"{}\">{}</text>\n",
                  (frame.left + frame.right) / 2, plot.height_px - 6, EscapeXml(plot.x_axis.label));
  const double middle = (frame.top + frame.bottom) / 2;
  *svg += fmt::format(
      "<text class=\"name\" text-anchor=\"middle\" transform=\"translate(13 {:.1f}) "
      "rotate(-90)\">{}</text>\n",
      middle, EscapeXml(plot.y_axis.label));
}

void AppendPolyline(const PlotSeries& series, const Frame& frame, std::string* svg) {
  std::string path;
  bool pen_down = false;
  for (std::size_t i = 0; i < std::min(series.x.size(), series.y.size()); ++i) {
    if (!std::isfinite(series.x[i]) || !std::isfinite(series.y[i])) {
      pen_down = false;
      continue;
    }
    // Far outside the frame a coordinate only determines the slope; renderers have problems with
    // huge ones.
    const double y = std::clamp(frame.Y(series.y[i]), -1e4, 1e4);
    path += fmt::format("{}{:.2f} {:.2f}", pen_down ? 'L' : 'M', frame.X(series.x[i]), y);
    pen_down = true;
  }
  if (!path.empty())
    *svg += fmt::format("<path class=\"{}\" d=\"{}\"{}/>", series.thin ? "thin" : "line", path,
                        DashOf(series.stroke));
}

// Goes from left to right along the upper curve and back along the lower one. A point where either
// is not finite ends the area, and the next point begins another.
void AppendBand(const PlotBand& band, const Frame& frame, std::string* svg) {
  const std::size_t count = std::min({band.x.size(), band.lo.size(), band.hi.size()});
  const auto point = [&](std::size_t i, double y) {
    return fmt::format("{:.2f} {:.2f}", frame.X(band.x[i]), std::clamp(frame.Y(y), -1e4, 1e4));
  };
  std::string path, upper, lower;
  const auto close = [&] {
    if (!upper.empty()) path += "M" + upper + lower + "Z";
    upper.clear();
    lower.clear();
  };
  for (std::size_t i = 0; i < count; ++i) {
    if (!std::isfinite(band.x[i]) || !std::isfinite(band.lo[i]) || !std::isfinite(band.hi[i])) {
      close();
      continue;
    }
    upper += (upper.empty() ? "" : "L") + point(i, band.hi[i]);
    lower = "L" + point(i, band.lo[i]) + lower;
  }
  close();
  if (!path.empty()) *svg += fmt::format("<path class=\"band\" d=\"{}\"/>", path);
}

// A triangle at the edge beyond which a point lies.
std::string BeyondMark(double x, double edge_y, bool upward) {
  const int rise = upward ? -6 : 6;
  return fmt::format("<path class=\"open\" d=\"M{:.1f} {:.1f}l3.5 {}l3.5 {}z\"/>", x - 3.5,
                     upward ? edge_y + 7 : edge_y - 7, rise, -rise);
}

void AppendMarks(const PlotSeries& series, const Frame& frame, std::string* svg) {
  if (series.mark == Mark::kNone) return;
  for (std::size_t i = 0; i < std::min(series.x.size(), series.y.size()); ++i) {
    if (!std::isfinite(series.x[i]) || !std::isfinite(series.y[i])) continue;
    if (!frame.x.Holds(series.x[i])) continue;
    const double x = frame.X(series.x[i]);
    const bool beyond = !frame.y.Holds(series.y[i]);
    if (!beyond && i < series.y_error.size() && series.y_error[i] > 0 &&
        std::isfinite(series.y_error[i])) {
      const double from = frame.Y(std::max(series.y[i] - series.y_error[i], frame.y.lo));
      const double to = frame.Y(std::min(series.y[i] + series.y_error[i], frame.y.hi));
      *svg += fmt::format("<path class=\"bar\" d=\"M{:.1f} {:.1f}V{:.1f}\"/>", x, from, to);
    }
    const bool above = series.y[i] > frame.y.hi;
    const std::string mark = beyond ? BeyondMark(x, above ? frame.top : frame.bottom, above)
                                    : MarkAt(series.mark, x, frame.Y(series.y[i]));
    if (i < series.names.size())
      *svg += fmt::format("<g><title>{}</title>{}</g>", EscapeXml(series.names[i]), mark);
    else
      *svg += mark;
  }
}

void AppendNotes(const Plot& plot, const Frame& frame, std::string* svg) {
  for (const PlotNote& note : plot.notes) {
    if (!frame.x.Holds(note.x) || !frame.y.Holds(note.y)) continue;
    const double width = TextWidthPx(note.text);
    const bool to_the_left = frame.X(note.x) + 10 + width > frame.right;
    *svg += fmt::format(
        "<text class=\"note\" text-anchor=\"{}\" x=\"{:.1f}\" y=\"{:.1f}\">{}</text>\n",
        to_the_left ? "end" : "start", frame.X(note.x) + (to_the_left ? -10 : 10),
        std::clamp(frame.Y(note.y) + 1.4 * kFontPx, frame.top + kFontPx, frame.bottom - 4),
        EscapeXml(note.text));
  }
}

}  // namespace

std::string SvgPlot(const Plot& given) {
  const Plot plot = WithLogarithms(given);
  Frame frame;
  frame.x = RangeOf(plot, true);
  frame.y = RangeOf(plot, false);
  frame.right = plot.width_px - 14;

  const std::vector<LegendEntry> legend = LegendOf(plot, frame.x, frame.y);
  // The rows of the legend determine the height, the height the ticks, and their labels the left
  // margin.
  const double legend_left = 30;
  const double heading_px = plot.heading.empty() ? 0 : 20;
  const std::vector<std::pair<double, int>> places =
      LegendPlaces(legend, frame.right - legend_left);
  frame.top = heading_px + (legend.empty() ? 10 : 14 + kLegendRowPx * (places.back().second + 1));
  frame.bottom = plot.height_px - 46;
  const std::vector<Tick> y_ticks =
      TicksOf(plot.y_axis, frame.y, std::max(2, static_cast<int>((frame.bottom - frame.top) / 26)));
  // Room for at least four characters, so that figures below each other mostly share their left
  // edge.
  double label_width = 4 * kCharWidthPx;
  for (const Tick& tick : y_ticks) label_width = std::max(label_width, TextWidthPx(tick.label));
  frame.left = 26 + label_width + 8;
  const double widest_x_label =
      plot.x_axis.logarithmic ? 6 * kCharWidthPx  // "0.0005"
                              : std::max(TextWidthPx(TickLabel(frame.x.lo, frame.x.span() / 10)),
                                         TextWidthPx(TickLabel(frame.x.hi, frame.x.span() / 10)));
  const std::vector<Tick> x_ticks =
      TicksOf(plot.x_axis, frame.x,
              std::max(2, static_cast<int>((frame.right - frame.left) / (widest_x_label + 40))));

  const std::string id = EscapeXml(plot.id);
  std::string svg = fmt::format(
      "<svg class=\"plot\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" role=\"img\" "
      "aria-labelledby=\"{2}-title\">\n<title id=\"{2}-title\">{3}</title>\n",
      plot.width_px, plot.height_px, id, EscapeXml(plot.title));
  svg += fmt::format(
      "<clipPath id=\"{}-clip\"><rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" "
      "height=\"{:.1f}\"/></clipPath>\n",
      id, frame.left, frame.top, frame.right - frame.left, frame.bottom - frame.top);
  if (!plot.heading.empty())
    svg += fmt::format("<text class=\"heading\" x=\"{:.1f}\" y=\"13\">{}</text>\n", legend_left,
                       EscapeXml(plot.heading));
  AppendLegend(legend, places, legend_left, heading_px, &svg);
  AppendAxes(plot, frame, x_ticks, y_ticks, &svg);
  svg += fmt::format("<g clip-path=\"url(#{}-clip)\">\n", id);
  for (const PlotBand& band : plot.bands) {
    svg += fmt::format("<g class=\"{}\">", ClassOf(band.ink));
    AppendBand(band, frame, &svg);
    svg += "</g>\n";
  }
  for (const PlotLine& line : plot.lines) {
    if (!(line.vertical ? frame.x : frame.y).Holds(line.position)) continue;
    const double at = line.vertical ? frame.X(line.position) : frame.Y(line.position);
    svg += fmt::format("<g class=\"{}\"><path class=\"{}\" d=\"M{:.1f} {:.1f}{}{:.1f}\"{}/></g>\n",
                       ClassOf(line.ink), "line", line.vertical ? at : frame.left,
                       line.vertical ? frame.top : at, line.vertical ? 'V' : 'H',
                       line.vertical ? frame.bottom : frame.right, DashOf(line.stroke));
  }
  for (const PlotSeries& series : plot.series) {
    if (series.stroke == Stroke::kNone) continue;
    svg += fmt::format("<g class=\"{}\">", ClassOf(series.ink));
    AppendPolyline(series, frame, &svg);
    svg += "</g>\n";
  }
  svg += "</g>\n";
  for (const PlotSeries& series : plot.series) {
    svg += fmt::format("<g class=\"{}\">", ClassOf(series.ink));
    AppendMarks(series, frame, &svg);
    svg += "</g>\n";
  }
  AppendNotes(plot, frame, &svg);
  svg += "</svg>\n";
  return svg;
}

}  // namespace thicklens::tools
