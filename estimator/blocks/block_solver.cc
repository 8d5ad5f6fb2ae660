#include "thicklens/estimator/block_solver.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "estimator/blocks/block_system.h"
#include "estimator/blocks/linear_solver.h"
#include "estimator/views/input_checks.h"
#include "estimator/views/option_checks.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/index.h"
#include "thicklens/base/iteration_progress.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/residual_guard.h"
#include "thicklens/base/run_cost.h"
#include "thicklens/estimator/blas.h"
#include "thicklens/estimator/block_store.h"
#include "thicklens/kernels/device.h"

namespace thicklens::estimator {
namespace {

using kernels::BlockGeometry;
using kernels::Kernels;
constexpr int kDefaultBlockPx = 16;  // the paper's size

// Divides an image into blocks, row by row; the blocks at the right and lower border may be
// smaller.
std::vector<model::PixelRect> CutInBlocks(int width_px, int height_px, int block_px) {
  std::vector<model::PixelRect> blocks;
  for (int y = 0; y < height_px; y += block_px) {
    for (int x = 0; x < width_px; x += block_px) {
      blocks.push_back({x, y, std::min(block_px, width_px - x), std::min(block_px, height_px - y)});
    }
  }
  return blocks;
}

// Bytes of a block's system besides its factor: the patterns of its parts and of their sum, the
// values, the matrix, the solver's 64-bit copy of it, H, D, their transposes and the vectors.
double SystemBytes(const kernels::CsrMatrix<double>& matrix) {
  constexpr double kPerEntry = 3 * 4 + 8 + 12 + 16;
  constexpr double kPerRay = 3 * 12 * 4 + 10 * 8;
  return kPerEntry * static_cast<double>(matrix.entries()) + kPerRay * matrix.rows;
}
// Factor for memory that malloc cannot reuse between blocks of different sizes; measured. UMFPACK
// reports a bound for the worst pivots, and blocks stay well below it.
double LeftBetweenBlocks(BlockSolver solver) {
  return solver == BlockSolver::kUmfpack ? 1.1 : 1.35;
}
// Bytes of a thread's stack and heap, and of what the BLAS keeps for it.
constexpr double kBytesPerThread = 12 * kBytesPerMib;

// Disparities of a block in the disparity map, px per view step of the larger step.
struct BlockSlopes {
  double largest_px = 0;  // |m|
  double range_px = 0;
  // Taps of the links between neighbouring views that stay in the block: one where m is whole, two
  // otherwise, none at a depth edge. Links cause fill.
  double taps = 0;
};

BlockSlopes SlopesIn(const DisparityMap& map, const model::PixelRect& rect) {
  constexpr double kEdgePx = 0.3;
  constexpr double kWholePx = 1e-6;
  const double px_per_unit = map.step.cwiseAbs().maxCoeff();
  const auto at = [&](int x, int y) {
    return px_per_unit * map.disparity[Index(y) * Index(map.width_px) + Index(x)];
  };
  double least_px = at(rect.x, rect.y);
  double most_px = least_px;
  double taps = 0;
  for (int y = rect.y; y < rect.y + rect.height; ++y) {
    for (int x = rect.x; x < rect.x + rect.width; ++x) {
      const double m_px = at(x, y);
      least_px = std::min(least_px, m_px);
      most_px = std::max(most_px, m_px);
      if (x + 1 < rect.x + rect.width && std::abs(at(x + 1, y) - m_px) > kEdgePx) continue;
      if (y + 1 < rect.y + rect.height && std::abs(at(x, y + 1) - m_px) > kEdgePx) continue;
      const double of_link = std::abs(m_px - std::round(m_px)) < kWholePx ? 1 : 2;
      taps += of_link * (std::max(0.0, 1 - std::abs(m_px) / rect.width) +
                         std::max(0.0, 1 - std::abs(m_px) / rect.height));
    }
  }
  return {std::max(std::abs(least_px), std::abs(most_px)), most_px - least_px, taps};
}

// Predicts the maximum memory of the process while blocks of one size are solved on all threads:
// what it holds now, the whole light field twice (on the device and as the result), and for each
// block at work its system and the peak of its factorisation.
class MemoryForecast {
 public:
  MemoryForecast(const RayField& rays, const BlockOptions& options, double ridge, int threads,
                 Kernels<double>* kernels)
      : rays_(rays), options_(options), ridge_(ridge), threads_(threads), kernels_(kernels) {
    BlockBytes({0, 0, 1, 1});  // a device's programs are held after their first use
    held_bytes_ =
        ResidentBytes() + 2.0 * sizeof(float) * static_cast<double>(rays_.prior().values.size());
  }

