#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "thicklens/base/printable_text.h"
#include "tools/report/calibration_figures.h"
#include "tools/report/page_images.h"
#include "tools/report/rounding.h"

namespace thicklens::tools {
namespace {

using calib::FieldMap;
using calib::FieldTile;

constexpr double kWidthPx = 860;
constexpr double kLeftPx = 64, kTopPx = 12;
constexpr double kWidestTilePx = 116;
constexpr double kLineHeightPx = 15;
// The position along the colours from which the text is dark instead of white.
constexpr double kDarkWordsFrom = 0.45;

struct Layout {
  double tile_width_px = 0, tile_height_px = 0;
  double X(int column) const { return kLeftPx + column * tile_width_px; }
  double Y(int row) const { return kTopPx + row * tile_height_px; }
};

// The tiles have the shape that they have in the image, but are not too flat for their text.
Layout LayoutOf(const FieldMap& field) {
  Layout layout;
  layout.tile_width_px = std::min(kWidestTilePx, (kWidthPx - kLeftPx) / field.columns);
  double ratio = 0.75;
  if (field.columns > 1 && field.rows > 1) {
    const Eigen::Vector2d steps_px =
        field.tiles[static_cast<std::size_t>(field.columns) + 1].centre_px -
        field.tiles[0].centre_px;
    if (steps_px.x() > 0 && steps_px.y() > 0) ratio = steps_px.y() / steps_px.x();
  }
  layout.tile_height_px =
      std::clamp(ratio * layout.tile_width_px, 4.4 * kLineHeightPx, 1.2 * kWidestTilePx);
  return layout;
}

ColourRange RangeOf(const FieldMap& field) {
  ColourRange range{std::numeric_limits<double>::infinity(),
                    -std::numeric_limits<double>::infinity(), false};
  for (const FieldTile& tile : field.tiles) {
    if (!tile.done || !std::isfinite(tile.focus_depth_mm.value)) continue;
    range.lo = std::min(range.lo, tile.focus_depth_mm.value);
    range.hi = std::max(range.hi, tile.focus_depth_mm.value);
  }
  return range;
}

// The median standard deviation of the tiles; 0 if none has one.
double MedianSigmaMm(const FieldMap& field) {
  std::vector<double> sigmas_mm;
  for (const FieldTile& tile : field.tiles)
    if (tile.done && UsableSigma(tile.focus_depth_mm.sigma))
      sigmas_mm.push_back(tile.focus_depth_mm.sigma);
  if (sigmas_mm.empty()) return 0;
  const auto middle = sigmas_mm.begin() + static_cast<std::ptrdiff_t>(sigmas_mm.size() / 2);
  std::nth_element(sigmas_mm.begin(), middle, sigmas_mm.end());
  return *middle;
}

// Widens the range of the colours, so that noise does not use all of them.
ColourRange WideEnough(ColourRange range, double sigma_mm) {
  constexpr double kMinSigmas = 3;  // on each side of the middle
  const double middle = (range.lo + range.hi) / 2;
  range.lo = std::min(range.lo, middle - kMinSigmas * sigma_mm);
  range.hi = std::max(range.hi, middle + kMinSigmas * sigma_mm);
  return range;
}

std::string Word(double x, double y, const std::string& css_class, const std::string& text) {
  return fmt::format("<text{} text-anchor=\"middle\" x=\"{:.1f}\" y=\"{:.1f}\">{}</text>",
                     css_class.empty() ? "" : " class=\"" + css_class + "\"", x, y,
                     EscapeXml(text));
}

std::string TileDrawing(const FieldMap& field, const FieldTile& tile, const Layout& layout,
                        int index, const ColourRange& range, double digits_mm) {
  const double x = layout.X(index % field.columns), y = layout.Y(index / field.columns);
  const double middle_x = x + layout.tile_width_px / 2, middle_y = y + layout.tile_height_px / 2;
  const std::string where =
      fmt::format("tile at ({:.0f}, {:.0f}) px", tile.centre_px.x(), tile.centre_px.y());
  const std::string box =
      fmt::format("x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\"", x + 1, y + 1,
                  layout.tile_width_px - 2, layout.tile_height_px - 2);
  const model::Estimate& focus = tile.focus_depth_mm;
  if (!tile.done || !std::isfinite(focus.value))
    return fmt::format("<g><title>{}</title><rect class=\"empty\" {}/>{}</g>\n",
                       EscapeXml(where + ": none, " + tile.message), box,
                       Word(middle_x, middle_y + 4, "", "–"));
  const double position = range.Position(focus.value);
  const std::string css_class = position < kDarkWordsFrom ? "on-dark" : "on-light";
  std::vector<std::string> lines = {RoundedTo(focus.value, digits_mm)};
  if (UsableSigma(focus.sigma)) lines.push_back("± " + RoundedTo(focus.sigma, digits_mm));
  if (UsableSigma(tile.blur_ratio.sigma)) {
    lines.push_back("κ " + RoundedTo(tile.blur_ratio.value, tile.blur_ratio.sigma));
  }
  if (field.clusters.size() > 1) lines.push_back(fmt::format("depth {}", tile.cluster + 1));
  std::string words;
  const double first_y = middle_y + 4 - kLineHeightPx * (static_cast<double>(lines.size()) - 1) / 2;
  for (std::size_t i = 0; i < lines.size(); ++i)
    words += Word(middle_x, first_y + kLineHeightPx * static_cast<double>(i), css_class, lines[i]);
  return fmt::format(
      "<g><title>{}</title><rect fill=\"{}\" {}/>{}</g>\n",
      EscapeXml(fmt::format("{}: zf = {} ± {} mm, κ = {} ± {}", where,
                            RoundedTo(focus.value, focus.sigma), RoundedSigma(focus.sigma),
                            RoundedTo(tile.blur_ratio.value, tile.blur_ratio.sigma),
                            RoundedSigma(tile.blur_ratio.sigma))),
      MapColourCss(position), box, words);
}

// The pixel positions of the tiles' centres along the field's left and lower edge.
std::string Margins(const FieldMap& field, const Layout& layout) {
  std::string svg;
  const auto centre_px = [&](int column, int row) {
    return field.tiles[static_cast<std::size_t>(row * field.columns + column)].centre_px;
  };
  for (int row = 0; row < field.rows; ++row)
    svg += fmt::format("<text text-anchor=\"end\" x=\"{:.1f}\" y=\"{:.1f}\">{:.0f}</text>",
                       kLeftPx - 7, layout.Y(row) + layout.tile_height_px / 2 + 4,
                       centre_px(0, row).y());
  for (int column = 0; column < field.columns; ++column)
    svg += Word(layout.X(column) + layout.tile_width_px / 2, layout.Y(field.rows) + 17, "",
                fmt::format("{:.0f}", centre_px(column, 0).x()));
  svg += Word((layout.X(0) + layout.X(field.columns)) / 2, layout.Y(field.rows) + 36, "name",
              "x in the image [px]");
  svg += fmt::format(
      "<text class=\"name\" text-anchor=\"middle\" transform=\"translate(13 {:.1f}) "
      "rotate(-90)\">y in the image [px]</text>\n",
      (layout.Y(0) + layout.Y(field.rows)) / 2);
  return svg;
}

// The colours, from the nearest to the farthest.
std::string ColourBar(const ColourRange& range, double top) {
  constexpr int kSteps = 40;
  constexpr double kStepPx = 6, kHeightPx = 10;
  std::string svg;
  for (int i = 0; i < kSteps; ++i)
    svg += fmt::format(
        "<rect fill=\"{}\" x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{}\"/>",
        MapColourCss((i + 0.5) / kSteps), kLeftPx + kStepPx * i, top, kStepPx + 0.5, kHeightPx);
  const double digits = (range.hi - range.lo) / 20;
  svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\">{} … {} mm</text>\n",
                     kLeftPx + kStepPx * kSteps + 10, top + kHeightPx, RoundedTo(range.lo, digits),
                     RoundedTo(range.hi, digits));
  return svg;
}

}  // namespace

