// thicklens bench gamma: measures the effects that the paper discusses for its multiplier gamma.
#include "tools/bench/bench_gamma.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"
#include "thicklens/estimator/compare.h"
#include "thicklens/estimator/render.h"
#include "thicklens/estimator/solve.h"
#include "thicklens/model/encoded_values.h"
#include "tools/bench/bench_loop.h"
#include "tools/bench/bench_machine.h"
#include "tools/bench/bench_parts.h"
#include "tools/bench/bench_scene.h"
#include "tools/bench/bench_solvers.h"
#include "tools/options/bench_options.h"
#include "tools/options/option_values.h"
#include "tools/system/progress_line.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;

struct BenchGammaOptions {
  CommonOptions common;
  int size_px = 64;
  int views = 5;
  int repeat = 5;
  std::uint64_t seed = 1;
};

// Toward 0, then in decades over the range that the paper discusses.
std::vector<double> Gammas() {
  std::vector<double> gammas = {1e-12, 1e-9, 1e-6};
  for (int decade = -4; decade <= 4; ++decade) gammas.push_back(std::pow(10.0, decade));
  return gammas;
}

struct GammaRow {
  double gamma = 0;
  std::optional<double> ridge;  // absent: the default of this program
  std::vector<double> seconds;
  std::string failure;  // why the solver stopped; the values below are then unknown
  double rcond = 0, relative_residual = 0, psnr_true_views_db = 0, psnr_image_db = 0;
  bool IsRefused() const { return !(rcond >= estimator::BlockOptions().rcond_min); }
};

void Run(const BenchScene& scene, const BenchGammaOptions& options, GammaRow* row) {
  estimator::BlockOptions blocks;
  blocks.block_px = kSourceBlockPx;
  blocks.gamma = row->gamma;
  blocks.ridge = row->ridge;
  blocks.rcond_min = 0;  // shows the results that `estimate` would refuse
  estimator::SolverRun run;
  run.threads = options.common.threads;
  estimator::SolverSummary summary;
  model::LightField estimate;
  try {
    estimate = estimator::Solve(scene.input, blocks, run, &summary);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {
    if (std::string(error.what()).find("singular") == std::string::npos) throw;
    row->failure = "a block's system is singular to the last bit";
    return;
  }
  row->seconds.push_back(summary.setup_seconds + summary.solve_seconds);
  if (row->seconds.size() > 1) return;
  const int border_px = std::min(20, options.size_px / 4);
  row->rcond = summary.rcond_min.value_or(0);
  row->relative_residual = summary.relative_residual;
  row->psnr_true_views_db = estimator::CompareLightFields(scene.truth, estimate, border_px,
                                                          std::nullopt, options.common.threads)
                                .mean.psnr_db;
  const model::LinearImage again =
      estimator::Photograph(estimate, scene.input.weights, &*scene.input.camera, nullptr, nullptr,
                            options.common.threads);
  row->psnr_image_db =
      estimator::CompareImages(model::EncodedValuesOf(scene.input.image, scene.input.transfer),
                               model::EncodedValuesOf(again, scene.input.transfer), border_px)
          .psnr_db;
}

std::string RowText(const GammaRow& row) {
  if (!row.failure.empty()) {
    return fmt::format("{:>7.0e}{:>9}{:>10}  {}\n", row.gamma, row.ridge ? "none" : "usual", "-",
                       row.failure);
  }
  return fmt::format("{:>7.0e}{:>9}{:>10.3g}{:>10.1e}{:>11.1e}{:>12.2f}{:>11.2f}  {}\n", row.gamma,
                     row.ridge ? "none" : "usual", Median(row.seconds), row.rcond,
                     row.relative_residual, row.psnr_image_db, row.psnr_true_views_db,
                     row.IsRefused() ? "estimate refuses this" : "");
}

json RowJson(const GammaRow& row) {
  json out = {{"gamma", row.gamma},
              {"ridge", row.ridge ? json(*row.ridge) : json()},
              {"failure", row.failure.empty() ? json() : json(row.failure)}};
  if (!row.failure.empty()) return out;
  out.update({{"seconds", Median(row.seconds)},
              {"seconds_of_runs", row.seconds},
              {"rcond_min", row.rcond},
              {"relative_residual", row.relative_residual},
              {"psnr_image_db", row.psnr_image_db},
              {"psnr_true_views_db", row.psnr_true_views_db},
              {"refused", row.IsRefused()}});
  return out;
}

CommandResult BenchGamma(const BenchGammaOptions& options) {
  const BenchScene scene =
      MakeBenchScene(options.size_px, options.size_px, options.views, options.views, options.seed,
                     options.common.threads, [](int, int) { ThrowIfCancelled(); });
  const double dibr_db =
      estimator::CompareLightFields(
          scene.truth, estimator::WarpedLightField(scene.input, true, options.common.threads),
          std::min(20, options.size_px / 4), std::nullopt, options.common.threads)
          .mean.psnr_db;
  std::vector<GammaRow> rows;
  for (const std::optional<double> ridge : {std::optional<double>(), std::optional<double>(0.0)}) {
    for (const double gamma : Gammas()) rows.push_back({gamma, ridge, {}, "", 0, 0, 0, 0});
  }
  {
    ProgressLine progress("measuring", options.common.quiet);
    RunPlan(SourcePlan(estimator::DefaultBlockSolver()), scene.input, options.common.threads,
            nullptr);  // not counted, so that no row has a cold start
    MeasureInRounds(options.repeat, rows.size(), &progress, [&](int, std::size_t i) {
      if (rows[i].failure.empty()) Run(scene, options, &rows[i]);
    });
  }
  std::string text = fmt::format(
      "gamma of the paper's functional, by blocks of 16 px ({}) of {} x {} px, {} x {} views, "
      "medians of {};\nwarping alone (DIBR): {:.2f} "
      "dB\n\n{:>7}{:>9}{:>10}{:>10}{:>11}{:>12}{:>11}\n",
      estimator::BlockSolverName(estimator::DefaultBlockSolver()), options.size_px, options.size_px,
      options.views, options.views, options.repeat, dibr_db, "gamma", "ridge", "seconds", "rcond",
      "residual", "image dB", "views dB");
  json json_rows = json::array();
  for (const GammaRow& row : rows) {
    text += RowText(row);
    json_rows.push_back(RowJson(row));
  }
  text +=
      "\nimage: PSNR of the photograph computed from the views, which is the equation that is "
      "solved;\nviews: PSNR against the true views. Below an rcond of 1e-12 `estimate` ends with "
      "an error.\n";
  PrintResult(options.common, text);
  return {
      BenchSummary({{"size", {options.size_px, options.size_px}},
                    {"views", {options.views, options.views}},
                    {"block_solver", estimator::BlockSolverName(estimator::DefaultBlockSolver())},
                    {"threads", ResolveThreads(options.common.threads)},
                    {"repeat", options.repeat},
                    {"seed", options.seed},
                    {"dibr_psnr_db", dibr_db},
                    {"rows", json_rows}}),
      ""};
}

}  // namespace

void AddBenchGammaCommand(CLI::App* bench, CommandAction* action) {
  CLI::App* command = bench->add_subcommand(
      "gamma", "Effect of the paper's multiplier gamma on quality, conditioning and time");
  const auto options = std::make_shared<BenchGammaOptions>();
  AddSizeOption(command, 64, &options->size_px);
  AddSquareViewsOption(command, &options->views);
  AddRepeatOption(command, &options->repeat);
  AddSeedOption(command, &options->seed);
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] { RunCommand(options->common, [&] { return BenchGamma(*options); }); };
  });
}

}  // namespace thicklens::tools
