#ifndef THICKLENS_CALIB_GRID_GRID_GEOMETRY_H_
#define THICKLENS_CALIB_GRID_GRID_GEOMETRY_H_

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "calib/grid/grid_adjustment.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/grid_geometry.h"
#include "thicklens/model/conjugates.h"

namespace thicklens::calib {

// Names of statements of the magnification by a grid, and by the marks of a sheet.
inline constexpr char kFromGrid[] = "target_grid";
inline constexpr char kFromMarks[] = "the marks of the target's sheet";

// The views of a grid, after the points were found in the frames.
struct GridViews {
  std::vector<GridView> frames;     // of the sweep, with their positions
  std::vector<double> readings_mm;  // of `frames`
  std::vector<GridView> views;      // that stand anywhere
};

// Finds the grid of the sweep in its frames and further views, and adjusts the camera to it. The
// result says in `message` why it is not done. Throws Error as LinearGrey does.
GridGeometry MeasureGrid(const FocusSweep& sweep, int threads, const std::function<void()>& tick);

// Returns the result from points that were found. The counts of what was searched are the caller's.
GridGeometry GeometryOf(const FocusSweep& sweep, const GridViews& found);

// The magnification in the plane of focus by the sizes of something of known size in frames, with
// the errors of the print and of the sizes; absent without a size. `sign` is that of the reading in
// the depth.
std::optional<model::StatedConjugate> MagnificationOfGrid(const std::vector<GridScale>& scales,
                                                          double front_focal_length_mm, double sign,
                                                          double sharpest_reading_mm,
                                                          const std::string& name);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_GRID_GRID_GEOMETRY_H_
