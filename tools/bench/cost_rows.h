#ifndef THICKLENS_TOOLS_BENCH_COST_ROWS_H_
#define THICKLENS_TOOLS_BENCH_COST_ROWS_H_

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tools/bench/bench_parts.h"
#include "tools/bench/whole_time.h"
#include "tools/options/estimate_plan.h"

namespace thicklens::tools {

// Cost and accuracy of one plan on one image with one number of views.
struct CostRow {
  std::string scene;
  int views = 0;                 // across and down
  estimator::EstimatePlan plan;  // unless it is the baseline
  bool is_warping = false;
  std::string failure;                // why it could not be run; all later fields are then unknown
  std::optional<BlockSample> sample;  // absent: the whole image was run
  std::vector<double> setup_seconds, solve_seconds, views_seconds, seconds;  // of each run
  // Maximum memory of the run beyond what the process held before it. Absent if the system does not
  // report it, or if only a sample was run.
  std::optional<double> peak_memory_mib;
  std::optional<int> iterations;
  bool converged = true;
  std::optional<double> relative_residual, rcond;
  ScoredArea scored;           // area of the scores and of the photograph formed again
  PartScores scores;           // against the true views
  double reprojection_db = 0;  // PSNR of the photograph formed again
  bool on_front = false;

  WholeTime time() const { return {seconds, sample.has_value()}; }
  std::string Name() const { return is_warping ? "warping (DIBR)" : estimator::PlanName(plan); }
};

// Sets on_front among rows of the same scene and views, from the seconds, including extrapolated
// ones, and the mean PSNR.
void MarkFront(std::vector<CostRow>* rows);

// Returns the rms error of the true views in grey levels of 255.
double ErrorGreyLevels(double psnr_db);

nlohmann::json CostRowJson(const CostRow& row);
std::string CostTable(const std::vector<CostRow>& rows);
std::string CostCsv(const std::vector<CostRow>& rows);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_COST_ROWS_H_