  // Predicts from the structure of the system of the most demanding of a few blocks.
  double Bytes(int block_px) {
    double largest = 0;
    for (const model::PixelRect& rect : DemandingBlocks(block_px)) {
      largest = std::max(largest, BlockBytes(rect));
    }
    bytes_per_pixel_ = std::max(bytes_per_pixel_, largest / PixelsOf(block_px));
    return held_bytes_ + AtOnce(block_px) * (kBytesPerThread + largest);
  }

  // Lower bound of Bytes, without making a system. It combines the bytes of H^T H alone, where each
  // ray meets the rays of all views that land on its pixel, as a matrix and as the solver's copy,
  // with the bytes for each pixel that smaller blocks were found to need, since fill grows faster
  // than the number of pixels.
  double LeastBytes(int block_px) const {
    constexpr double kPerEntry = 12 + 16;
    const double views = static_cast<double>((rays_.input().weights > 0).count());
    const double per_pixel = std::max(kPerEntry * views * views, bytes_per_pixel_);
    return held_bytes_ + AtOnce(block_px) * (kBytesPerThread + per_pixel * PixelsOf(block_px));
  }

 private:
  double PixelsOf(int block_px) const {
    const model::LinearImage& image = rays_.input().image;
    return static_cast<double>(std::min(block_px, image.width_px)) *
           std::min(block_px, image.height_px);
  }
  double AtOnce(int block_px) const {
    const model::LinearImage& image = rays_.input().image;
    const auto blocks = CutInBlocks(image.width_px, image.height_px, block_px).size();
    return std::min<double>(threads_, static_cast<double>(blocks));
  }

  // Blocks of full size: the middle one, and the ones with the largest disparity, the largest range
  // of disparities and the most links. Fill is not known before the analysis, but it grows with
  // these.
  std::vector<model::PixelRect> DemandingBlocks(int block_px) const {
    const EstimateInput& input = rays_.input();
    const int width_px = std::min(block_px, input.image.width_px);
    const int height_px = std::min(block_px, input.image.height_px);
    const model::PixelRect middle{(input.image.width_px - width_px) / 2,
                                  (input.image.height_px - height_px) / 2, width_px, height_px};
    std::vector<model::PixelRect> chosen(4, middle);
    BlockSlopes most = SlopesIn(input.disparity, middle);
    const auto keep_larger = [](double value, double* largest, const model::PixelRect& rect,
                                model::PixelRect* of_largest) {
      if (!(value > *largest)) return;
      *largest = value;
      *of_largest = rect;
    };
    for (const model::PixelRect& rect :
         CutInBlocks(input.image.width_px, input.image.height_px, block_px)) {
      if (rect.width < width_px || rect.height < height_px) continue;
      const BlockSlopes slopes = SlopesIn(input.disparity, rect);
      keep_larger(slopes.largest_px, &most.largest_px, rect, &chosen[1]);
      keep_larger(slopes.range_px, &most.range_px, rect, &chosen[2]);
      keep_larger(slopes.taps, &most.taps, rect, &chosen[3]);
    }
    std::vector<model::PixelRect> different;
    for (const model::PixelRect& rect : chosen) {
      const auto is_same = [&](const model::PixelRect& other) {
        return other.x == rect.x && other.y == rect.y;
      };
      if (std::none_of(different.begin(), different.end(), is_same)) different.push_back(rect);
    }
    return different;
  }

