#ifndef THICKLENS_TOOLS_REPORT_ESTIMATE_RECORDS_H_
#define THICKLENS_TOOLS_REPORT_ESTIMATE_RECORDS_H_

#include <optional>
#include <string>
#include <vector>

namespace thicklens::tools {

// The content of `thicklens estimate --json`. A value that the file leaves out or gives as null is
// absent.
struct EstimateRecord {
  std::string solver;
  int u_count = 0, v_count = 0, s_count = 0, t_count = 0;
  std::string block_solver, stencil, splat, device;  // empty: absent
  std::string prior, strength_rule;                  // empty: absent
  std::optional<double> strength, noise_sigma,
      residual_rms;  // noise and residual in encoded values
  std::optional<double> row_share, occluded_fraction;
  std::optional<int> iterations;
  std::optional<bool> converged;
  std::optional<double> gamma, ridge;
  std::optional<int> threads, block_px, blocks, holes_filled;
  std::optional<double> setup_seconds, solve_seconds, views_seconds, files_seconds, total_seconds;
  std::optional<double> peak_rss_mib, relative_residual, rcond_min;
  std::optional<std::vector<std::string>> effects;
};
// Throws Error that begins with the path: no JSON, from another command, refused, wrong types.
EstimateRecord ReadEstimateRecord(const std::string& path);
// Parses a text; `name` is the name of its file in messages.
EstimateRecord ParseEstimateRecord(const std::string& text, const std::string& name);

// Metrics of a view, or their mean over views. JSON has no infinity: the PSNR of equal images is
// null there and +inf here.
struct ScoresRecord {
  double psnr_db = 0;
  std::optional<double> ssim, delta_e94_mean, macade_standin;
};
struct ViewRecord {
  int u = 0, v = 0;
  double psnr_db = 0;
  std::optional<double> dibr_psnr_db;
};
// The content of `thicklens compare TRUE_LF LF --json`.
struct ComparisonRecord {
  // The compared area: views, pixels of each, and the border that was left out; 0, 0 and absent if
  // the file does not state them.
  int u_count = 0, v_count = 0, s_count = 0, t_count = 0;
  std::optional<int> border_px;
  ScoresRecord mean;
  std::optional<ScoresRecord> centre, corner;
  std::optional<ScoresRecord> dibr_mean, dibr_centre, dibr_corner;
  std::vector<ViewRecord> views;
  std::optional<int> views_above_dibr;
};
ComparisonRecord ReadComparisonRecord(const std::string& path);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_ESTIMATE_RECORDS_H_
