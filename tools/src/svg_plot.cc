#include "svg_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <limits>

namespace thicklens::tools {
namespace {

constexpr char kReplacement[] = "\xEF\xBF\xBD";  // U+FFFD
constexpr double kFontPx = 12;
// Wide enough for the widest of the usual system fonts, so that nothing overlaps in any of them.
constexpr double kCharWidthPx = 7.2;
constexpr double kLegendRowPx = 20;

std::size_t CodePoints(const std::string& text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

double TextWidthPx(const std::string& text) {
  return kCharWidthPx * static_cast<double>(CodePoints(text));
}

// Length of the well-formed, printable UTF-8 sequence at `at`; 0 if there is none. Surrogates,
// overlong forms and U+FFFE, U+FFFF count as broken.
std::size_t PrintableLength(const std::string& text, std::size_t at) {
  const auto byte = [&](std::size_t i) -> std::uint32_t {
    return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u;
  };
  const std::uint32_t lead = byte(at);
  if (lead < 0x80) return lead >= 0x20 && lead != 0x7F ? 1 : 0;
  const std::size_t length = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (lead < 0xC2 || lead > 0xF4) return 0;
  std::uint32_t code = lead & (0x7Fu >> length);
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(at + i) & 0xC0) != 0x80) return 0;
    code = code << 6 | (byte(at + i) & 0x3F);
  }
  constexpr std::uint32_t kSmallestOfLength[] = {0, 0, 0xA0, 0x800, 0x10000};
  if (code < kSmallestOfLength[length] || code > 0x10FFFF) return 0;
  if ((code >= 0xD800 && code <= 0xDFFF) || code == 0xFFFE || code == 0xFFFF) return 0;
  return length;
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

// Half the data's span is as far as a line or an error bar may stretch the plot.
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

// The drawing area and how numbers map into it.
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
};

std::vector<LegendEntry> LegendOf(const Plot& plot, const Interval& x, const Interval& y) {
  std::vector<LegendEntry> entries;
  for (const PlotSeries& series : plot.series)
    if (!series.label.empty() && !series.x.empty())
      entries.push_back({series.label, series.ink, series.mark, series.stroke});
  for (const PlotLine& line : plot.lines) {
    if (line.label.empty()) continue;
    const bool inside = (line.vertical ? x : y).Holds(line.position);
    entries.push_back({inside ? line.label : line.label + " (outside the plot)", line.ink,
                       Mark::kNone, line.stroke});
  }
  return entries;
}

double EntryWidthPx(const LegendEntry& entry) { return 30 + TextWidthPx(entry.label) + 14; }

// Breaks the legend into rows that fit; returns the entries' places relative to the first.
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
                  const std::vector<std::pair<double, int>>& places, double left,
                  std::string* svg) {
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const LegendEntry& entry = entries[i];
    const double x = left + places[i].first;
    const double y = 10 + kLegendRowPx * places[i].second;
    *svg += fmt::format("<g class=\"{}\">", ClassOf(entry.ink));
    if (entry.stroke != Stroke::kNone)
      *svg += fmt::format(
          "<line class=\"line\" x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\"{}/>", x, y,
          x + 24, y, DashOf(entry.stroke));
    *svg += MarkAt(entry.mark, x + 12, y);
    *svg += "</g>";
    *svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\">{}</text>\n", x + 30, y + 4,
                        EscapeXml(entry.label));
  }
}

double StepOf(const std::vector<double>& ticks) {
  return ticks.size() > 1 ? ticks[1] - ticks[0] : std::abs(ticks.empty() ? 1.0 : ticks[0]);
}

void AppendAxes(const Plot& plot, const Frame& frame, const std::vector<double>& x_ticks,
                const std::vector<double>& y_ticks, std::string* svg) {
  *svg += "<g class=\"grid\">";
  for (double tick : y_ticks)
    *svg += fmt::format("<line x1=\"{:.1f}\" x2=\"{:.1f}\" y1=\"{:.1f}\" y2=\"{:.1f}\"/>",
                        frame.left, frame.right, frame.Y(tick), frame.Y(tick));
  *svg += "</g>\n<g class=\"axis\">";
  *svg += fmt::format("<path d=\"M{:.1f} {:.1f}V{:.1f}H{:.1f}\"/>", frame.left, frame.top,
                      frame.bottom, frame.right);
  for (double tick : x_ticks)
    *svg += fmt::format("<path d=\"M{:.1f} {:.1f}v5\"/>", frame.X(tick), frame.bottom);
  *svg += "</g>\n";
  for (double tick : x_ticks)
    *svg += fmt::format("<text text-anchor=\"middle\" x=\"{:.1f}\" y=\"{:.1f}\">{}</text>",
                        frame.X(tick), frame.bottom + 19, TickLabel(tick, StepOf(x_ticks)));
  for (double tick : y_ticks)
    *svg += fmt::format("<text text-anchor=\"end\" x=\"{:.1f}\" y=\"{:.1f}\">{}</text>",
                        frame.left - 7, frame.Y(tick) + 4, TickLabel(tick, StepOf(y_ticks)));
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
    // Far outside the frame a coordinate serves the slope alone; renderers dislike huge ones.
    const double y = std::clamp(frame.Y(series.y[i]), -1e4, 1e4);
    path += fmt::format("{}{:.2f} {:.2f}", pen_down ? 'L' : 'M', frame.X(series.x[i]), y);
    pen_down = true;
  }
  if (!path.empty())
    *svg += fmt::format("<path class=\"line\" d=\"{}\"{}/>", path, DashOf(series.stroke));
}

