// thicklens bench: the run time and the accuracy of the solvers on this machine.
#include <fmt/format.h>

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/stopwatch.h"
#include "thicklens/estimator/block_solver.h"
#include "thicklens/estimator/compare.h"
#include "thicklens/kernels/device.h"
#include "tools/bench/bench_accuracy.h"
#include "tools/bench/bench_calibration.h"
#include "tools/bench/bench_conditioning.h"
#include "tools/bench/bench_gamma.h"
#include "tools/bench/bench_inpainting.h"
#include "tools/bench/bench_loop.h"
#include "tools/bench/bench_machine.h"
#include "tools/bench/bench_parts.h"
#include "tools/bench/bench_scene.h"
#include "tools/bench/bench_solvers.h"
#include "tools/bench/bench_source.h"
#include "tools/bench/solvers_table.h"
#include "tools/commands/commands.h"
#include "tools/options/bench_options.h"
#include "tools/options/command_frame.h"
#include "tools/options/light_field_options.h"
#include "tools/options/option_values.h"
#include "tools/system/progress_line.h"

namespace thicklens::tools {
namespace {

constexpr int kSamplePx = 64;  // edge of the part on which blocks are measured

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
  bool by_blocks = false;
  SolversRow row;
};

std::pair<int, int> SizeOf(const std::string& text) {
  const auto parts = SplitPixels("--size", text, 'x', "WIDTHxHEIGHT");
  if (parts.size() != 2 || parts[0] < kSamplePx || parts[1] < kSamplePx) {
    throw UsageError(fmt::format("--size: WIDTHxHEIGHT, both at least {}, is expected, found '{}'",
                                 kSamplePx, text));
  }
  return {parts[0], parts[1]};
}

std::vector<Contender> Contenders(int threads, kernels::Backend* backend) {
  std::vector<Contender> contenders;
  const auto add = [&](LightFieldSolver solver, bool by_blocks) {
    SolversRow row;
    row.solver = solver.solver;
    row.block_solver = solver.block_solver;
    row.prior = solver.prior;
    contenders.push_back({std::move(solver), by_blocks, std::move(row)});
  };
  for (const auto solver : {estimator::BlockSolver::kUmfpack, estimator::BlockSolver::kCholmod,
                            estimator::BlockSolver::kEigen}) {
    if (estimator::IsBuiltIn(solver)) add(SolverByBlocks(solver, threads, backend), true);
  }
  for (LightFieldSolver& solver : WholeImageSolvers(threads)) add(std::move(solver), false);
  return contenders;
}

// Returns the image, and the part in its middle that the blocks solve and on which all solvers
// are judged.
SampledImage WithPartInTheMiddle(BenchScene whole, bool full) {
  SampledImage image;
  image.whole = std::move(whole);
  const model::LinearImage& pixels = image.whole.input.image;
  if (full || (pixels.width_px == kSamplePx && pixels.height_px == kSamplePx)) {
    image.rects = {{0, 0, pixels.width_px, pixels.height_px}};
    image.parts = {image.whole};
    return image;
  }
  image.rects = {{(pixels.width_px - kSamplePx) / 2, (pixels.height_px - kSamplePx) / 2, kSamplePx,
                  kSamplePx}};
  image.parts = {PartOf(image.whole, image.rects.front())};
  image.sample = BlockSample{};
  image.pixels_per_part_pixel =
      static_cast<double>(pixels.width_px) * pixels.height_px / (kSamplePx * kSamplePx);
  return image;
}

double PsnrOfWholeDb(const BenchScene& scene, const model::LightField& estimate, int threads) {
  return estimator::CompareLightFields(scene.truth, estimate, BorderPx(scene.input.image),
                                       std::nullopt, threads)
      .mean.psnr_db;
}

void JudgeSolver(const SampledImage& image, const model::LightField& estimate, bool is_whole,
                 int threads, SolversRow* row) {
  const std::vector<model::LightField> parts =
      is_whole ? PartsOf(image, estimate) : std::vector<model::LightField>{estimate};
  row->psnr_part_db = ScoresOfViews(image, parts, threads).psnr_mean_db;
  if (is_whole) row->psnr_whole_db = PsnrOfWholeDb(image.whole, estimate, threads);
}

// The first run of each solver, on the part, is not counted.
void Measure(const BenchOptions& options, const SampledImage& image, int threads,
             std::vector<Contender>* contenders) {
  ProgressLine progress("measuring", options.common.quiet);
  MeasureInRounds(options.repeat, contenders->size(), &progress, [&](int round, std::size_t i) {
    Contender& contender = (*contenders)[i];
    const bool is_sampled = contender.by_blocks && image.sample.has_value();
    const BenchScene& scene = is_sampled ? image.parts.front() : image.whole;
    if (round == 0) {
      WarmUpWhole(image,
                  [&](const estimator::EstimateInput& input) { contender.way.estimate(input); });
    }
    const Clock::time_point start = Clock::now();
    const model::LightField estimate = contender.way.estimate(scene.input);
    contender.row.time.seconds.push_back(SecondsSince(start) *
                                         (is_sampled ? image.pixels_per_part_pixel : 1));
    contender.row.time.is_extrapolated = is_sampled;
    if (round == 0) JudgeSolver(image, estimate, !is_sampled, threads, &contender.row);
  });
}

CommandResult BenchSolvers(const BenchOptions& options) {
  SolversRun run;
  std::tie(run.width_px, run.height_px) = SizeOf(options.size);
  std::tie(run.u_count, run.v_count) = ViewCounts(options.views);
  if (run.u_count == 0) run.u_count = run.v_count = 7;
  run.threads = ResolveThreads(options.common.threads);
  run.repeat = options.repeat;
  SampledImage image;
  {
    ProgressLine progress("simulating", options.common.quiet);
    image = WithPartInTheMiddle(
        MakeBenchScene(run.width_px, run.height_px, run.u_count, run.v_count, options.seed, 0,
                       [&](int done, int total) {
                         ThrowIfCancelled();
                         progress.Show(done, total);
                       }),
        options.full);
  }
  run.part = ScoredAreaOf(image);
  run.is_sampled = image.sample.has_value();
  run.pixels_ratio = image.pixels_per_part_pixel;
  run.solved_px = kSamplePx;
  const auto backend =
      kernels::OpenBackend(kernels::ParseDeviceRequest("cpu"), nullptr, ThrowIfCancelled);
  std::vector<Contender> contenders = Contenders(run.threads, backend.get());
  Measure(options, image, run.threads, &contenders);

  std::vector<SolversRow> rows;
  for (Contender& contender : contenders) rows.push_back(std::move(contender.row));
  PrintResult(options.common, SolversTableText(run, rows));
  nlohmann::json json_rows = nlohmann::json::array();
  for (const SolversRow& row : rows) json_rows.push_back(SolversRowJson(run, row, rows.front()));
  const model::PixelRect& rect = image.rects.front();
  return {
      BenchSummary(
          {{"scene", {{"kind", "slanted plane of noise"}, {"channels", 1}, {"seed", options.seed}}},
           {"repeat", options.repeat},
           {"part", run.is_sampled
                        ? nlohmann::json({{"rect_px", {rect.x, rect.y, rect.width, rect.height}},
                                          {"scored", ScoredAreaJson(run.part)}})
                        : nlohmann::json()},
           {"rows", json_rows}}),
      ""};
}

}  // namespace

void AddBenchCommand(CLI::App* program, CommandAction* action) {
  CLI::App* bench =
      program->add_subcommand("bench", "Benchmarks: accuracy against run time on this machine");
  bench->require_subcommand(1);
  AddBenchAccuracyCommand(bench, action);
  AddBenchSourceCommand(bench, action);
  AddBenchGammaCommand(bench, action);
  AddBenchConditioningCommand(bench, action);
  AddBenchInpaintingCommand(bench, action);
  AddBenchCalibrationCommand(bench, action);
  CLI::App* command = bench->add_subcommand(
      "solvers", "All light-field solvers on one simulated image, in one run");
  const auto options = std::make_shared<BenchOptions>();
  command->add_option("--size", options->size, "Size of the image, px")
      ->capture_default_str()
      ->type_name("WIDTHxHEIGHT");
  AddViewsOption(command, &options->views, "Number of views across and down; default 7x7");
  AddRepeatOption(command, &options->repeat);
  command->add_flag("--full", options->full, "Solve all blocks of the image, not a sample");
  AddSeedOption(command, &options->seed);
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] { RunCommand(options->common, [&] { return BenchSolvers(*options); }); };
  });
}

}  // namespace thicklens::tools
