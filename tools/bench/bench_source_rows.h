#ifndef THICKLENS_TOOLS_BENCH_BENCH_SOURCE_ROWS_H_
#define THICKLENS_TOOLS_BENCH_BENCH_SOURCE_ROWS_H_

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tools/bench/bench_parts.h"
#include "tools/bench/source_figures.h"

namespace thicklens::tools {

// One line of one of the paper's tables, measured here.
struct SourceRow {
  int table = 0;
  std::string image;  // "K", "L", or the name of a file
  int width_px = 0, height_px = 0;
  int views = 0;  // across and down
  std::string implementation;
  std::string block_solver, device;  // where they are not in the name; may be empty
  std::string failure;               // why it could not be run; all later fields are then unknown
  int threads = 1;
  std::vector<double> seconds;              // of each run, for the whole image
  std::optional<BlockSample> extrapolated;  // absent: all of it was run
  std::optional<ScoredArea> scored;  // area that scores are computed on; absent: there are none
  std::optional<PublishedFigures> published;  // seconds
  std::optional<double> psnr_true_views_db;
  // Table 2: the time in which the machine's triad moves the bytes of light field and image.
  std::optional<double> triad_seconds;
  // Table 3: maximum over the blocks, and whether an iterative solver reached its tolerance.
  std::optional<double> relative_residual;
  std::optional<bool> converged;
  // Table 4: scores of the photograph formed again.
  std::optional<double> macade_standin, delta_e94_mean;
  std::optional<PublishedFidelity> published_fidelity;
};

// `rows` are all rows, including the one that the ratios refer to.
nlohmann::json SourceRowJson(const SourceRow& row, const std::vector<SourceRow>& rows);

// Returns the rows of one table with its heading, its ratios and the published values.
std::string SourceTableText(int table, const std::vector<SourceRow>& rows);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_BENCH_SOURCE_ROWS_H_
