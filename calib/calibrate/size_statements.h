#ifndef THICKLENS_CALIB_CALIBRATE_SIZE_STATEMENTS_H_
#define THICKLENS_CALIB_CALIBRATE_SIZE_STATEMENTS_H_

#include <string>
#include <vector>

#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/conjugates.h"

namespace thicklens::calib {

// The statements that something of known size on the target makes about the magnification in the
// plane of focus.
struct SizeStatements {
  std::vector<model::StatedConjugate> found;  // to be used as stated ones
  std::vector<std::string> warnings;          // where a stated magnification contradicts them
};

// The statements by the sweep's grid and by the marks of its sheet. A magnification that the sweep
// states takes their place.
SizeStatements StatementsOfSizes(const FocusSweep& sweep, const SheetMarks& marks,
                                 double sharpest_reading_mm);

// Says so where d1 by the grid and by the blur differ beyond their errors.
void CompareWithGrid(const GridGeometry& grid, CalibrationSummary* summary);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATE_SIZE_STATEMENTS_H_