// A triangle at the edge that a point lies beyond.
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

std::string PrintableUtf8(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = PrintableLength(text, i);
    if (length == 0) {
      out += kReplacement;
      ++i;
    } else {
      out.append(text, i, length);
      i += length;
    }
  }
  return out;
}

std::string EscapeXml(const std::string& text) {
  std::string out;
  for (char c : PrintableUtf8(text)) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::vector<double> NiceTicks(double lo, double hi, int at_most) {
  std::vector<double> ticks;
  if (!std::isfinite(lo) || !std::isfinite(hi) || !(lo < hi) || at_most < 1) return ticks;
  const double span = hi - lo;
  const double power = std::pow(10, std::floor(std::log10(span / at_most)));
  for (double factor : {1.0, 2.0, 5.0, 10.0, 20.0, 50.0}) {
    const double step = factor * power;
    const double first = std::ceil(lo / step - 1e-9);
    const double last = std::floor(hi / step + 1e-9);
    if (last - first + 1 > at_most) continue;
    // Multiples of the step, not a running sum: zero comes out as zero.
    for (int i = 0; i <= static_cast<int>(last - first); ++i) ticks.push_back((first + i) * step);
    return ticks;
  }
  return ticks;
}

std::string TickLabel(double value, double step) {
  const int decimals =
      step > 0 ? std::clamp(static_cast<int>(std::ceil(-std::log10(step) - 1e-9)), 0, 9) : 0;
  std::string label = std::abs(value) >= 1e6 ? fmt::format("{:.3g}", value)
                                             : fmt::format("{:.{}f}", value, decimals);
  if (label[0] == '-') label.replace(0, 1, "\xE2\x88\x92");  // U+2212
  return label;
}

std::string SvgPlot(const Plot& plot) {
  Frame frame;
  frame.x = RangeOf(plot, true);
  frame.y = RangeOf(plot, false);
  frame.right = plot.width_px - 14;

  const std::vector<LegendEntry> legend = LegendOf(plot, frame.x, frame.y);
  // The legend's rows decide the height, the height the ticks, their labels the left margin.
  const double legend_left = 30;
  const std::vector<std::pair<double, int>> places =
      LegendPlaces(legend, frame.right - legend_left);
  frame.top = legend.empty() ? 10 : 14 + kLegendRowPx * (places.back().second + 1);
  frame.bottom = plot.height_px - 46;
  const std::vector<double> y_ticks = NiceTicks(
      frame.y.lo, frame.y.hi, std::max(2, static_cast<int>((frame.bottom - frame.top) / 26)));
  // Room for four characters at least: figures below each other then mostly share their left edge.
  double label_width = 4 * kCharWidthPx;
  for (double tick : y_ticks)
    label_width = std::max(label_width, TextWidthPx(TickLabel(tick, StepOf(y_ticks))));
  frame.left = 26 + label_width + 8;
  const double widest_x_label = std::max(TextWidthPx(TickLabel(frame.x.lo, frame.x.span() / 10)),
                                         TextWidthPx(TickLabel(frame.x.hi, frame.x.span() / 10)));
  const std::vector<double> x_ticks =
      NiceTicks(frame.x.lo, frame.x.hi,
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
  AppendLegend(legend, places, legend_left, &svg);
  AppendAxes(plot, frame, x_ticks, y_ticks, &svg);
  svg += fmt::format("<g clip-path=\"url(#{}-clip)\">\n", id);
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

std::string SvgPlotStyle() {
  // Colours after Okabe and Ito, told apart by colour-blind readers; lighter ones on dark paper.
  return R"(:root { --fit: #0072b2; --source: #d55e00; --peak: #008a64; --data: #4a4f57;
  --muted: #8d949e; --truth: #b8578d; --axis: #7a818b; --grid: #e6e8eb; }
@media (prefers-color-scheme: dark) {
  :root { --fit: #56b4e9; --source: #f08c3a; --peak: #35c79c; --data: #ccd1d8;
    --muted: #838a95; --truth: #e39cc3; --axis: #8d949e; --grid: #2c3139; } }
@media print {
  :root { --fit: #0072b2; --source: #d55e00; --peak: #008a64; --data: #4a4f57;
    --muted: #8d949e; --truth: #b8578d; --axis: #7a818b; --grid: #e6e8eb; } }
.plot { display: block; max-width: 100%; height: auto; font-size: 12px; }
.plot text { fill: currentColor; font-variant-numeric: tabular-nums; }
.plot .note { font-style: italic; }
.plot .grid line { stroke: var(--grid); stroke-width: 1; }
.plot .axis path { stroke: var(--axis); stroke-width: 1; fill: none; }
.ink-fit { color: var(--fit); } .ink-source { color: var(--source); }
.ink-peak { color: var(--peak); } .ink-data { color: var(--data); }
.ink-muted { color: var(--muted); } .ink-truth { color: var(--truth); }
.plot .line { stroke: currentColor; stroke-width: 1.6; fill: none; }
.plot .bar { stroke: currentColor; stroke-width: 1; opacity: .6; fill: none; }
.plot .full { fill: currentColor; }
.plot .open { stroke: currentColor; stroke-width: 1.3; fill: none; }
)";
}

}  // namespace thicklens::tools