  double BlockBytes(const model::PixelRect& rect) const {
    const BlockSystem system = MakeBlockSystem(
        rays_, rays_.Block(rect.x, rect.y, rect.width, rect.height), options_, ridge_, kernels_);
    const double of_factor = NewLinearSolver(options_.solver, options_.stencil == Stencil::kWarp)
                                 ->PredictBytes(system.matrix);
    return LeftBetweenBlocks(options_.solver) * (SystemBytes(system.matrix) + of_factor);
  }

  const RayField& rays_;
  const BlockOptions& options_;
  const double ridge_;
  const int threads_;
  Kernels<double>* kernels_;
  double held_bytes_ = 0;
  double bytes_per_pixel_ = 0;  // maximum over the blocks analysed so far
};

// Block sizes to choose from: multiples of 2, each about a quarter larger than the one before.
int NextBlockPx(int block_px) { return std::max(block_px + 2, (block_px * 5 / 4) / 2 * 2); }

// Returns the bytes of blocks of this size, or a lower bound of them that is above the limit.
// Systems that would not fit are not made: smaller ones show how much larger ones need.
double BytesUpTo(double limit, int block_px, int first_px, MemoryForecast* forecast) {
  for (int px = first_px;; px = std::min(2 * px, block_px)) {
    const double least = forecast->LeastBytes(block_px);
    if (least > limit) return least;
    if (px >= block_px) return forecast->Bytes(block_px);
    forecast->Bytes(px);
  }
}

int ChooseBlockPx(const BlockOptions& options, std::optional<double> memory_limit_mib,
                  const model::LinearImage& image, MemoryForecast forecast, double* bytes) {
  const int whole_px = std::max(image.width_px, image.height_px);
  if (!memory_limit_mib) {
    const int block_px = std::min(options.block_px.value_or(kDefaultBlockPx), whole_px);
    *bytes = forecast.Bytes(block_px);
    return block_px;
  }
  const double limit = *memory_limit_mib * kBytesPerMib;
  constexpr int kSmallestPx = 2;
  constexpr int kFirstLookPx = 8;
  const int first_px = std::min(options.block_px.value_or(kSmallestPx), whole_px);
  *bytes = BytesUpTo(limit, first_px, std::min(kFirstLookPx, first_px), &forecast);
  if (*bytes > limit) {
    throw Error(fmt::format(
        "memory limit {:.0f} MiB: blocks of {} px need {:.0f} MiB or more in total; the limit must "
        "be at least as large{}",
        *memory_limit_mib, first_px, std::ceil(*bytes / kBytesPerMib),
        options.block_px ? ", or use smaller blocks" : ", or use fewer views or threads"));
  }
  if (options.block_px) return first_px;
  int block_px = first_px;
  while (block_px < whole_px) {
    const int next_px = std::min(NextBlockPx(block_px), whole_px);
    if (forecast.LeastBytes(next_px) > limit) break;
    const double next_bytes = forecast.Bytes(next_px);
    if (next_bytes > limit) break;
    block_px = next_px;
    *bytes = next_bytes;
  }
  return block_px;
}

// A thread's own copies of objects that one thread at a time uses.
struct Worker {
  std::unique_ptr<Kernels<double>> kernels;
  std::unique_ptr<LinearSolver> solver;
};

// Lends workers and takes them back, so that there are as many as threads.
class Workers {
 public:
  explicit Workers(std::function<Worker()> make) : make_(std::move(make)) {}

  Worker Take() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (idle_.empty()) return make_();
    Worker worker = std::move(idle_.back());
    idle_.pop_back();
    return worker;
  }
  void GiveBack(Worker worker) {
    const std::lock_guard<std::mutex> lock(mutex_);
    idle_.push_back(std::move(worker));
  }

