#ifndef THICKLENS_TOOLS_BENCH_BENCH_CALIBRATION_ROWS_H_
#define THICKLENS_TOOLS_BENCH_BENCH_CALIBRATION_ROWS_H_

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/calib/calibrate.h"

namespace thicklens::tools {

// Error of one calibration in one quantity. The paper's recipe states no sigma.
struct CalibrationError {
  double error = 0;  // value minus truth
  std::optional<double> sigma;
};

// One calibration of one sweep.
struct CalibrationTrial {
  calib::Outcome outcome = calib::Outcome::kRefused;
  std::string reason;  // for any outcome but kOk
  double seconds = 0;
  std::optional<CalibrationError> focus_depth_mm, image_distance_um, blur_ratio_percent;
};

// Number of stated intervals that contain the truth.
struct IntervalCoverage {
  int trials = 0;     // trials that stated an interval; 0: nothing is known
  int inside_68 = 0;  // |error| <= sigma
  int inside_95 = 0;  // |error| <= 1.96 sigma
  double fraction_68() const { return static_cast<double>(inside_68) / trials; }
  double fraction_95() const { return static_cast<double>(inside_95) / trials; }
};
// Returns the standard deviation of a fraction of `trials` trials about its expectation.
double BinomialStandardError(double expected_fraction, int trials);

// Errors of one quantity over the sweeps that gave it.
struct CalibrationErrors {
  int count = 0;  // 0: the rest is not known
  double median_absolute = 0;
  double root_mean_square = 0;
  IntervalCoverage coverage;
};
CalibrationErrors ErrorsOf(const std::vector<CalibrationError>& errors);

// One way to calibrate, over all sweeps.
struct CalibrationRow {
  std::string method;
  int frames = 0, field_px = 0;
  int sweeps = 0, ok = 0, partial = 0, refused = 0;  // the last three add up to the first
  // Reasons of outcomes that were not ok, with # for numbers so that equal reasons have equal
  // texts.
  std::map<std::string, int> reasons;
  std::vector<double> seconds;  // one for each sweep, including refused ones
  CalibrationErrors focus_depth_mm, image_distance_um, blur_ratio_percent;
  bool on_front = false;

  // Returns whether all sweeps gave what the row gives at all. The errors of a row that some sweeps
  // did not give belong to other, easier sweeps.
  bool IsOfAllSweeps() const;
  // Returns whether the d1 of this row can be compared with that of other rows.
  bool IsComparable() const { return IsOfAllSweeps() && image_distance_um.count == sweeps; }
};
CalibrationRow MakeCalibrationRow(const std::string& method, int frames, int field_px,
                                  const std::vector<CalibrationTrial>& trials);

// Marks the rows of the Pareto front: no other row has both a smaller or equal median error of d1
// and a smaller or equal median of seconds, one of them smaller. Rows that are not comparable stay
// unmarked and dominate no row.
void MarkFront(std::vector<CalibrationRow>* rows);

nlohmann::json CalibrationRowJson(const CalibrationRow& row);
std::string CalibrationRowsCsv(const std::vector<CalibrationRow>& rows);
// Returns a table for the terminal, followed by what was refused and why.
std::string CalibrationRowsText(const std::vector<CalibrationRow>& rows);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_BENCH_CALIBRATION_ROWS_H_
