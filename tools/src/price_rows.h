#ifndef THICKLENS_TOOLS_PRICE_ROWS_H_
#define THICKLENS_TOOLS_PRICE_ROWS_H_

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "bench_parts.h"
#include "estimate_plan.h"
#include "whole_time.h"

namespace thicklens::tools {

// What one plan costs and gives on one picture with so many views.
struct PriceRow {
  std::string scene;
  int views = 0;      // across and down
  EstimatePlan plan;  // unless it is the baseline
  bool is_warping = false;
  std::string failure;                // why it could not be run; the rest is unknown then
  std::optional<BlockSample> sample;  // absent: all was run
  std::vector<double> setup_seconds, solve_seconds, views_seconds, seconds;  // of each run
  // Most that the run took beside what the process held before it. Absent: the system does not
  // tell, or a sample alone was run.
  std::optional<double> peak_memory_mib;
  std::optional<int> iterations;
  bool converged = true;
  std::optional<double> relative_residual, rcond;
  ScoredArea scored;           // what scores and the picture formed again are of
  PartScores scores;           // of the true views
  double reprojection_db = 0;  // PSNR of the picture formed again
  bool on_front = false;

  WholeTime time() const { return {seconds, sample.has_value()}; }
  std::string Name() const { return is_warping ? "warping (DIBR)" : PlanName(plan); }
};

// Sets on_front: seconds, extrapolated ones among them, against the mean PSNR, among rows of the
// same scene and views.
void MarkFront(std::vector<PriceRow>* rows);

// Rms error of the true views in grey levels of 255.
double ErrorGreyLevels(double psnr_db);

nlohmann::json PriceRowJson(const PriceRow& row);
std::string PriceTable(const std::vector<PriceRow>& rows);
std::string PriceCsv(const std::vector<PriceRow>& rows);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_PRICE_ROWS_H_
