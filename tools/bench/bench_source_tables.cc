#include "tools/bench/bench_source_tables.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <set>
#include <utility>

#include "thicklens/base/stopwatch.h"
#include "thicklens/estimator/render.h"
#include "thicklens/kernels/kernels.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/thick_lens.h"
#include "tools/bench/bench_solvers.h"

namespace thicklens::tools {
namespace {

using estimator::BlockSolver;

// Returns 'K' or 'L' for an image of the paper's sizes, otherwise a blank.
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

SourceRow RowOf(int table, const SourceImage& image, const std::string& implementation,
                int threads) {
  SourceRow row;
  row.table = table;
  row.image = image.name;
  row.width_px = image.whole.input.image.width_px;
  row.height_px = image.whole.input.image.height_px;
  row.views = image.views;
  row.implementation = implementation;
  row.threads = threads;
  if (table != 2) row.scored = ScoredAreaOf(image);
  return row;
}

// The row gets the mean PSNR of the parts and their worst residual.
SourceContender ByBlocks(SourceRow row, const SourceImage& image, BlockSolver solver, int threads,
                         kernels::Backend* backend) {
  row.extrapolated = image.sample;
  row.block_solver = estimator::BlockSolverName(solver);
  const estimator::EstimatePlan plan = SourcePlan(solver);
  return {row, [&image, solver, plan, threads, backend](SourceRow* out) {
            const bool is_first = out->seconds.empty();
            if (is_first) WarmUp(image, plan, backend);
            const PartsRun run = RunParts(image, plan, threads, backend);
            if (!is_first) return run.seconds();
            out->device = run.device;
            if (image.whole.has_truth()) {
              out->psnr_true_views_db = ScoresOfViews(image, run.estimates, threads).psnr_mean_db;
            }
            if (out->table == 3) {
              out->relative_residual = run.relative_residual;
              if (estimator::IsIterative(solver)) out->converged = run.converged;
            }
            return run.seconds();
          }};
}

// The PSNR is that of the same parts as for the blocks.
SourceContender OfWholeImage(SourceRow row, const SourceImage& image, LightFieldSolver solver,
                             int threads) {
  return {std::move(row), [&image, solver = std::move(solver), threads](SourceRow* out) {
            if (out->seconds.empty()) WarmUpWhole(image, solver.estimate);
            const Clock::time_point start = Clock::now();
            const model::LightField estimate = solver.estimate(image.whole.input);
            const double seconds = SecondsSince(start);
            if (out->seconds.empty() && image.whole.has_truth()) {
              out->psnr_true_views_db =
                  ScoresOfViews(image, PartsOf(image, estimate), threads).psnr_mean_db;
            }
            return seconds;
          }};
}

std::string NameOf(const LightFieldSolver& solver) {
  return solver.prior.empty() || solver.solver != "scene" ? solver.solver
                                                          : solver.solver + " " + solver.prior;
}

// Estimates the parts for a thick or thin lens, computes their images again for that lens, and
// compares them.
SourceContender OfLens(const std::string& lens, const SourceImage& image,
                       const model::Camera& camera, const SourceBench& bench) {
  SourceRow row = RowOf(4, image, lens, bench.threads);
  row.published_fidelity = PublishedFidelityOf(lens, image.size);
  // The parts are cut from the whole image, so that each part has the same lens. The rays of the
  // equivalent thin lens land at the same places, so depths give the same disparities.
  BenchScene taken = image.whole;
  taken.input.camera = camera;
  taken.input.grid = model::DefaultGrid(camera, image.views, image.views);
  taken.input.falloff_camera.reset();
  auto parts = std::make_shared<SourceImage>();
  parts->whole = std::move(taken);
  CutParts(!image.sample, PartCountOf(image.views), parts.get());
  row.extrapolated = parts->sample;
  row.block_solver = estimator::BlockSolverName(estimator::DefaultBlockSolver());
  return {row, [parts, &bench](SourceRow* out) {
            const estimator::EstimatePlan plan = SourcePlan(estimator::DefaultBlockSolver());
            if (out->seconds.empty()) WarmUp(*parts, plan, bench.processor.get());
            const PartsRun run = RunParts(*parts, plan, bench.threads, bench.processor.get());
            if (!out->seconds.empty()) return run.seconds();
            const FidelityScores again = ScoresOfImages(*parts, run.estimates, bench.threads);
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

void Cut(bool full, SourceImage* image) {
  const model::LinearImage& pixels = image->whole.input.image;
  image->size = SizeNameOf(pixels.width_px, pixels.height_px);
  CutParts(full, PartCountOf(image->views), image);
}

void AddTable1(const SourceBench& bench, const SourceImage& image,
               std::vector<SourceContender>* contenders) {
  const auto add = [&](const std::string& name, int threads, kernels::Backend* backend) {
    SourceRow row = RowOf(1, image, name, threads);
    row.published = PublishedSeconds(1, name, image.size, image.views);
    contenders->push_back(
        ByBlocks(std::move(row), image, estimator::DefaultBlockSolver(), threads, backend));
  };
  if (bench.device && !bench.device->has_double()) {
    spdlog::warn("{} has no double precision, which table 1 needs: its row is left out",
                 bench.device->description());
  } else if (bench.device) {
    add("opencl", 1, bench.device.get());
  }
  add("cpu", 1, bench.processor.get());
  if (bench.threads > 1) add("cpu, all threads", bench.threads, bench.processor.get());
  // Adds the default solver with the same numbers of threads as the rows above.
  for (const int threads : std::set<int>{1, bench.threads}) {
    for (LightFieldSolver& solver : WholeImageSolvers(threads)) {
      if (NameOf(solver) != "scene tv") continue;
      SourceRow row = RowOf(1, image, NameOf(solver), threads);
      contenders->push_back(OfWholeImage(std::move(row), image, solver, threads));
    }
  }
}

void AddTable2(const SourceBench& bench, const SourceImage& image,
               std::vector<SourceContender>* contenders) {
  const auto light_field = std::make_shared<model::LightField>(
      image.whole.has_truth()
          ? image.whole.truth
          : estimator::WarpedLightField(image.whole.input, false, bench.threads));
  const auto& pixels = image.whole.input.image;
  const double bytes =
      sizeof(float) * static_cast<double>(light_field->values.size() + pixels.values.size());
  const double triad_seconds = bytes / bench.triad_bytes_per_second;
  const auto add = [&](const std::string& name, int threads,
                       std::shared_ptr<kernels::Kernels<float>> kernels) {
    SourceRow row = RowOf(2, image, name, threads);
    row.published = PublishedSeconds(2, name, image.size, image.views);
    row.triad_seconds = triad_seconds;
    contenders->push_back({std::move(row), [light_field, kernels, threads](SourceRow*) {
                             const auto form = [&] {
                               const Clock::time_point start = Clock::now();
                               estimator::Photograph(*light_field, light_field->weights, nullptr,
                                                     nullptr, kernels.get(), threads);
                               return SecondsSince(start);
                             };
                             // Earlier runs may have released memory, which a first image would
                             // allocate again, and that takes much longer than the image itself.
                             form();
                             return form();
                           }});
  };
  if (bench.device) add("opencl", 1, bench.device->NewFloat());
  add("cpu", 1, bench.processor->NewFloat());
  add("native", 1, nullptr);
  if (bench.threads > 1) add("native", bench.threads, nullptr);
}

void AddTable3(const SourceBench& bench, const SourceImage& image,
               std::vector<SourceContender>* contenders) {
  for (const BlockSolver solver : estimator::BuiltInBlockSolvers()) {
    const std::string name = estimator::BlockSolverName(solver);
    if (solver == BlockSolver::kViennaCl && !bench.device) {
      spdlog::warn("the row of ViennaCL, which computes by OpenCL, is left out");
      continue;
    }
    SourceRow row = RowOf(3, image, name, 1);
    row.published = PublishedSeconds(3, name, image.size, image.views);
    contenders->push_back(ByBlocks(std::move(row), image, solver, 1, bench.processor.get()));
  }
  for (LightFieldSolver& solver : WholeImageSolvers(1)) {
    contenders->push_back(
        OfWholeImage(RowOf(3, image, NameOf(solver), 1), image, solver, bench.threads));
  }
}

void AddTable4(const SourceBench& bench, const SourceImage& image,
               std::vector<SourceContender>* contenders) {
  const model::Camera& camera = *image.whole.input.camera;
  contenders->push_back(OfLens("thick", image, camera, bench));
  contenders->push_back(OfLens("thin", image, model::ThinLensEquivalent(camera), bench));
}

}  // namespace thicklens::tools