ReportFigure FieldFigure(const FieldMap& field) {
  if (!field.done || field.columns < 1 || field.rows < 1 ||
      field.tiles.size() != static_cast<std::size_t>(field.columns * field.rows))
    return {};
  const ColourRange range = RangeOf(field);
  if (!(range.lo <= range.hi)) return {};
  const double sigma_mm = MedianSigmaMm(field);
  const ColourRange colours = WideEnough(range, sigma_mm);
  const Layout layout = LayoutOf(field);
  const double bar_top = layout.Y(field.rows) + 52;
  const double width_px = std::max(layout.X(field.columns) + 8, kLeftPx + 420);
  std::string svg = fmt::format(
      "<svg class=\"plot\" viewBox=\"0 0 {0:.0f} {1:.0f}\" width=\"{0:.0f}\" height=\"{1:.0f}\" "
      "role=\"img\" aria-labelledby=\"field-title\">\n<title id=\"field-title\">In-focus object "
      "distance "
      "over the field, {2} to {3} mm</title>\n",
      width_px, bar_top + 18, RoundedTo(range.lo, (range.hi - range.lo) / 20),
      RoundedTo(range.hi, (range.hi - range.lo) / 20));
  for (std::size_t i = 0; i < field.tiles.size(); ++i)
    svg += TileDrawing(field, field.tiles[i], layout, static_cast<int>(i), colours, sigma_mm);
  svg += Margins(field, layout);
  if (colours.hi > colours.lo) svg += ColourBar(colours, bar_top);
  svg += "</svg>\n";
  return {
      {{"field", svg}},
      "In-focus object distance zf [mm], fitted separately for each part of the image, with its "
      "standard deviation, and the blur ratio κ of the part. One side brighter than the other: "
      "the target is tilted; brightness "
      "changing from the centre outward: the field is curved. The colours span at least ± 3 "
      "median standard deviations.",
      false};
}

}  // namespace thicklens::tools
