#include "tools/report/light_field_figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "thicklens/base/printable_text.h"
#include "thicklens/estimator/render.h"
#include "tools/report/calibration_summary.h"
#include "tools/report/estimate_figures.h"
#include "tools/report/page_figures.h"
#include "tools/report/page_images.h"
#include "tools/report/page_style.h"
#include "tools/report/svg_plot.h"

namespace thicklens::tools {
namespace {

// The longest edges of the images in the page: twice what a page of 940 px shows, unless the page
// would be too large.
constexpr int kThumbnailPx = 240;
constexpr int kTriplePx = 512;
constexpr int kPhotoPx = 640;
constexpr int kRefocusPx = 400;
constexpr int kEpipolarPx = 1000;
constexpr int kMaxThumbnailViews = 5;  // per axis, shown as thumbnails
constexpr int kRefocusDepths = 5;
// The share of the nearest and of the farthest depths that count as outliers.
constexpr double kOutliers = 0.01;

// Chooses up to `at_most` of `count` indices evenly, including both ends.
std::vector<int> EvenlyChosen(int count, int at_most) {
  std::vector<int> chosen;
  const int shown = std::min(count, at_most);
  for (int i = 0; i < shown; ++i) {
    chosen.push_back(shown == 1 ? 0
                                : static_cast<int>(std::lround(static_cast<double>(i) *
                                                               (count - 1) / (shown - 1))));
  }
  return chosen;
}

std::string DepthUnit(const PageDepth& depth) {
  return depth.in_mm ? "mm from the aperture" : "px of disparity per view step";
}

std::vector<float> SortedKnown(const PageDepth& depth) {
  std::vector<float> known;
  known.reserve(depth.values.size());
  for (float value : depth.values) {
    if (std::isfinite(value)) known.push_back(value);
  }
  std::sort(known.begin(), known.end());
  return known;
}

// Returns the range of the values without the outliers; `known` is sorted and not empty.
std::pair<double, double> UsualRange(const std::vector<float>& known) {
  const double last = static_cast<double>(known.size() - 1);
  const auto at = [&](double share) {
    return static_cast<double>(known[static_cast<std::size_t>(std::lround(share * last))]);
  };
  return {at(kOutliers), at(1 - kOutliers)};
}

std::string DepthCell(const PageDepth& depth, bool zero_in_focus, std::string* caption) {
  const std::vector<float> known = SortedKnown(depth);
  ColourRange range;
  range.bright_is_low = depth.in_mm;
  std::string scale;
  if (!known.empty()) {
    std::tie(range.lo, range.hi) = UsualRange(known);
    if (range.hi > range.lo) {
      scale = ColourScale("depth", range.lo, range.hi, DepthUnit(depth),
                          [&range](double value) { return MapColourCss(range.Position(value)); });
    }
    *caption += TrueMinus(fmt::format(" Its depth ranges from {:.4g} to {:.4g} {}; bright is near.",
                                      known.front(), known.back(), DepthUnit(depth)));
    if (!depth.in_mm) {
      *caption += zero_in_focus ? " Zero disparity is the plane of focus."
                                : " Zero disparity is the ST plane.";
    }
  }
  const std::size_t holes = depth.values.size() - known.size();
  if (holes > 0) {
    *caption +=
        fmt::format(" Hatched in grey: {} px ({:.1f} %) without a depth.", holes,
                    100.0 * static_cast<double>(holes) / static_cast<double>(depth.values.size()));
  }
  const cv::Mat shown =
      ColourMapped(depth.values, depth.width_px, depth.height_px, range, kPhotoPx);
  return fmt::format("<div>{}{}</div>\n",
                     EmbeddedImage(shown, "Depth map in colours", Packing::kExact, PlacePx(2)),
                     scale);
}

std::string ViewName(int k, int l) { return fmt::format("u {}, v {}", k, l); }

std::string ViewThumbnails(const LightFieldPageInput& input) {
  const model::LightField& light_field = *input.light_field;
  const std::vector<int> columns = EvenlyChosen(light_field.u_count, kMaxThumbnailViews);
  const std::vector<int> rows = EvenlyChosen(light_field.v_count, kMaxThumbnailViews);
  std::string cells;
  for (int l : rows) {
    for (int k : columns) {
      if (!light_field.IsPresent(k, l)) {
        cells += Cell("", fmt::format("{}: missing", ViewName(k, l)));
        continue;
      }
      const cv::Mat shown = ShownImage(model::ViewImage(light_field, k, l), kThumbnailPx);
      cells += Cell(EmbeddedImage(shown, "View " + ViewName(k, l), Packing::kSmall,
                                  PlacePx(static_cast<int>(columns.size()))),
                    ViewName(k, l));
    }
  }
  const std::size_t shown = columns.size() * rows.size();
  const int all = light_field.u_count * light_field.v_count;
  std::string caption =
      static_cast<int>(shown) == all
          ? fmt::format(
                "All {} views, each as a pinhole at that place of the aperture would see "
                "the scene: u counts from left to right, v from top to bottom.",
                all)
          : fmt::format(
                "{} of the {} views, evenly chosen with the outermost ones, each as a "
                "pinhole at that place of the aperture would see the scene: u counts from "
                "left to right, v from top to bottom.",
                shown, all);
  caption +=
      " From left to right, points nearer than the plane of focus move left, and farther ones move "
      "right. Every view should be sharp at all depths.";
  return Figure(Grid(static_cast<int>(columns.size()), cells, "views"), "The views", caption);
}

// Three views far apart: along u in the middle row, or along v if there is only one column.
struct ViewIndex {
  int k = 0, l = 0;
};
std::vector<ViewIndex> OuterAndCentreViews(const LightFieldPageInput& input) {
  const model::LightField& light_field = *input.light_field;
  const bool along_u = light_field.u_count > 1;
  std::vector<ViewIndex> candidates;
  for (int i = 0; i < (along_u ? light_field.u_count : light_field.v_count); ++i) {
    const ViewIndex view =
        along_u ? ViewIndex{i, light_field.v_count / 2} : ViewIndex{light_field.u_count / 2, i};
    const bool in_both = light_field.IsPresent(view.k, view.l) &&
                         (input.truth == nullptr || input.truth->IsPresent(view.k, view.l));
    if (in_both) candidates.push_back(view);
  }
  std::vector<ViewIndex> chosen;
  for (int i : EvenlyChosen(static_cast<int>(candidates.size()), 3)) {
    chosen.push_back(candidates[static_cast<std::size_t>(i)]);
  }
  return chosen;
}

std::string LargeViews(const LightFieldPageInput& input) {
  const std::vector<ViewIndex> views = OuterAndCentreViews(input);
  if (views.empty()) return "";
  const int columns = static_cast<int>(views.size());
  std::vector<std::pair<cv::Mat, cv::Mat>> pairs;
  std::string cells;
  const auto add = [&](const cv::Mat& shown, const std::string& what, const ViewIndex& view) {
    const std::string label = fmt::format("{}, {}", what, ViewName(view.k, view.l));
    cells += Cell(EmbeddedImage(shown, label, Packing::kSmall, PlacePx(columns)), label);
  };
  const auto shown_view = [](const model::LightField& light_field, const ViewIndex& view) {
    return ShownImage(model::ViewImage(light_field, view.k, view.l), kTriplePx);
  };
  for (const ViewIndex& view : views) {
    const cv::Mat shown = shown_view(*input.light_field, view);
    add(shown, input.truth == nullptr ? "view" : "estimate", view);
    if (input.truth != nullptr) pairs.emplace_back(shown, shown_view(*input.truth, view));
  }
  const std::string direction =
      input.light_field->u_count > 1
          ? "leftmost, the middle and the rightmost view of the middle row"
          : "uppermost, the middle and the lowest view of the middle column";
  if (input.truth == nullptr) {
    return Figure(Grid(columns, cells), "Across the aperture",
                  fmt::format("The {}, larger. Compare the positions of the edges of near and far "
                              "objects, and look for ghosts beside them.",
                              direction));
  }
  for (std::size_t i = 0; i < views.size(); ++i) add(pairs[i].second, "truth", views[i]);
  const int gain = GainForDifferences(pairs);
  for (std::size_t i = 0; i < views.size(); ++i) {
    add(AmplifiedDifference(pairs[i].first, pairs[i].second, gain),
        fmt::format("difference × {}", gain), views[i]);
  }
  return Figure(
      Grid(columns, cells), "Estimate, truth and their difference",
      fmt::format("The {}. The estimate is at the top, the true view below it, and at the bottom "
                  "the difference (estimate minus truth, of the values shown, amplified {} times): "
                  "grey means no difference. Outlines mean misplaced or blurred edges, and patches "
                  "beside near objects are areas that the photograph does not show.",
                  direction, gain));
}

// How often each row of an epipolar image is repeated, so that the image is about as high as a
// thumbnail on the page.
int EpipolarRepeat(const model::LightField& light_field) {
  constexpr double kHeightPx = 130;
  const double zoom =
      std::clamp(static_cast<double>(kPageColumnPx) / light_field.s_count, 1.0, 4.0);
  return std::max(1, static_cast<int>(std::lround(kHeightPx / zoom / light_field.u_count)));
}

// Three rows that divide the height into four parts, if there are that many.
std::vector<int> EpipolarRows(const model::LightField& light_field) {
  std::vector<int> rows;
  for (int i = 1; i <= 3; ++i) {
    const int t = light_field.t_count * i / 4;
    if (rows.empty() || t != rows.back()) rows.push_back(t);
  }
  return rows;
}

struct RefocusPlane {
  Eigen::Vector2d disparity_px{0, 0};
  std::string label;
};

// Returns planes from near to far, evenly spaced in disparity.
std::vector<RefocusPlane> RefocusPlanes(const LightFieldPageInput& input) {
  std::vector<RefocusPlane> planes;
  if (!input.depth) return planes;
  const std::vector<float> known = SortedKnown(*input.depth);
  if (known.empty()) return planes;
  constexpr double kSmallPx = 0.2;  // of such a range, the labels need one digit more
  const auto [lo, hi] = UsualRange(known);
  const int count = hi > lo ? kRefocusDepths : 1;
  for (int i = 0; i < count; ++i) {
    const double share = count > 1 ? static_cast<double>(i) / (count - 1) : 0;
    if (input.depth->in_mm) {
      const double depth_mm = 1 / (1 / lo + share * (1 / hi - 1 / lo));
      planes.push_back({estimator::DisparityAtDepthPx(*input.light_field, depth_mm),
                        TickLabel(depth_mm, (hi - lo) / 50) + " mm"});
    } else {
      const double disparity_px = hi + share * (lo - hi);
      planes.push_back(
          {{disparity_px, disparity_px * input.depth->v_per_u},
           TrueMinus(fmt::format("{:+.{}f} px", disparity_px, hi - lo < kSmallPx ? 3 : 2))});
    }
  }
  return planes;
}

}  // namespace

std::string SweepFigure(const LightFieldPageInput& input) {
  if (!input.sweep || input.sweep->shots.empty()) return "";
  const SweepStrip& sweep = *input.sweep;
  const int columns = static_cast<int>(sweep.shots.size());
  std::string cells;
  bool focus_is_known = false;
  for (std::size_t i = 0; i < sweep.shots.size(); ++i) {
    const SweepShot& shot = sweep.shots[i];
    std::string label = fmt::format("{:.6g} mm", shot.reading_mm);
    if (shot.nearest_to_focus) {
      label += ", focus";
      focus_is_known = true;
    } else if (i == 0) {
      label += ", near";
    } else if (i + 1 == sweep.shots.size()) {
      label += ", far";
    }
    cells += Cell(EmbeddedImage(ShownImage(shot.image), FrameName(shot.file_name), Packing::kExact,
                                PlacePx(columns)),
                  TrueMinus(label));
  }
  const cv::Mat& first = sweep.shots.front().image;
  return Figure(
      Grid(columns, cells, "strip"), "The target at several distances",
      fmt::format(
          "{} of the {} frames of {} from near to far, with their bench readings, each showing the "
          "{} × {} px in the middle. The texture should become sharp and blur again: {}the rate of "
          "blurring determines the blur ratio, and the sharpest position the image distance.",
          sweep.shots.size(), sweep.frame_count, PrintableUtf8(sweep.name), first.cols, first.rows,
          focus_is_known ? "sharpest near the frame marked focus; " : ""));
}

std::string ImageAndDepthFigure(const LightFieldPageInput& input) {
  std::string cells, title, caption;
  if (input.photo) {
    cells += Cell(
        EmbeddedImage(ShownImage(*input.photo, kPhotoPx),
                      "The photograph through the whole aperture", Packing::kSmall, PlacePx(2)),
        "");
    title = "The photograph";
    caption =
        "All available data on the light: sharp in the plane of focus, blurred nearer and farther.";
  }
  if (input.depth) {
    title += input.photo ? " and its depth" : "The depth of the photograph";
    cells += DepthCell(*input.depth, input.light_field->landing_step_px.isZero(), &caption);
  }
  if (cells.empty()) return "";
  return Figure(Grid(input.photo && input.depth ? 2 : 1, cells, "pair"), title, caption);
}

std::string ViewFigures(const LightFieldPageInput& input) {
  return (input.mosaic ? MosaicFigure(input) : ViewThumbnails(input)) + LargeViews(input);
}

std::string EpipolarFigure(const LightFieldPageInput& input) {
  const model::LightField& light_field = *input.light_field;
  if (light_field.u_count < 2) return "";
  const int l = light_field.v_count / 2;
  const int repeat_px = EpipolarRepeat(light_field);
  const auto cell = [&](const model::LightField& shown, int t, const std::string& what) {
    const cv::Mat image = ShownImage(estimator::EpipolarRow(shown, t, l, repeat_px), kEpipolarPx);
    return Cell(EmbeddedImage(image, "Epipolar image, " + what, Packing::kExact, PlacePx(1)), what);
  };
  const int middle = light_field.t_count / 2;
  std::string cells, rows;
  if (input.truth != nullptr) {
    cells = cell(light_field, middle, "estimate") + cell(*input.truth, middle, "truth");
    rows = fmt::format("Row {}", middle);
  } else {
    const std::vector<int> chosen = EpipolarRows(light_field);
    for (int t : chosen) cells += cell(light_field, t, fmt::format("row {}", t));
    rows = fmt::format("{} {}", chosen.size() == 1 ? "Row" : "Rows", fmt::join(chosen, ", "));
  }
  return Figure(
      Grid(1, cells), "Epipolar images",
      fmt::format(
          "{} of the {} views with v = {}, one above the other, the leftmost view at the top. "
          "Every point of the scene draws a line: vertical in the plane of focus, leaning to the "
          "left on its way down if it is nearer, to the right if it is farther. The lines should "
          "stay sharp and unbroken from the first view to the last{}.",
          rows, light_field.u_count, l, input.truth == nullptr ? "" : "; the true ones below do"));
}

std::string RefocusFigure(const LightFieldPageInput& input) {
  const std::vector<RefocusPlane> planes = RefocusPlanes(input);
  if (planes.empty()) return "";
  const int columns = static_cast<int>(planes.size());
  std::string cells;
  for (const RefocusPlane& plane : planes) {
    const cv::Mat shown = ShownImage(
        estimator::Refocus(*input.light_field, plane.disparity_px.x(), plane.disparity_px.y(),
                           input.light_field->weights, input.threads),
        kRefocusPx);
    cells +=
        Cell(EmbeddedImage(shown, "Refocused to " + plane.label, Packing::kSmall, PlacePx(columns)),
             plane.label);
  }
  return Figure(
      Grid(columns, cells, "strip"), "Focus moved after the exposure",
      fmt::format("The views, shifted and averaged so that points {} coincide, from near to far. "
                  "In each image another part should be sharp; doubled contours elsewhere mean "
                  "that there are too few views for so much blur.",
                  input.depth->in_mm ? "at the depth below each image"
                                     : "of the disparity below each image (per view step)"));
}

std::string LightFieldFigureStyle() {
  return R"(h4 { font-size: 14px; margin: 20px 0 6px; font-weight: 600; }
.plain { --verdict: var(--soft); }
.verdict.plain .outcome { color: var(--ink); }
.images { display: grid; gap: 12px 10px; grid-template-columns:
  repeat(var(--columns), minmax(0, 1fr)); }
.images img { display: block; width: 100%; height: auto; border-radius: 2px; }
.images img.crisp { image-rendering: pixelated; }
.images span { display: block; margin-top: 3px; color: var(--soft); font-size: 12px;
  line-height: 1.3; font-variant-numeric: tabular-nums; }
.views { gap: 8px 6px; }
.scale { display: block; max-width: 100%; height: auto; margin-top: 8px; color: var(--soft);
  font-size: 12px; }
.scale text { fill: currentColor; font-variant-numeric: tabular-nums; }
.scale path { stroke: currentColor; }
.heat td { text-align: center; padding: 7px 9px; border: 2px solid var(--paper); }
.heat th { text-align: center; vertical-align: middle; padding: 4px 8px; border: 0;
  color: var(--soft); }
.inlined { border-left: 2px solid var(--rule); padding-left: 22px; }
.inlined h3 { font-size: 16px; margin-top: 32px; }
@media (max-width: 640px) { .strip { --columns: 3 !important; } .pair { --columns: 1 !important; }
  .inlined { padding-left: 10px; } }
@media print { .images > div { break-inside: avoid; } }
)";
}

}  // namespace thicklens::tools
