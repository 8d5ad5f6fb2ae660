#ifndef THICKLENS_CALIB_GRID_SHEET_MARKS_H_
#define THICKLENS_CALIB_GRID_SHEET_MARKS_H_

#include <opencv2/core/mat.hpp>
#include <vector>

#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/grid_geometry.h"

namespace thicklens::calib {

// A frame in which marks are looked for.
struct MarkedFrame {
  double reading_mm = 0;  // of the frame
  cv::Mat light;          // of the sweep's region, linear
};

// Finds the marks of the sheet of `thicklens target` in frames: magnification and tilt. A sheet
// without marks, or fewer than two marks in view, is no error.
SheetMarks FindSheetMarks(const FocusSweep& sweep, const std::vector<MarkedFrame>& frames);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_GRID_SHEET_MARKS_H_
