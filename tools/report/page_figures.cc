#include "tools/report/page_figures.h"

#include <fmt/format.h>

#include <cmath>
#include <vector>

#include "thicklens/base/printable_text.h"
#include "tools/report/svg_plot.h"

namespace thicklens::tools {

std::string Cell(const std::string& image, const std::string& label) {
  return fmt::format("<div>{}{}</div>\n", image,
                     label.empty() ? "" : fmt::format("<span>{}</span>", EscapeXml(label)));
}

std::string Grid(int columns, const std::string& cells, const std::string& css_class) {
  return fmt::format("<div class=\"{}\" style=\"--columns: {}\">\n{}</div>\n",
                     css_class.empty() ? "images" : "images " + css_class, columns, cells);
}

std::string Figure(const std::string& content, const std::string& title,
                   const std::string& caption) {
  return fmt::format("<figure>\n{}<figcaption><b>{}.</b> {}</figcaption>\n</figure>\n", content,
                     EscapeXml(title), EscapeXml(caption));
}

std::string ColourScale(const std::string& id, double lo, double hi, const std::string& unit,
                        const std::function<std::string(double)>& colour) {
  constexpr int kWidthPx = 440, kBarPx = 12, kMarginPx = 24;
  const double bar_px = kWidthPx - 2.0 * kMarginPx;
  std::string svg = fmt::format(
      "<svg class=\"scale\" viewBox=\"0 0 {0} 44\" width=\"{0}\" height=\"44\" role=\"img\" "
      "aria-labelledby=\"{4}-scale-title\">\n<title id=\"{4}-scale-title\">The colours from "
      "{1:.4g} to {2:.4g} {3}</title>\n<defs><linearGradient id=\"{4}-colours\">",
      kWidthPx, lo, hi, EscapeXml(unit), id);
  constexpr int kStops = 16;
  for (int i = 0; i <= kStops; ++i) {
    const double share = static_cast<double>(i) / kStops;
    svg += fmt::format("<stop offset=\"{:.4f}\" stop-color=\"{}\"/>", share,
                       colour(lo + share * (hi - lo)));
  }
  svg += fmt::format(
      "</linearGradient></defs>\n<rect x=\"{}\" y=\"0\" width=\"{}\" height=\"{}\" "
      "fill=\"url(#{}-colours)\"/>\n",
      kMarginPx, bar_px, kBarPx, id);
  const std::vector<double> ticks = NiceTicks(lo, hi, 6);
  const double step = ticks.size() > 1 ? ticks[1] - ticks[0] : 0;
  for (double tick : ticks) {
    const double x = kMarginPx + (tick - lo) / (hi - lo) * bar_px;
    svg += fmt::format(
        "<path d=\"M{0:.1f} {1}v4\"/><text text-anchor=\"middle\" x=\"{0:.1f}\" y=\"27\">{2}"
        "</text>\n",
        x, kBarPx, TickLabel(tick, step > 0 ? step : std::abs(tick)));
  }
  return svg + fmt::format("<text text-anchor=\"middle\" x=\"{}\" y=\"42\">{}</text>\n</svg>\n",
                           kWidthPx / 2, EscapeXml(unit));
}

}  // namespace thicklens::tools
