#include "thicklens/model/target_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/base/pi.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::model {
namespace {

// Measures for a sheet at least 210 mm wide; smaller sheets have proportional ones.
constexpr double kFullSheetMm = 210;
constexpr double kMarginMm = 15;
constexpr double kCaptionHeightMm = 27;
constexpr double kBarGapMm = 5;
constexpr double kBarHeightMm = 3;
constexpr double kTextGapMm = 5;
constexpr double kTextSizeMm = 3.2;
// Wider than the mean letter of any common sans serif font in text sizes.
constexpr double kLetterWidth = 0.6;

// The ratio of the pattern to the field, so that a frame that is somewhat farther away, or off the
// middle, still shows only the pattern.
constexpr double kOverfill = 1.15;
// The part of the field's width and height that the patch takes. Each plateau then covers 4 % of
// the area, so that a plateau alone does not make a frame count as clipped. The patch of a long
// pattern is not longer, so that a slanted edge leaves a plateau on both sides.
constexpr double kPatchPart = 0.28;
constexpr double kLongestPatch = 1.5;
// Smaller features are lost in the pixels; with larger ones the texture becomes sparse.
constexpr double kFinestFeaturePx = 2;
constexpr double kFeaturePx = 3;
constexpr double kMaxFeaturePx = 6;
constexpr double kFeaturesAcross = 360;
constexpr double kMinFeaturesAcross = 30;
constexpr double kMaxFeatures = 5e6;
constexpr double kRoundingSlack = 1e-9;
// The part of the camera's field that a grid takes, so that all of it is in view.
constexpr double kGridPart = 0.9;
// A square is at least so many times as wide as what the print method resolves.
constexpr double kFinestSquares = 10;
// Modules along a marker of the usual dictionaries with their border, about.
constexpr double kMarkerModules = 8;
// Marks of a sheet at least 210 mm wide: distance from the texture and from the sheet's edge.
constexpr double kMarkGapMm = 2, kMarkEdgeMm = 4;
// In the camera's field: the largest side of a mark, and the part within the outermost marks.
constexpr double kMarkPart = 0.1, kMarkedPart = 0.94;

double RoundToTwoDigits(double value) {
  const double unit = std::pow(10, std::floor(std::log10(value)) - 1);
  return std::round(value / unit) * unit;
}

// Rounds down to tenths, as the caption writes them. The slack keeps 185.9 from becoming 185.8.
double FloorToTenths(double value_mm) { return std::floor(value_mm * 10 + 1e-6) / 10; }
double CeilToTenths(double value_mm) { return std::ceil(value_mm * 10 - 1e-6) / 10; }

double SheetScale(const SheetSize& sheet) {
  return std::min(1.0, std::min(sheet.width_mm, sheet.height_mm) / kFullSheetMm);
}

// Returns the area that margins and caption leave to the pattern.
SheetRectangle FreeArea(const SheetSize& sheet) {
  const double margin_mm = kMarginMm * SheetScale(sheet);
  const double caption_mm = kCaptionHeightMm * SheetScale(sheet);
  return {margin_mm, margin_mm, FloorToTenths(sheet.width_mm - 2 * margin_mm),
          FloorToTenths(sheet.height_mm - 2 * margin_mm - caption_mm)};
}

bool Holds(const SheetRectangle& free, double width_mm, double height_mm) {
  return width_mm <= free.width + kRoundingSlack && height_mm <= free.height + kRoundingSlack;
}

SheetSize Turned(SheetSize sheet) {
  std::swap(sheet.width_mm, sheet.height_mm);
  return sheet;
}

// Returns the sheet, rotated if that is allowed and the field with its margin fits only then.
SheetSize SheetFor(const SheetSize& sheet, const std::optional<CameraView>& view) {
  if (!view) return sheet;
  const double width_mm = CeilToTenths(kOverfill * view->width_mm);
  const double height_mm = CeilToTenths(kOverfill * view->height_mm);
  if (Holds(FreeArea(sheet), width_mm, height_mm)) return sheet;
  if (sheet.may_turn && Holds(FreeArea(Turned(sheet)), width_mm, height_mm)) return Turned(sheet);
  const SheetRectangle free = FreeArea(sheet);
  throw Error(fmt::format(
      "the camera sees {:.1f} x {:.1f} mm at {:g} mm; a pattern of {:.1f} x {:.1f} mm, which "
      "is 15 % larger, does not fit the sheet of {:g} x {:g} mm ({:.1f} x {:.1f} mm are "
      "free): choose a larger sheet or a shorter distance",
      view->width_mm, view->height_mm, view->distance_mm, width_mm, height_mm, sheet.width_mm,
      sheet.height_mm, free.width, free.height));
}

SheetRectangle PatternFor(const SheetSize& sheet, const std::optional<CameraView>& view) {
  const SheetRectangle free = FreeArea(sheet);
  if (!view) return free;
  const double width_mm = CeilToTenths(kOverfill * view->width_mm);
  const double height_mm = CeilToTenths(kOverfill * view->height_mm);
  return {free.x + (free.width - width_mm) / 2, free.y + (free.height - height_mm) / 2, width_mm,
          height_mm};
}

SheetRectangle PatchOf(const SheetRectangle& pattern) {
  const double width_mm = kPatchPart * pattern.width / kOverfill;
  const double height_mm = kPatchPart * pattern.height / kOverfill;
  SheetRectangle patch;
  patch.width = std::min(width_mm, kLongestPatch * height_mm);
  patch.height = std::min(height_mm, kLongestPatch * width_mm);
  patch.x = pattern.x + (pattern.width - patch.width) / 2;
  patch.y = pattern.y + (pattern.height - patch.height) / 2;
  return patch;
}

struct Feature {
  double size_mm = 0;
  std::string why;
};

std::string InPixels(double feature_mm, const CameraView& view) {
  return fmt::format("{:.1f} px of the image at {:g} mm", feature_mm / view.px_mm,
                     view.distance_mm);
}

Feature GivenFeature(double feature_mm, const TargetRequest& request) {
  if (!(feature_mm >= request.finest_mm)) {
    throw Error(
        fmt::format("smallest feature: {:g} mm is below the {:g} mm that the print method "
                    "resolves: choose a larger feature, or state a smaller finest_mm if the print "
                    "method resolves it",
                    feature_mm, request.finest_mm));
  }
  if (!request.view) return {feature_mm, "as given"};
  const double feature_px = feature_mm / request.view->px_mm;
  std::string why = "as given, " + InPixels(feature_mm, *request.view);
  if (feature_px < kFinestFeaturePx) why += ", finer than the 2 to 6 px that are best";
  if (feature_px > kMaxFeaturePx) why += ", coarser than the 2 to 6 px that are best";
  return {feature_mm, why};
}

// Three px, or the smallest feature that the print method resolves if that is not above six px.
Feature FeatureForCamera(const CameraView& view, double finest_mm) {
  const double best_mm = RoundToTwoDigits(kFeaturePx * view.px_mm);
  if (best_mm >= finest_mm) {
    return {best_mm, InPixels(best_mm, view) + ", where 2 to 6 px are best"};
  }
  if (finest_mm <= kMaxFeaturePx * view.px_mm) {
    return {finest_mm, InPixels(finest_mm, view) + ", the finest that can be printed"};
  }
  // The distance from which the finest printed feature is at most six px of pitch p: in the plane
  // of focus m = f1/(zf - f1), from [S13], so that zf >= f1 (1 + feature/(6 p)) [D47]. With px_mm =
  // p/m at the requested distance, zf - f1 is proportional to px_mm.
  const double farther_mm = view.focal_length_mm + (view.distance_mm - view.focal_length_mm) *
                                                       finest_mm / (kMaxFeaturePx * view.px_mm);
  throw Error(
      fmt::format("features of 2 to 6 px at {:g} mm measure {:.2g} to {:.2g} mm on the target, "
                  "below the {:g} mm that the print method resolves: choose a larger distance "
                  "({:.0f} mm or more) or a finer print method (finest_mm)",
                  view.distance_mm, kFinestFeaturePx * view.px_mm, kMaxFeaturePx * view.px_mm,
                  finest_mm, std::ceil(farther_mm)));
}

Feature ChooseFeature(const TargetRequest& request, const SheetRectangle& pattern) {
  if (request.feature_mm) return GivenFeature(*request.feature_mm, request);
  if (request.view) return FeatureForCamera(*request.view, request.finest_mm);
  const double part_mm =
      RoundToTwoDigits(std::min(pattern.width, pattern.height) / kFeaturesAcross);
  if (part_mm >= request.finest_mm) {
    return {part_mm, "1/360 of the pattern's shorter side, because no camera is given"};
  }
  return {request.finest_mm, "the finest that can be printed, because no camera is given"};
}

void RequirePossibleTexture(const SheetRectangle& pattern, double feature_mm) {
  const double shorter_mm = std::min(pattern.width, pattern.height);
  if (!(shorter_mm >= kMinFeaturesAcross * feature_mm)) {
    throw Error(
        fmt::format("a pattern of {:.1f} x {:.1f} mm has no room for a texture of features of {:g} "
                    "mm: at least {:g} of them must fit its shorter side",
                    pattern.width, pattern.height, feature_mm, kMinFeaturesAcross));
  }
  if (!(pattern.width * pattern.height / (feature_mm * feature_mm) <= kMaxFeatures)) {
    throw Error(
        fmt::format("a pattern of {:.1f} x {:.1f} mm with features of {:g} mm would contain more "
                    "than {:g} million of them: choose larger features or a smaller sheet",
                    pattern.width, pattern.height, feature_mm, kMaxFeatures / 1e6));
  }
}

double LongestBarMm(double room_mm) {
  for (const double length_mm : {100.0, 50.0, 20.0}) {
    if (length_mm <= room_mm) return length_mm;
  }
  return 10;
}

// The number of a grid's squares that fit, one of them odd and the other one even, so that a
// chequerboard looks different upside down.
int Fitting(double room_mm, double square_mm, bool odd) {
  const int most = static_cast<int>(room_mm / square_mm + 1e-9);
  return (most % 2 == 1) == odd ? most : most - 1;
}

// The grid with the numbers of squares that are not stated (0) chosen, and where it lies.
void PlaceGrid(const TargetRequest& request, const SheetSize& sheet, TargetPage* page) {
  TargetGrid grid = *request.grid;
  const SheetRectangle free = FreeArea(sheet);
  double width_mm = free.width, height_mm = free.height;
  if (request.view) {
    width_mm = std::min(width_mm, kGridPart * request.view->width_mm);
    height_mm = std::min(height_mm, kGridPart * request.view->height_mm);
  }
  // Circles need less than their number times their distance.
  const double more_mm =
      grid.pattern == GridPattern::kCircles ? (1 - 2 * kCirclePart) * grid.square_mm : 0;
  const bool is_wide = width_mm >= height_mm;
  if (grid.columns == 0) grid.columns = Fitting(width_mm + more_mm, grid.square_mm, is_wide);
  if (grid.rows == 0) grid.rows = Fitting(height_mm + more_mm, grid.square_mm, !is_wide);
  std::string why;
  if (!grid.IsValid(&why)) {
    throw Error(fmt::format("a grid with squares of {:g} mm in {:.1f} x {:.1f} mm{}: {}",
                            grid.square_mm, width_mm, height_mm,
                            request.view ? ", nine tenths of the camera's field" : "", why));
  }
  const Eigen::Vector2d size_mm = grid.SizeMm();
  if (!Holds(free, size_mm.x(), size_mm.y())) {
    throw Error(fmt::format(
        "a grid of {:.1f} x {:.1f} mm does not fit the sheet of {:g} x {:g} mm "
        "({:.1f} x {:.1f} mm are free): choose fewer or smaller squares, or a "
        "larger sheet",
        size_mm.x(), size_mm.y(), sheet.width_mm, sheet.height_mm, free.width, free.height));
  }
  if (!(grid.square_mm >= kFinestSquares * request.finest_mm)) {
    throw Error(
        fmt::format("squares of {:g} mm are below ten times the {:g} mm that the print "
                    "method resolves: choose larger squares, or state a smaller finest_mm",
                    grid.square_mm, request.finest_mm));
  }
  page->grid = grid;
  page->pattern = {free.x + (free.width - size_mm.x()) / 2,
                   free.y + (free.height - size_mm.y()) / 2, size_mm.x(), size_mm.y()};
  page->choice = grid.Description();
  if (request.view) {
    page->choice += fmt::format(", {:.1f} px of the image each at {:g} mm",
                                grid.square_mm / request.view->px_mm, request.view->distance_mm);
  }
}

// The marks of one side, or none if the sheet has no room for them.
std::vector<PlacedMark> MarksOf(int number, const TargetRequest& request, const SheetSize& sheet,
                                const SheetRectangle& pattern) {
  const double scale = SheetScale(sheet);
  const double side_mm = SheetMarkOf(number)->side_mm, step_mm = kMarkStep * side_mm;
  const double gap_mm = std::max(kMarkGapMm * scale, side_mm / kMarkerModules);
  const auto apart = [&](double pattern_mm, double view_mm) {
    return step_mm * (request.view
                          ? std::floor((kMarkedPart * view_mm - side_mm) / step_mm)
                          : std::ceil((pattern_mm + 2 * gap_mm + side_mm) / step_mm - 1e-9));
  };
  const double apart_x = apart(pattern.width, request.view ? request.view->width_mm : 0);
  const double apart_y = apart(pattern.height, request.view ? request.view->height_mm : 0);
  const double left_mm = pattern.x + (pattern.width - apart_x - side_mm) / 2;
  const double top_mm = request.view ? pattern.y + (pattern.height - apart_y - side_mm) / 2
                                     : pattern.y - gap_mm - side_mm;
  const double edge_mm = kMarkEdgeMm * scale;
  if (!(apart_x > 0) || !(apart_y > 0) || left_mm < edge_mm || top_mm < edge_mm ||
      left_mm + apart_x + side_mm > sheet.width_mm - edge_mm ||
      top_mm + apart_y + side_mm > sheet.height_mm - edge_mm)
    return {};
  std::vector<PlacedMark> marks;
  for (int corner = 0; corner < 4; ++corner) {
    marks.push_back(
        {number + corner,
         {left_mm + (corner % 2) * apart_x, top_mm + (corner / 2) * apart_y, side_mm, side_mm}});
  }
  return marks;
}

// The largest marks that fit: outside of a texture that fills the sheet, or inside of the camera's
// field, so that they are in view.
std::vector<PlacedMark> PlaceMarks(const TargetRequest& request, const SheetSize& sheet,
                                   const SheetRectangle& pattern) {
#ifndef THICKLENS_HAS_ARUCO
  return {};  // nothing could draw them
#endif
  double side_mm = (kMarginMm - kMarkGapMm - kMarkEdgeMm) * SheetScale(sheet);
  if (request.view) side_mm = kMarkPart * std::min(request.view->width_mm, request.view->height_mm);
  while (const std::optional<int> number = NumberOfSheetMark(0, side_mm)) {
    const std::vector<PlacedMark> marks = MarksOf(*number, request, sheet, pattern);
    if (!marks.empty()) return marks;
    side_mm = SheetMarkOf(*number)->side_mm * (1 - 1e-6);
  }
  return {};
}

std::string GridStatement(const TargetGrid& grid) {
  std::string text =
      fmt::format("target_grid: {{pattern: {}, columns: {}, rows: {}, square_mm: {:g}",
                  GridPatternName(grid.pattern), grid.columns, grid.rows, grid.square_mm);
  if (grid.pattern == GridPattern::kCharuco)
    text += fmt::format(", marker_mm: {:g}, dictionary: {}", grid.marker_mm, grid.dictionary);
  return text + "}";
}

std::vector<std::string> CaptionOfGrid(const TargetPage& page) {
  return {"thicklens target, " + page.grid->Description(), GridStatement(*page.grid),
          fmt::format("measure this bar: {:.1f} mm; print at 100 %, no scaling", page.bar.width)};
}

std::vector<std::string> CaptionOf(const TargetPage& page, const std::optional<CameraView>& view) {
  std::vector<std::string> lines = {
      fmt::format("thicklens target, pattern {:.1f} x {:.1f} mm, smallest feature {:g} mm, edge "
                  "{:g} degrees, seed {}",
                  page.pattern.width, page.pattern.height, page.feature_mm, page.edge_angle_deg,
                  page.seed),
      fmt::format("measure this bar: {:.1f} mm; print at 100 %, no scaling", page.bar.width)};
  if (view) {
    lines.push_back(fmt::format("for a camera that sees {:.1f} x {:.1f} mm at {:g} mm",
                                view->width_mm, view->height_mm, view->distance_mm));
  }
  if (!page.marks.empty()) {
    lines.push_back(fmt::format(
        "marks {} {} to {}, side {:g} mm, {:g} x {:g} mm apart", kSheetDictionary,
        page.marks.front().number, page.marks.back().number, page.marks.front().area.width,
        page.marks[1].area.x - page.marks[0].area.x, page.marks[2].area.y - page.marks[0].area.y));
  }
  return lines;
}

void AddCaption(const SheetSize& sheet, const std::optional<CameraView>& view, TargetPage* page) {
  const double scale = SheetScale(sheet);
  const SheetRectangle free = FreeArea(sheet);
  page->bar = {free.x, free.y + free.height + kBarGapMm * scale, LongestBarMm(free.width),
               kBarHeightMm * scale};
  page->caption = page->grid ? CaptionOfGrid(*page) : CaptionOf(*page, view);
  std::size_t most_letters = 0;
  for (const std::string& line : page->caption) most_letters = std::max(most_letters, line.size());
  page->text_size_mm = std::min(kTextSizeMm * scale,
                                free.width / (kLetterWidth * static_cast<double>(most_letters)));
  page->first_baseline_y_mm = page->bar.y + page->bar.height + kTextGapMm * scale;
}

}  // namespace

