#ifndef THICKLENS_TOOLS_BENCH_CALIBRATION_PAGE_H_
#define THICKLENS_TOOLS_BENCH_CALIBRATION_PAGE_H_

#include <string>
#include <vector>

#include "bench_calibration_rows.h"
#include "svg_plot.h"

namespace thicklens::tools {

// Median error of d1 against seconds on logarithmic axes: each method a colour, the front joined.
// Rows that cannot be compared are left out.
Plot CalibrationPriceFigure(const std::vector<CalibrationRow>& rows);

// A page with the figure and all rows. `about`: what was calibrated on what machine.
std::string CalibrationPricePage(const std::vector<CalibrationRow>& rows, const std::string& about);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_CALIBRATION_PAGE_H_
