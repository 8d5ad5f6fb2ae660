#ifndef THICKLENS_TOOLS_BENCH_BENCH_CALIBRATION_PAGE_H_
#define THICKLENS_TOOLS_BENCH_BENCH_CALIBRATION_PAGE_H_

#include <string>
#include <vector>

#include "tools/bench/bench_calibration_rows.h"
#include "tools/report/svg_plot.h"

namespace thicklens::tools {

// Plots the median error of d1 against seconds on logarithmic axes: one colour for each method,
// with the Pareto front joined. Rows that cannot be compared are left out.
Plot CalibrationCostFigure(const std::vector<CalibrationRow>& rows);

// Makes a page with the figure and all rows. `about` says what was calibrated on which machine.
std::string CalibrationCostPage(const std::vector<CalibrationRow>& rows, const std::string& about);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_BENCH_CALIBRATION_PAGE_H_
