// thicklens bench: what the solvers cost on this machine, and what they give for it.
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bench_accuracy.h"
#include "bench_calibration.h"
#include "bench_conditioning.h"
#include "bench_gamma.h"
#include "bench_inpainting.h"
#include "bench_machine.h"
#include "bench_options.h"
#include "bench_scene.h"
#include "bench_solvers.h"
#include "bench_source.h"
#include "commands.h"
#include "interrupt.h"
#include "light_field_options.h"
#include "option_values.h"
#include "progress_line.h"
#include "stopwatch.h"
#include "thicklens/error.h"
#include "thicklens/estimator/compare.h"
#include "thicklens/estimator/estimate.h"
#include "thicklens/kernels/device.h"
#include "thicklens/model/parallel.h"

namespace thicklens::tools {
namespace {

constexpr int kSamplePx = 64;  // edge of the part that blocks are measured on

struct BenchOptions {
  CommonOptions common;
  std::string size = "256x256";
  ViewsOption views;
  int repeat = 5;
  bool full = false;
  std::uint64_t seed = 1;
};

struct Contender {
  LightFieldSolver way;
  const BenchScene* scene = nullptr;
  std::vector<double> seconds;
  double psnr_db = 0;
};

std::pair<int, int> SizeOf(const std::string& text) {
  const auto parts = SplitPixels("--size", text, 'x', "WIDTHxHEIGHT");
  if (parts.size() != 2 || parts[0] < kSamplePx || parts[1] < kSamplePx) {
    throw UsageError(fmt::format("--size: WIDTHxHEIGHT, both at least {}, is expected, found '{}'",
                                 kSamplePx, text));
  }
  return {parts[0], parts[1]};
}

std::vector<Contender> Contenders(const BenchScene& whole, const BenchScene& sample, int threads,
                                  kernels::Backend* backend) {
  std::vector<Contender> contenders;
  for (const auto solver : {estimator::BlockSolver::kUmfpack, estimator::BlockSolver::kCholmod,
                            estimator::BlockSolver::kEigen}) {
    if (!estimator::IsBuiltIn(solver)) continue;
    contenders.push_back({SolverByBlocks(solver, threads, backend), &sample, {}, 0});
  }
  for (LightFieldSolver& solver : WholePictureSolvers(threads)) {
    contenders.push_back({std::move(solver), &whole, {}, 0});
  }
  return contenders;
}

double PsnrDb(const BenchScene& scene, const model::LightField& estimate, int threads) {
  const int border_px =
      std::min(20, std::min(scene.input.picture.width_px, scene.input.picture.height_px) / 4);
  return estimator::CompareLightFields(scene.truth, estimate, border_px, std::nullopt, threads)
      .mean.psnr_db;
}

// Round by round, so that what else the machine does falls on all alike.
void Measure(const BenchOptions& options, int threads, std::vector<Contender>* contenders) {
  ProgressLine progress("measuring", options.common.quiet);
  const int total = options.repeat * static_cast<int>(contenders->size());
  int done = 0;
  for (int round = 0; round < options.repeat; ++round) {
    for (Contender& contender : *contenders) {
      ThrowIfInterrupted();
      const Clock::time_point start = Clock::now();
      const model::LightField estimate = contender.way.estimate(contender.scene->input);
      contender.seconds.push_back(SecondsSince(start));
      if (round == 0) contender.psnr_db = PsnrDb(*contender.scene, estimate, threads);
      progress.Show(++done, total);
    }
  }
}

CommandResult BenchSolvers(const BenchOptions& options) {
  const auto [width_px, height_px] = SizeOf(options.size);
  auto [u_count, v_count] = ViewCounts(options.views);
  if (u_count == 0) u_count = v_count = 7;
  const int threads = model::ResolveThreads(options.common.threads);
  BenchScene whole;
  {
    ProgressLine progress("simulating", options.common.quiet);
    whole = MakeBenchScene(width_px, height_px, u_count, v_count, options.seed, 0,
                           [&](int done, int total) {
                             ThrowIfInterrupted();
                             progress.Show(done, total);
                           });
  }
  const BenchScene sample = options.full ? whole : MiddleOf(whole, kSamplePx, kSamplePx);
  const auto backend =
      kernels::OpenBackend(kernels::ParseDeviceRequest("cpu"), nullptr, ThrowIfInterrupted);
  std::vector<Contender> contenders = Contenders(whole, sample, threads, backend.get());
  Measure(options, threads, &contenders);

  const double pixels = static_cast<double>(width_px) * height_px;
  const double share = pixels / (static_cast<double>(sample.input.picture.width_px) *
                                 sample.input.picture.height_px);
  std::string text = fmt::format(
      "{} x {} px, {} x {} views, one channel, {} thread(s), medians of {}\n\n"
      "{:<11}{:<9}{:<10}{:>10}{:>14}{:>10}\n",
      width_px, height_px, u_count, v_count, threads, options.repeat, "solver", "", "prior",
      "seconds", "times faster", "PSNR dB");
  nlohmann::json rows = nlohmann::json::array();
  std::optional<double> blocks_seconds;
  bool extrapolated_any = false;
  for (const Contender& contender : contenders) {
    const bool extrapolated = contender.scene != &whole && !options.full;
    const double seconds = Median(contender.seconds) * (extrapolated ? share : 1);
    if (!blocks_seconds) blocks_seconds = seconds;
    extrapolated_any = extrapolated_any || extrapolated;
    const auto or_null = [](const std::string& name) {
      return name.empty() ? nlohmann::json() : nlohmann::json(name);
    };
    rows.push_back({{"solver", contender.way.solver},
                    {"block_solver", or_null(contender.way.block_solver)},
                    {"prior", or_null(contender.way.prior)},
                    {"size", {width_px, height_px}},
                    {"views", {u_count, v_count}},
                    {"threads", threads},
                    {"extrapolated_from",
                     extrapolated ? nlohmann::json({kSamplePx, kSamplePx}) : nlohmann::json()},
                    {"seconds", seconds},
                    {"seconds_of_runs", contender.seconds},
                    {"psnr_db", contender.psnr_db}});
    text += fmt::format("{:<11}{:<9}{:<10}{:>9.3g}{}{:>14.4g}{:>10.2f}\n", contender.way.solver,
                        contender.way.block_solver, contender.way.prior, seconds,
                        extrapolated ? "*" : " ", *blocks_seconds / seconds, contender.psnr_db);
  }
  if (extrapolated_any) {
    text += fmt::format(
        "\n* of {} x {} px in the middle of the picture, times {:.4g}; their PSNR is of that part. "
        "--full measures all.\n",
        kSamplePx, kSamplePx, share);
  }
  PrintResult(options.common, text);
  return {
      BenchSummary(
          {{"scene", {{"kind", "slanted plane of noise"}, {"channels", 1}, {"seed", options.seed}}},
           {"repeat", options.repeat},
           {"rows", rows}}),
      ""};
}

}  // namespace

void AddBenchCommand(CLI::App* program, CommandAction* action) {
  CLI::App* bench =
      program->add_subcommand("bench", "What accuracy costs in time, on this machine");
  bench->require_subcommand(1);
  AddBenchAccuracyCommand(bench, action);
  AddBenchSourceCommand(bench, action);
  AddBenchGammaCommand(bench, action);
  AddBenchConditioningCommand(bench, action);
  AddBenchInpaintingCommand(bench, action);
  AddBenchCalibrationCommand(bench, action);
  CLI::App* command = bench->add_subcommand(
      "solvers", "All light-field solvers on one simulated picture, in one run");
  const auto options = std::make_shared<BenchOptions>();
  command->add_option("--size", options->size, "Of the picture, px")
      ->capture_default_str()
      ->type_name("WIDTHxHEIGHT");
  AddViewsOption(command, &options->views, "Views across and down; default 7x7");
  AddRepeatOption(command, &options->repeat);
  command->add_flag("--full", options->full, "Blocks of the whole picture, not of a sample");
  AddSeedOption(command, &options->seed);
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] { RunCommand(options->common, [&] { return BenchSolvers(*options); }); };
  });
}

}  // namespace thicklens::tools