 private:
  std::function<Worker()> make_;
  std::mutex mutex_;
  std::vector<Worker> idle_;
};

std::string NameOf(const model::PixelRect& rect) {
  return fmt::format("block of {}x{} px at ({}, {})", rect.width, rect.height, rect.x, rect.y);
}

// This form also rejects NaN.
bool IsSolvable(double rcond, const BlockOptions& options) {
  return rcond >= options.rcond_min && rcond > 0 && std::isfinite(rcond);
}

// Solves one block for all channels and checks the solution.
SolvedBlock SolveBlock(const BlockSystem& system, const BlockOptions& options,
                       const model::PixelRect& rect, Worker* worker) {
  worker->solver->Factorize(system.matrix);
  SolvedBlock solved;
  BlockReport& report = solved.report;
  report = {rect.x,
            rect.y,
            rect.width,
            rect.height,
            system.matrix.rows,
            system.matrix.entries(),
            worker->solver->rcond(),
            0,
            0};
  if (report.rcond && !IsSolvable(*report.rcond, options)) {
    throw Error(
        fmt::format("{}: its system is singular, or so close to singular that the light field "
                    "would be noise even with a small residual: rcond is {:.2g}, but it must be at "
                    "least {:.2g}; use a larger ridge (now {:.3g})",
                    NameOf(rect), *report.rcond, options.rcond_min, options.ridge.value_or(0)));
  }
  for (std::size_t channel = 0; channel < system.right_sides.size(); ++channel) {
    const std::vector<double>& right = system.right_sides[channel];
    solved.channels.push_back(worker->solver->SolveFrom(system.starts[channel], right));
    report.iterations = std::max(report.iterations, worker->solver->iterations());
    const double residual = RelativeResidual(system.matrix, solved.channels.back(), right);
    if (!std::isfinite(residual)) {
      throw Error(fmt::format("{}: the solution is not finite", NameOf(rect)));
    }
    report.relative_residual = LargerResidual(report.relative_residual, residual);
  }
  return solved;
}

// Description of a run, so that its blocks are not used for another run.
BlockRun RunOf(const RayField& rays, const BlockOptions& options, const BlockSummary& summary,
               const std::string& driver, int blocks) {
  const model::LinearImage& image = rays.input().image;
  const auto exact = [](double number) { return fmt::format("{:.17g}", number); };
  BlockRun run;
  run.blocks = blocks;
  run.settings = {{"size_px", fmt::format("{}x{}", image.width_px, image.height_px)},
                  {"channels", fmt::format("{}", image.channels)},
                  {"views", fmt::format("{}x{}", rays.u_count(), rays.v_count())},
                  {"block_px", fmt::format("{}", summary.block_px)},
                  {"block_solver", BlockSolverName(options.solver)},
                  {"stencil", StencilName(options.stencil)},
                  {"splat", options.splat == kernels::Splat::kNearest ? "nearest" : "bilinear"},
                  {"gamma", exact(summary.gamma)},
                  {"ridge", exact(summary.ridge)},
                  {"device", summary.device},
                  {"driver", driver}};
  if (IsIterative(options.solver)) {
    run.settings.emplace_back("tolerance", exact(options.tolerance));
    run.settings.emplace_back("max_iterations", fmt::format("{}", options.max_iterations));
  } else {
    run.settings.emplace_back("rcond_min", exact(options.rcond_min));
  }
  run.data = rays.Data();
  return run;
}

// Returns whether a block from a store matches its place; the store may have damaged it.
bool Fits(const SolvedBlock& solved, const BlockGeometry& block, std::size_t channels,
          const BlockOptions& options) {
  const BlockReport& report = solved.report;
  const bool is_judged = IsIterative(options.solver)
                             ? !report.rcond
                             : report.rcond && IsSolvable(*report.rcond, options);
  return report.x == block.first_x && report.y == block.first_y &&
         report.width_px == block.width_px && report.height_px == block.height_px &&
         report.unknowns == block.rays() && report.iterations >= 0 &&
         std::isfinite(report.relative_residual) && is_judged &&
         solved.channels.size() == channels &&
         std::all_of(solved.channels.begin(), solved.channels.end(), [&](const auto& channel) {
           return channel.size() == Index(block.rays()) &&
                  std::all_of(channel.begin(), channel.end(),
                              [](double value) { return std::isfinite(value); });
         });
}

// Returns a block from the store, or nothing.
std::optional<SolvedBlock> FromStore(BlockStore* store, const BlockOptions& options, int number,
                                     const BlockGeometry& block, int channels) {
  if (store == nullptr) return std::nullopt;
  std::optional<SolvedBlock> found = store->Find(number);
  if (found && !Fits(*found, block, Index(channels), options)) return std::nullopt;
  return found;
}

// Rays that land outside of the image belong to no block: only their prior is known.
void KeepPriorBesideTheImage(const BlockGeometry& whole, const model::LightField& prior,
                             std::vector<float>* values) {
  const int width = prior.s_count;
  const int height = prior.t_count;
  for (int l = 0; l < prior.v_count; ++l) {
    for (int k = 0; k < prior.u_count; ++k) {
      const int shift_s = whole.s_shift[Index(k)];
      const int shift_t = whole.t_shift[Index(l)];
      if (shift_s == 0 && shift_t == 0) continue;
      for (int channel = 0; channel < prior.channels; ++channel) {
        std::size_t ray = prior.ViewStart(channel, k, l);
        for (int t = 0; t < height; ++t) {
          ThrowIfCancelled();
          for (int s = 0; s < width; ++s, ++ray) {
            const int x = s + shift_s;
            const int y = t + shift_t;
            const bool inside = x >= 0 && x < width && y >= 0 && y < height;
            if (!inside) (*values)[ray] = prior.values[ray];
          }
        }
      }
    }
  }
}

}  // namespace

