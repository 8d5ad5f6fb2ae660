#include "tools/bench/solvers_table.h"

#include <fmt/format.h>

namespace thicklens::tools {
namespace {

using nlohmann::json;

json TextOrNull(const std::string& text) { return text.empty() ? json() : json(text); }

// Two rows did the same work if both were measured, or both extrapolated from the same part.
bool AreSameWork(const SolversRow& a, const SolversRow& b) {
  return a.time.is_extrapolated == b.time.is_extrapolated;
}

std::string RatioCell(const SolversRow& first, const SolversRow& row, bool same_work) {
  if (AreSameWork(first, row) != same_work) return "-";
  return fmt::format("{:.4g}", first.time.median() / row.time.median());
}

std::string SampledTable(const SolversRun& run, const std::vector<SolversRow>& rows) {
  // Two lines of headings: the quantity, and what it refers to.
  constexpr char kForm[] = "{:<11}{:<9}{:<10}{:>10}{:>14}{:>14}{:>16}{:>14}{:>11}\n";
  std::string text = fmt::format(kForm, "", "", "", "seconds", "seconds", "times faster",
                                 "times faster", "PSNR dB", "PSNR dB");
  text += fmt::format(kForm, "solver", "", "prior", "measured", "extrapolated", "same work",
                      "extrapolated", "of the part", "of it all");
  for (const SolversRow& row : rows) {
    text += fmt::format(
        kForm, row.solver, row.block_solver, row.prior, row.time.MeasuredCell(),
        row.time.ExtrapolatedCell(), RatioCell(rows.front(), row, true),
        RatioCell(rows.front(), row, false), fmt::format("{:.2f}", row.psnr_part_db),
        row.psnr_whole_db ? fmt::format("{:.2f}", *row.psnr_whole_db) : std::string("-"));
  }
  return text + fmt::format(
                    "\nThe part: {}, in the middle of the {} x {} px that blocks solved; every "
                    "solver is judged on it.\nextrapolated: multiplied by {:.4g}, the pixels of "
                    "the whole image over those solved; its ratio\ncompares a measured with an "
                    "extrapolated time. --full solves and judges everything.\n",
                    ScoredAreaText(run.part), run.solved_px, run.solved_px, run.pixels_ratio);
}

std::string FullTable(const std::vector<SolversRow>& rows) {
  constexpr char kForm[] = "{:<11}{:<9}{:<10}{:>10}{:>14}{:>10}\n";
  std::string text =
      fmt::format(kForm, "solver", "", "prior", "seconds", "times faster", "PSNR dB");
  for (const SolversRow& row : rows) {
    text +=
        fmt::format(kForm, row.solver, row.block_solver, row.prior, row.time.MeasuredCell(),
                    RatioCell(rows.front(), row, true), fmt::format("{:.2f}", row.psnr_part_db));
  }
  return text;
}

}  // namespace

std::string SolversTableText(const SolversRun& run, const std::vector<SolversRow>& rows) {
  return fmt::format("{} x {} px, {} x {} views, one channel, {} thread(s), medians of {}\n\n",
                     run.width_px, run.height_px, run.u_count, run.v_count, run.threads,
                     run.repeat) +
         (run.is_sampled ? SampledTable(run, rows) : FullTable(rows));
}

json SolversRowJson(const SolversRun& run, const SolversRow& row, const SolversRow& first) {
  const bool extrapolated = row.time.is_extrapolated;
  json out = {{"solver", row.solver},
              {"block_solver", TextOrNull(row.block_solver)},
              {"prior", TextOrNull(row.prior)},
              {"size", {run.width_px, run.height_px}},
              {"views", {run.u_count, run.v_count}},
              {"threads", run.threads},
              {"extrapolated_from", extrapolated ? json({run.solved_px, run.solved_px}) : json()},
              {"times_faster", nullptr},
              {"times_faster_extrapolated", nullptr},
              {"psnr_db", row.psnr_whole_db ? json(*row.psnr_whole_db) : json()},
              {"psnr_part_db", run.is_sampled ? json(row.psnr_part_db) : json()}};
  out.update(row.time.Json());
  out[AreSameWork(first, row) ? "times_faster" : "times_faster_extrapolated"] =
      first.time.median() / row.time.median();
  return out;
}

}  // namespace thicklens::tools