CameraView ViewOfTarget(const Camera& camera, double distance_mm) {
  const double image_distance_mm = ImageDistanceMm(camera.lens, distance_mm);
  const double magnification =
      std::abs(ChiefRayMagnification(camera.lens, image_distance_mm, distance_mm));
  const double px_mm = camera.sensor.pixel_pitch_mm / magnification;
  return {distance_mm, px_mm, px_mm * camera.sensor.width_px, px_mm * camera.sensor.height_px,
          camera.lens.front_focal_length_mm};
}

double TargetPage::EdgeX(double y_mm) const {
  const double centre_x_mm = patch.x + patch.width / 2;
  const double centre_y_mm = patch.y + patch.height / 2;
  return centre_x_mm - (y_mm - centre_y_mm) * std::tan(edge_angle_deg * kPi / 180);
}

TargetPage LayOutTarget(const TargetRequest& request) {
  TargetPage page;
  SheetSize sheet = request.sheet;
  if (request.grid) {
    const bool turns = sheet.may_turn && request.grid->columns > request.grid->rows &&
                       sheet.width_mm < sheet.height_mm;
    if (turns) sheet = Turned(sheet);
  } else {
    sheet = SheetFor(request.sheet, request.view);
  }
  page.width_mm = sheet.width_mm;
  page.height_mm = sheet.height_mm;
  page.two_tone = request.two_tone;
  page.seed = request.seed;
  if (request.grid) {
    PlaceGrid(request, sheet, &page);
    page.feature_mm = page.grid->pattern == GridPattern::kCharuco
                          ? page.grid->marker_mm / kMarkerModules
                          : page.grid->square_mm;
    AddCaption(sheet, request.view, &page);
    return page;
  }
  page.pattern = PatternFor(sheet, request.view);
  const Feature feature = ChooseFeature(request, page.pattern);
  RequirePossibleTexture(page.pattern, feature.size_mm);
  page.patch = PatchOf(page.pattern);
  page.edge_angle_deg = request.edge_angle_deg;
  page.feature_mm = feature.size_mm;
  if (request.has_marks) page.marks = PlaceMarks(request, sheet, page.pattern);
  page.choice =
      fmt::format("smallest feature {:g} mm ({}); pattern {:.1f} x {:.1f} mm ({})", feature.size_mm,
                  feature.why, page.pattern.width, page.pattern.height,
                  request.view ? fmt::format("the field of {:.1f} x {:.1f} mm plus 15 %",
                                             request.view->width_mm, request.view->height_mm)
                               : "the free area of the sheet");
  AddCaption(sheet, request.view, &page);
  return page;
}

}  // namespace thicklens::model
