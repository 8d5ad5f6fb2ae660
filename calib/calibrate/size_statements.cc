#include "calib/calibrate/size_statements.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "calib/fit/known_focus.h"
#include "calib/grid/grid_geometry.h"

namespace thicklens::calib {
namespace {

constexpr double kSurelyApart = 3;  // standard deviations

}  // namespace

SizeStatements StatementsOfSizes(const FocusSweep& sweep, const SheetMarks& marks,
                                 double sharpest_reading_mm) {
  SizeStatements statements;
  const auto stated =
      std::find_if(sweep.stated_focus.begin(), sweep.stated_focus.end(), [](const auto& statement) {
        return statement.kind == model::ConjugateKind::kMagnification &&
               statement.name != kFromObjective;
      });
  const auto add = [&](const std::vector<GridScale>& scales, const char* name) {
    const std::optional<model::StatedConjugate> found =
        MagnificationOfGrid(scales, sweep.camera.lens.front_focal_length_mm,
                            model::DirectionSign(sweep.direction), sharpest_reading_mm, name);
    if (!found) return;
    if (stated == sweep.stated_focus.end()) {
      statements.found.push_back(*found);
      return;
    }
    const double apart = found->value.value - stated->value.value;
    if (!(std::abs(apart) > kSurelyApart * std::hypot(found->value.sigma, stated->value.sigma)))
      return;
    statements.warnings.push_back(fmt::format(
        "{} is {:.5g} +- {:.2g}, but by {} it is {:.5g} +- {:.2g}: the statement, the size of the "
        "print or the pixel pitch is wrong; the statement is used",
        stated->name, stated->value.value, stated->value.sigma, name, found->value.value,
        found->value.sigma));
  };
  add(sweep.grid_scales, kFromGrid);
  add(marks.scales, kFromMarks);
  return statements;
}

void CompareWithGrid(const GridGeometry& grid, CalibrationSummary* summary) {
  if (!grid.image_distance_mm || !summary->image_distance_mm) return;
  const Result& d1 = *summary->image_distance_mm;
  const model::Estimate& by_grid = *grid.image_distance_mm;
  double low = d1.value, high = d1.value;
  if (d1.systematic) {
    low = std::min(low, d1.systematic->x());
    high = std::max(high, d1.systematic->y());
  }
  const double reach_mm = kSurelyApart * std::hypot(by_grid.sigma, d1.sigma);
  if (by_grid.value > low - reach_mm && by_grid.value < high + reach_mm) return;
  summary->warnings.push_back(fmt::format(
      "the grid puts the image distance d1 at {:.5g} +- {:.2g} mm, the blur at {:.5g} +- {:.2g} "
      "mm: "
      "the size of the grid (target_grid), the focal length, the pixel pitch or the readings are "
      "wrong",
      by_grid.value, by_grid.sigma, d1.value, d1.sigma));
}

}  // namespace thicklens::calib
