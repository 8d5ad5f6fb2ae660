#ifndef THICKLENS_TOOLS_BENCH_WHOLE_TIME_H_
#define THICKLENS_TOOLS_BENCH_WHOLE_TIME_H_

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace thicklens::tools {

// Seconds of runs on a whole image, either measured on it or extrapolated from parts. The two kinds
// never share a column or a key.
struct WholeTime {
  std::vector<double> seconds;  // one for each run, at least one
  bool is_extrapolated = false;

  double median() const;
  // Two cells of a table: as measured and as extrapolated; "-" in the cell that does not apply.
  std::string MeasuredCell() const;
  std::string ExtrapolatedCell() const;
  std::string RangeCell() const;  // "least .. most", of either kind
  // The keys are seconds, seconds_of_runs, extrapolated_seconds and extrapolated_seconds_of_runs;
  // two are null.
  nlohmann::json Json() const;
};

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_WHOLE_TIME_H_