model::LightField EstimateByBlocks(const EstimateInput& input, const BlockOptions& given,
                                   const SolverRun& run, BlockSummary* summary) {
  CheckOptions("block solver", given);
  CheckRun("block solver", run, RunUse::kStore);
  CheckInput(input);
  const bool symmetric = given.stencil == Stencil::kWarp;
  // Throws Error for a solver that this build or the stencil does not have.
  const std::string device_of_solver = NewLinearSolver(given.solver, symmetric)->device();

  const auto start = Clock::now();
  const int threads = ResolveThreads(run.threads);
  BlockOptions options = given;
  options.ridge = given.ridge.value_or(1e-2 / static_cast<double>(input.weights.size()));

  std::shared_ptr<kernels::Backend> processor;
  if (run.backend == nullptr)
    processor = kernels::OpenBackend(kernels::ParseDeviceRequest("cpu"), nullptr);
  kernels::Backend* const backend = processor ? processor.get() : run.backend;
  // Systems are made in double; a device without double leaves that to the reference
  // implementation.
  const bool on_device = backend->has_double();
  std::unique_ptr<Kernels<double>> merging =
      on_device ? backend->NewDouble() : kernels::NewReference<double>();
  RayField rays(input, options.falloff, threads);
  // Many small factorisations run in parallel: a BLAS with threads of its own would compete with
  // them and make sums depend on the number of threads.
  const OneBlasThread one_blas_thread;

  BlockSummary unused;
  if (summary == nullptr) summary = &unused;
  *summary = BlockSummary();
  summary->threads = threads;
  summary->device = on_device ? backend->name() : "cpu (" + backend->name() + " has no double)";
  if (!device_of_solver.empty()) summary->device += ", " + device_of_solver;
  summary->gamma = options.gamma;
  summary->ridge = *options.ridge;
  double bytes = 0;
  summary->block_px =
      ChooseBlockPx(options, run.memory_limit_mib, input.image,
                    MemoryForecast(rays, options, *options.ridge, threads, merging.get()), &bytes);
  summary->predicted_memory_mib = bytes / kBytesPerMib;
  summary->setup_seconds = SecondsSince(start);

  const auto solve_start = Clock::now();
  const auto rects = CutInBlocks(input.image.width_px, input.image.height_px, summary->block_px);
  const int count = static_cast<int>(rects.size());
  summary->blocks.resize(rects.size());
  merging->StartWhole(input.image.width_px, input.image.height_px, rays.u_count(), rays.v_count(),
                      input.image.channels);
  const std::unique_ptr<Kernels<double>> pattern_of_workers = merging->Clone();
  const LinearSolverLimits limits{options.tolerance, options.max_iterations};
  Workers workers([&] {
    return Worker{pattern_of_workers->Clone(), NewLinearSolver(options.solver, symmetric, limits)};
  });
  if (run.store != nullptr) {
    run.store->Begin(RunOf(rays, options, *summary, backend->description(), count));
  }
  std::mutex merge_mutex;
  IterationProgress progress(run.progress, count);
  ParallelFor(count, threads, [&](int i) {
    const model::PixelRect& rect = rects[Index(i)];
    const BlockGeometry block = rays.Block(rect.x, rect.y, rect.width, rect.height);
    std::optional<SolvedBlock> solved =
        FromStore(run.store, options, i, block, input.image.channels);
    const bool is_found = solved.has_value();
    if (!is_found) {
      Worker worker = workers.Take();
      const BlockSystem system =
          MakeBlockSystem(rays, block, options, *options.ridge, worker.kernels.get());
      solved = SolveBlock(system, options, rect, &worker);
      workers.GiveBack(std::move(worker));
      if (run.store != nullptr) run.store->Keep(i, *solved);
    }
    summary->blocks[Index(i)] = solved->report;
    const std::lock_guard<std::mutex> lock(merge_mutex);
    for (std::size_t channel = 0; channel < solved->channels.size(); ++channel) {
      merging->AddBlock(block, static_cast<int>(channel), solved->channels[channel]);
    }
    summary->blocks_from_store += is_found ? 1 : 0;
    progress.Count();
  });
  std::vector<float> values = merging->FinishWhole();
  const BlockGeometry whole = rays.Block(0, 0, input.image.width_px, input.image.height_px);
  model::LightField light_field = std::move(rays).TakePrior();
  KeepPriorBesideTheImage(whole, light_field, &values);
  light_field.values = std::move(values);

  const bool iterative = IsIterative(options.solver);
  if (!iterative) summary->rcond_min = 1;
  for (const BlockReport& block : summary->blocks) {
    if (block.rcond) summary->rcond_min = std::min(*summary->rcond_min, *block.rcond);
    summary->relative_residual =
        LargerResidual(summary->relative_residual, block.relative_residual);
    summary->iterations = std::max(summary->iterations, block.iterations);
  }
  if (iterative) {
    RequireProgress("blocks by " + BlockSolverName(options.solver), summary->relative_residual,
                    summary->iterations,
                    "allow more iterations, or use a smaller gamma or a larger ridge");
  }
  summary->converged = !iterative || summary->relative_residual <= options.tolerance;
  summary->solve_seconds = SecondsSince(solve_start);
  summary->message = fmt::format("{} blocks of {} px solved by {}", count, summary->block_px,
                                 BlockSolverName(options.solver));

  model::LightFieldOrigin& origin = light_field.origin;
  origin = {};
  origin.method = "blocks";
  origin.block_solver = BlockSolverName(options.solver);
  origin.stencil = StencilName(options.stencil);
  origin.splat = options.splat == kernels::Splat::kNearest ? "nearest" : "bilinear";
  origin.device = summary->device;
  origin.block_px = summary->block_px;
  origin.gamma = summary->gamma;
  origin.ridge = summary->ridge;
  origin.relative_residual = summary->relative_residual;
  origin.rcond_min = summary->rcond_min;
  origin.effects = {"defocus"};
  if (options.falloff && input.camera) origin.effects.emplace_back("falloff");
  return light_field;
}

}  // namespace thicklens::estimator
