#include "tools/bench/bench_source_tables.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <set>
#include <utility>

#include "thicklens/base/stopwatch.h"
#include "thicklens/estimator/render.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/thick_lens.h"
#include "tools/bench/bench_solvers.h"

namespace thicklens::tools {
namespace {

using estimator::BlockSolver;

// Returns 'K' or 'L' for a picture of the paper's sizes, otherwise a blank.
char SizeNameOf(int width_px, int height_px) {
  if (width_px == 640 && height_px == 480) return 'K';
  return width_px == 256 && height_px == 256 ? 'L' : ' ';
}

// Limits the run of each number of views to minutes: blocks of 7 x 7 views take 60 times as long as
// those of 3 x 3.
PartCount PartCountOf(int views) {
  if (views <= 3) return PartCount::kFour;
  return views <= 5 ? PartCount::kTwo : PartCount::kOne;
}

SourceRow RowOf(int table, const SourcePicture& picture, const std::string& implementation,
                int threads) {
  SourceRow row;
  row.table = table;
  row.picture = picture.name;
  row.width_px = picture.whole.input.picture.width_px;
  row.height_px = picture.whole.input.picture.height_px;
  row.views = picture.views;
  row.implementation = implementation;
  row.threads = threads;
  if (table != 2) row.scored = ScoredAreaOf(picture);
  return row;
}

// The row gets the mean PSNR of the parts and their worst residual.
SourceContender ByBlocks(SourceRow row, const SourcePicture& picture, BlockSolver solver,
                         int threads, kernels::Backend* backend) {
  row.extrapolated = picture.sample;
  row.block_solver = estimator::BlockSolverName(solver);
  const estimator::EstimatePlan plan = SourcePlan(solver);
  return {row, [&picture, solver, plan, threads, backend](SourceRow* out) {
            const bool is_first = out->seconds.empty();
            if (is_first) WarmUp(picture, plan, backend);
            const PartsRun run = RunParts(picture, plan, threads, backend);
            if (!is_first) return run.seconds();
            out->device = run.device;
            if (picture.whole.has_truth()) {
              out->psnr_true_views_db = ScoresOfViews(picture, run.estimates, threads).psnr_mean_db;
            }
            if (out->table == 3) {
              out->relative_residual = run.relative_residual;
              if (estimator::IsIterative(solver)) out->converged = run.converged;
            }
            return run.seconds();
          }};
}

// The PSNR is that of the same parts as for the blocks.
SourceContender OfWholePicture(SourceRow row, const SourcePicture& picture, LightFieldSolver solver,
                               int threads) {
  return {std::move(row), [&picture, solver = std::move(solver), threads](SourceRow* out) {
            if (out->seconds.empty()) WarmUpWhole(picture, solver.estimate);
            const Clock::time_point start = Clock::now();
            const model::LightField estimate = solver.estimate(picture.whole.input);
            const double seconds = SecondsSince(start);
            if (out->seconds.empty() && picture.whole.has_truth()) {
              out->psnr_true_views_db =
                  ScoresOfViews(picture, PartsOf(picture, estimate), threads).psnr_mean_db;
            }
            return seconds;
          }};
}

std::string NameOf(const LightFieldSolver& solver) {
  return solver.prior.empty() || solver.solver != "scene" ? solver.solver
                                                          : solver.solver + " " + solver.prior;
}

// Estimates the parts for a thick or thin lens, computes their pictures again for that lens, and
// compares them.
SourceContender OfLens(const std::string& lens, const SourcePicture& picture,
                       const model::Camera& camera, const SourceBench& bench) {
  SourceRow row = RowOf(4, picture, lens, bench.threads);
  row.published_fidelity = PublishedFidelityOf(lens, picture.size);
  // The parts are cut from the whole picture, so that each part has the same lens. The rays of the
  // equivalent thin lens land at the same places, so depths give the same disparities.
  BenchScene taken = picture.whole;
  taken.input.camera = camera;
  taken.input.grid = model::DefaultGrid(camera, picture.views, picture.views);
  taken.input.falloff_camera.reset();
  auto parts = std::make_shared<SourcePicture>();
  parts->whole = std::move(taken);
  CutParts(!picture.sample, PartCountOf(picture.views), parts.get());
  row.extrapolated = parts->sample;
  row.block_solver = estimator::BlockSolverName(estimator::DefaultBlockSolver());
  return {row, [parts, &bench](SourceRow* out) {
            const estimator::EstimatePlan plan = SourcePlan(estimator::DefaultBlockSolver());
            if (out->seconds.empty()) WarmUp(*parts, plan, bench.processor.get());
            const PartsRun run = RunParts(*parts, plan, bench.threads, bench.processor.get());
            if (!out->seconds.empty()) return run.seconds();
            const FidelityScores again = ScoresOfPictures(*parts, run.estimates, bench.threads);
            out->macade_standin = again.macade_standin;
            out->delta_e94_mean = again.delta_e94_mean;
            if (parts->whole.has_truth()) {
              out->psnr_true_views_db =
                  ScoresOfViews(*parts, run.estimates, bench.threads).psnr_mean_db;
            }
            return run.seconds();
          }};
}

}  // namespace

void Cut(bool full, SourcePicture* picture) {
  const model::LinearPicture& pixels = picture->whole.input.picture;
  picture->size = SizeNameOf(pixels.width_px, pixels.height_px);
  CutParts(full, PartCountOf(picture->views), picture);
}

void AddTable1(const SourceBench& bench, const SourcePicture& picture,
               std::vector<SourceContender>* contenders) {
  const auto add = [&](const std::string& name, int threads, kernels::Backend* backend) {
    SourceRow row = RowOf(1, picture, name, threads);
    row.published = PublishedSeconds(1, name, picture.size, picture.views);
    contenders->push_back(
        ByBlocks(std::move(row), picture, estimator::DefaultBlockSolver(), threads, backend));
  };
  if (bench.device && !bench.device->has_double()) {
    spdlog::warn("{} has no double precision, which table 1 needs: its row is left out",
                 bench.device->description());
  } else if (bench.device) {
    add("opencl", 1, bench.device.get());
  }
  add("cpu", 1, bench.processor.get());
  if (bench.threads > 1) add("cpu, all threads", bench.threads, bench.processor.get());
  // With the same numbers of threads as the rows above.
  for (const int threads : std::set<int>{1, bench.threads}) {
    for (LightFieldSolver& solver : WholePictureSolvers(threads)) {
      if (NameOf(solver) != "scene tv") continue;
      SourceRow row = RowOf(1, picture, NameOf(solver), threads);
      contenders->push_back(OfWholePicture(std::move(row), picture, solver, threads));
    }
  }
}

void AddTable2(const SourceBench& bench, const SourcePicture& picture,
               std::vector<SourceContender>* contenders) {
  const auto light_field = std::make_shared<model::LightField>(
      picture.whole.has_truth()
          ? picture.whole.truth
          : estimator::WarpedLightField(picture.whole.input, false, bench.threads));
  const auto& pixels = picture.whole.input.picture;
  const double bytes =
      sizeof(float) * static_cast<double>(light_field->values.size() + pixels.values.size());
  const double triad_seconds = bytes / bench.triad_bytes_per_second;
  const auto add = [&](const std::string& name, int threads,
                       std::shared_ptr<kernels::Kernels<float>> kernels) {
    SourceRow row = RowOf(2, picture, name, threads);
    row.published = PublishedSeconds(2, name, picture.size, picture.views);
    row.triad_seconds = triad_seconds;
    contenders->push_back({std::move(row), [light_field, kernels, threads](SourceRow*) {
                             const auto form = [&] {
                               const Clock::time_point start = Clock::now();
                               estimator::Photograph(*light_field, light_field->weights, nullptr,
                                                     nullptr, kernels.get(), threads);
                               return SecondsSince(start);
                             };
                             // Earlier runs may have released memory, which a first picture would
                             // allocate again, and that takes much longer than the picture itself.
                             form();
                             return form();
                           }});
  };
  if (bench.device) add("opencl", 1, bench.device->NewFloat());
  add("cpu", 1, bench.processor->NewFloat());
  add("native", 1, nullptr);
  if (bench.threads > 1) add("native", bench.threads, nullptr);
}

void AddTable3(const SourceBench& bench, const SourcePicture& picture,
               std::vector<SourceContender>* contenders) {
  for (const BlockSolver solver : estimator::BuiltInBlockSolvers()) {
    const std::string name = estimator::BlockSolverName(solver);
    if (solver == BlockSolver::kViennaCl && !bench.device) {
      spdlog::warn("the row of ViennaCL, which computes by OpenCL, is left out");
      continue;
    }
    SourceRow row = RowOf(3, picture, name, 1);
    row.published = PublishedSeconds(3, name, picture.size, picture.views);
    contenders->push_back(ByBlocks(std::move(row), picture, solver, 1, bench.processor.get()));
  }
  for (LightFieldSolver& solver : WholePictureSolvers(1)) {
    contenders->push_back(
        OfWholePicture(RowOf(3, picture, NameOf(solver), 1), picture, solver, bench.threads));
  }
}

void AddTable4(const SourceBench& bench, const SourcePicture& picture,
               std::vector<SourceContender>* contenders) {
  const model::Camera& camera = *picture.whole.input.camera;
  contenders->push_back(OfLens("thick", picture, camera, bench));
  contenders->push_back(OfLens("thin", picture, model::ThinTwin(camera), bench));
}

}  // namespace thicklens::tools
