#ifndef THICKLENS_TOOLS_REPORT_GRID_WORDS_H_
#define THICKLENS_TOOLS_REPORT_GRID_WORDS_H_

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "thicklens/calib/calibration.h"

namespace thicklens::tools {

// Returns the findings by the grid on the target, one line each; empty: there is none.
std::vector<std::string> GridLines(const calib::GridGeometry& grid);
// Returns the findings by the marks of the target's sheet in one line; empty: there are none in
// view.
std::string MarksLine(const calib::Calibration& calibration);

// Returns both for --json; null: no grid was stated, or no marks are in view.
nlohmann::json GridJson(const calib::GridGeometry& grid);
nlohmann::json MarksJson(const calib::SheetMarks& marks);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_GRID_WORDS_H_
