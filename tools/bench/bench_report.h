#ifndef THICKLENS_TOOLS_BENCH_BENCH_REPORT_H_
#define THICKLENS_TOOLS_BENCH_BENCH_REPORT_H_

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/output_file.h"
#include "tools/report/svg_plot.h"

namespace thicklens::tools {

void AddBenchReportOption(CLI::App* command, std::string* folder);

// The folder of a table of time and error: a page, a machine-readable table, and the page's figures
// as files.
class BenchReport {
 public:
  explicit BenchReport(const std::string& folder);  // claims the folder; empty: none. Throws Error

  // Each figure's file is named by the figure's id.
  void Commit(const std::string& page, const std::string& csv, const std::vector<Plot>& figures);

 private:
  std::optional<OutputFolder> folder_;
};

// Returns the line through the points of a Pareto front, sorted by cost. Between two points the
// error is that of the cheaper one.
PlotSeries FrontLine(const std::vector<double>& costs, const std::vector<double>& errors);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_BENCH_REPORT_H_
