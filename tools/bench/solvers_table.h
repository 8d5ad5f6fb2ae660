#ifndef THICKLENS_TOOLS_BENCH_SOLVERS_TABLE_H_
#define THICKLENS_TOOLS_BENCH_SOLVERS_TABLE_H_

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tools/bench/bench_parts.h"
#include "tools/bench/whole_time.h"

namespace thicklens::tools {

// One solver of `bench solvers`. Solvers by blocks may have solved only a part of the image: their
// time is then extrapolated, and they have no PSNR of the whole.
struct SolversRow {
  std::string solver, block_solver, prior;  // empty: not applicable
  WholeTime time;
  double psnr_part_db = 0;              // on the part that every solver is judged on
  std::optional<double> psnr_whole_db;  // absent: the whole was not solved
};

// Data that all rows share.
struct SolversRun {
  int width_px = 0, height_px = 0, u_count = 0, v_count = 0, threads = 0, repeat = 0;
  ScoredArea part;          // the part that psnr_part_db is computed on
  bool is_sampled = false;  // false: the part is the whole, without its border
  double pixels_ratio = 1;  // pixels of the whole over those of the part that blocks solved
  int solved_px = 0;        // edge of that part
};

// Returns a table for the terminal: measured and extrapolated seconds, and PSNRs of different
// areas, are in columns of their own. Ratios are to the first row.
std::string SolversTableText(const SolversRun& run, const std::vector<SolversRow>& rows);
nlohmann::json SolversRowJson(const SolversRun& run, const SolversRow& row,
                              const SolversRow& first);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_SOLVERS_TABLE_H_
