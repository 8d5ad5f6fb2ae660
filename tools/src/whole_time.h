#ifndef THICKLENS_TOOLS_WHOLE_TIME_H_
#define THICKLENS_TOOLS_WHOLE_TIME_H_

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace thicklens::tools {

// Seconds of runs on a whole picture that were measured on it, or that parts of it stand for. Both
// kinds never stand in one column, nor under one key.
struct WholeTime {
  std::vector<double> seconds;  // of each run, at least one
  bool is_extrapolated = false;

  double median() const;
  // Two cells of a table: as measured and as extrapolated; "-" in the one that it is not.
  std::string MeasuredCell() const;
  std::string ExtrapolatedCell() const;
  std::string RangeCell() const;  // "least .. most", of either
  // seconds, seconds_of_runs, extrapolated_seconds, extrapolated_seconds_of_runs; two are null.
  nlohmann::json Json() const;
};

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_WHOLE_TIME_H_
