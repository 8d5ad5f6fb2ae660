#include "bench_source.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "bench_machine.h"
#include "bench_scene.h"
#include "bench_solvers.h"
#include "bench_source_rows.h"
#include "estimate_input.h"
#include "interrupt.h"
#include "light_field_options.h"
#include "option_values.h"
#include "progress_line.h"
#include "thicklens/error.h"
#include "thicklens/estimator/compare.h"
#include "thicklens/estimator/render.h"
#include "thicklens/kernels/device.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/parallel.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::tools {
namespace {

using Clock = std::chrono::steady_clock;
using estimator::BlockSolver;

struct BenchSourceOptions {
  CommonOptions common;
  std::vector<int> tables;         // empty: all
  std::vector<int> views;          // empty: 3, 5 and 7, and of table 4 kViewsOfTable4
  std::vector<std::string> sizes;  // empty: K and L
  EstimateOptions given;           // picture, depth, camera
  std::string device = "auto";
  int repeat = 5;
  bool full = false;
  std::optional<std::uint64_t> seed;
};

// The source does not say how many views its table 4 had.
constexpr int kViewsOfTable4 = 5;
constexpr std::uint64_t kUsualSeed = 1;

// A picture of one number of views, and the parts of it that stand for it where all would take too
// long.
struct SourcePicture {
  std::string name;
  char size = ' ';  // 'K' or 'L' of the source
  int views = 0;
  BenchScene whole;
  std::vector<model::PixelRect> rects;  // of the parts
  std::vector<BenchScene> parts;
  std::optional<BlockSample> sample;  // absent: the part is the whole
  double pixels_per_part_pixel = 1;
};

// Something to be measured: runs once and says how many seconds that took, or would take for the
// whole picture. The first run fills in what the row tells beside.
struct Contender {
  SourceRow row;
  std::function<double(SourceRow* row)> run;
};

// Everything that the tables share.
struct Bench {
  const BenchSourceOptions* options = nullptr;
  int threads = 1;
  double triad_bytes_per_second = 0;
  std::shared_ptr<kernels::Backend> processor, device;  // device: null where there is none
};

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

int BlocksOf(const model::LinearPicture& picture) {
  const auto blocks = [](int px) { return (px + kSourceBlockPx - 1) / kSourceBlockPx; };
  return blocks(picture.width_px) * blocks(picture.height_px);
}

// 'K' or 'L' of a picture of the source's sizes, else a blank.
char SizeNameOf(int width_px, int height_px) {
  if (width_px == 640 && height_px == 480) return 'K';
  return width_px == 256 && height_px == 256 ? 'L' : ' ';
}

// Four parts of four by four blocks, in the middles of the picture's quarters: near, far and at
// the plane of focus.
void CutParts(bool full, SourcePicture* picture) {
  constexpr int kPartPx = 4 * kSourceBlockPx;
  const int width_px = picture->whole.input.picture.width_px;
  const int height_px = picture->whole.input.picture.height_px;
  picture->size = SizeNameOf(width_px, height_px);
  const bool is_small = width_px < 2 * kPartPx || height_px < 2 * kPartPx ||
                        width_px * height_px == 4 * kPartPx * kPartPx;
  if (full || is_small) {
    picture->rects = {{0, 0, width_px, height_px}};
    picture->parts = {picture->whole};
    return;
  }
  BlockSample sample{0, BlocksOf(picture->whole.input.picture)};
  for (const int quarter_y : {1, 3}) {
    for (const int quarter_x : {1, 3}) {
      picture->rects.push_back({quarter_x * width_px / 4 - kPartPx / 2,
                                quarter_y * height_px / 4 - kPartPx / 2, kPartPx, kPartPx});
      picture->parts.push_back(PartOf(picture->whole, picture->rects.back()));
      sample.solved += BlocksOf(picture->parts.back().input.picture);
    }
  }
  picture->sample = sample;
  picture->pixels_per_part_pixel =
      static_cast<double>(width_px) * height_px / (4.0 * kPartPx * kPartPx);
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
  return row;
}

int BorderPx(const model::LinearPicture& picture) {
  return std::min(20, std::min(picture.width_px, picture.height_px) / 4);
}

// Of a part, against what is true there.
double PsnrDb(const BenchScene& part, const model::LightField& estimate, int threads) {
  return estimator::CompareLightFields(part.truth, estimate, BorderPx(part.input.picture),
                                       std::nullopt, threads)
      .mean.psnr_db;
}

// The parts, solved by blocks, and what that says of the whole.
struct PartsRun {
  std::vector<model::LightField> estimates;
  double seconds = 0;  // of the whole picture: set-up, which is that of any size, and solving
  double relative_residual = 0;
  bool converged = true;
  std::string device;
};
PartsRun RunParts(const SourcePicture& picture, BlockSolver solver, int threads,
                  kernels::Backend* backend) {
  estimator::BlockOptions options;
  options.solver = solver;
  options.block_px = kSourceBlockPx;
  options.threads = threads;
  options.progress = [](int, int) { ThrowIfInterrupted(); };
  PartsRun run;
  double setup_seconds = 0, solve_seconds = 0;
  for (const BenchScene& part : picture.parts) {
    estimator::EstimateSummary summary;
    run.estimates.push_back(estimator::EstimateByBlocks(part.input, options, backend, &summary));
    setup_seconds = std::max(setup_seconds, summary.setup_seconds);
    solve_seconds += summary.solve_seconds;
    run.relative_residual = std::max(run.relative_residual, summary.relative_residual);
    run.converged = run.converged && summary.converged;
    run.device = summary.device;
  }
  run.seconds = setup_seconds + solve_seconds * picture.pixels_per_part_pixel;
  return run;
}

// One block, so that what a device does but once is done.
void WarmUp(const SourcePicture& picture, BlockSolver solver, kernels::Backend* backend) {
  SourcePicture block;
  block.whole = PartOf(picture.parts.front(), {0, 0, kSourceBlockPx, kSourceBlockPx});
  CutParts(true, &block);
  RunParts(block, solver, 1, backend);
}

// The row gets the mean of the parts' PSNRs and the worst residual.
Contender ByBlocks(SourceRow row, const SourcePicture& picture, BlockSolver solver, int threads,
                   kernels::Backend* backend) {
  row.extrapolated = picture.sample;
  row.block_solver = estimator::BlockSolverName(solver);
  return {row, [&picture, solver, threads, backend](SourceRow* out) {
            const bool is_first = out->seconds.empty();
            if (is_first) WarmUp(picture, solver, backend);
            const PartsRun run = RunParts(picture, solver, threads, backend);
            if (!is_first) return run.seconds;
            out->device = run.device;
            if (picture.whole.has_truth()) {
              double psnr_db = 0;
              for (std::size_t i = 0; i < run.estimates.size(); ++i) {
                psnr_db += PsnrDb(picture.parts[i], run.estimates[i], threads);
              }
              out->psnr_true_views_db = psnr_db / static_cast<double>(run.estimates.size());
            }
            if (out->table == 3) {
              out->relative_residual = run.relative_residual;
              if (estimator::IsIterative(solver)) out->converged = run.converged;
            }
            return run.seconds;
          }};
}

// Its PSNR is of the same parts as that of the blocks.
Contender OfWholePicture(SourceRow row, const SourcePicture& picture, LightFieldSolver solver,
                         int threads) {
  return {std::move(row), [&picture, solver = std::move(solver), threads](SourceRow* out) {
            const Clock::time_point start = Clock::now();
            const model::LightField estimate = solver.estimate(picture.whole.input);
            const double seconds = SecondsSince(start);
            if (out->seconds.empty() && picture.whole.has_truth()) {
              double psnr_db = 0;
              for (std::size_t i = 0; i < picture.parts.size(); ++i) {
                psnr_db +=
                    PsnrDb(picture.parts[i], model::CropViews(estimate, picture.rects[i]), threads);
              }
              out->psnr_true_views_db = psnr_db / static_cast<double>(picture.parts.size());
            }
            return seconds;
          }};
}

std::string NameOf(const LightFieldSolver& solver) {
  return solver.prior.empty() || solver.solver != "scene" ? solver.solver
                                                          : solver.solver + " " + solver.prior;
}

void AddTable1(const Bench& bench, const SourcePicture& picture,
               std::vector<Contender>* contenders) {
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
  for (LightFieldSolver& solver : WholePictureSolvers(bench.threads)) {
    if (NameOf(solver) != "scene tv") continue;
    SourceRow row = RowOf(1, picture, NameOf(solver), bench.threads);
    contenders->push_back(OfWholePicture(std::move(row), picture, solver, bench.threads));
  }
}

void AddTable2(const Bench& bench, const SourcePicture& picture,
               std::vector<Contender>* contenders) {
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
                             const Clock::time_point start = Clock::now();
                             estimator::Photograph(*light_field, light_field->weights, nullptr,
                                                   nullptr, kernels.get(), threads);
                             return SecondsSince(start);
                           }});
  };
  if (bench.device) add("opencl", 1, bench.device->NewFloat());
  add("cpu", 1, bench.processor->NewFloat());
  add("native", 1, nullptr);
  if (bench.threads > 1) add("native", bench.threads, nullptr);
}

void AddTable3(const Bench& bench, const SourcePicture& picture,
               std::vector<Contender>* contenders) {
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

// Thick or thin: the parts estimated for that lens, their pictures formed again by it, and both
// compared.
Contender OfLens(const std::string& lens, const SourcePicture& picture, const model::Camera& camera,
                 const Bench& bench) {
  SourceRow row = RowOf(4, picture, lens, bench.threads);
  row.extrapolated = picture.sample;
  row.published_fidelity = PublishedFidelityOf(lens, picture.size);
  // Cut from the whole, so that each part has the same lens. Its thin twin's rays land where the
  // lens's own do: depths are the same disparities.
  BenchScene taken = picture.whole;
  taken.input.camera = camera;
  taken.input.grid = model::DefaultGrid(camera, picture.views, picture.views);
  taken.input.falloff_camera.reset();
  auto parts = std::make_shared<SourcePicture>();
  parts->whole = std::move(taken);
  CutParts(!picture.sample, parts.get());
  row.block_solver = estimator::BlockSolverName(estimator::DefaultBlockSolver());
  return {
      row, [parts, &bench](SourceRow* out) {
        const PartsRun run =
            RunParts(*parts, estimator::DefaultBlockSolver(), bench.threads, bench.processor.get());
        if (!out->seconds.empty()) return run.seconds;
        const auto count = static_cast<double>(parts->parts.size());
        double macade = 0, delta_e94 = 0, psnr_db = 0;
        bool has_edges = true;
        for (std::size_t i = 0; i < parts->parts.size(); ++i) {
          const BenchScene& part = parts->parts[i];
          const model::LinearPicture again =
              estimator::Photograph(run.estimates[i], part.input.weights, &*part.input.camera,
                                    nullptr, nullptr, bench.threads);
          const estimator::PictureScores scores = estimator::ComparePictures(
              estimator::StoredValuesOf(part.input.picture, part.input.transfer),
              estimator::StoredValuesOf(again, part.input.transfer), BorderPx(part.input.picture));
          has_edges = has_edges && scores.macade_standin.has_value();
          macade += scores.macade_standin.value_or(0) / count;
          delta_e94 += scores.delta_e94_mean / count;
          if (part.has_truth()) psnr_db += PsnrDb(part, run.estimates[i], bench.threads) / count;
        }
        if (has_edges) out->macade_standin = macade;
        out->delta_e94_mean = delta_e94;
        if (parts->whole.has_truth()) out->psnr_true_views_db = psnr_db;
        return run.seconds;
      }};
}

// The bench's lens with 3 mm of thickness and another rear focal length, focused where it was.
model::Camera ThickBenchCamera(int width_px, int height_px) {
  model::Camera camera = BenchCamera(width_px, height_px);
  const double focus_depth_mm = camera.focus_depth_mm();
  camera.lens.rear_focal_length_mm = 12.8;
  camera.lens.lens_thickness_mm = 3;
  camera.calibration->image_distance_mm =
      model::Estimate{model::ImageDistanceMm(camera.lens, focus_depth_mm), 0};
  return camera;
}

void AddTable4(const Bench& bench, const SourcePicture& picture,
               std::vector<Contender>* contenders) {
  const model::Camera& camera = *picture.whole.input.camera;
  contenders->push_back(OfLens("thick", picture, camera, bench));
  contenders->push_back(OfLens("thin", picture, model::ThinTwin(camera), bench));
}

// Round by round, so that what else the machine does falls on all alike.
void Measure(const BenchSourceOptions& options, std::vector<Contender>* contenders,
             std::vector<SourceRow>* rows) {
  ProgressLine progress("measuring", options.common.quiet);
  const int total = options.repeat * static_cast<int>(contenders->size());
  int done = 0;
  std::vector<double> spent(contenders->size(), 0.0);
  for (int round = 0; round < options.repeat; ++round) {
    for (std::size_t i = 0; i < contenders->size(); ++i) {
      ThrowIfInterrupted();
      Contender& contender = (*contenders)[i];
      // Of what takes so long, fewer runs tell as much as more.
      constexpr double kEnoughSeconds = 60;
      if (spent[i] < kEnoughSeconds && contender.row.failure.empty()) {
        const Clock::time_point start = Clock::now();
        try {
          contender.row.seconds.push_back(contender.run(&contender.row));
        } catch (const Interrupted&) {
          throw;
        } catch (const Error& error) {  // one row, and not those beside it
          contender.row.failure = error.what();
        }
        spent[i] += SecondsSince(start);
      }
      progress.Show(++done, total);
    }
  }
  for (Contender& contender : *contenders) rows->push_back(std::move(contender.row));
}

struct PictureSize {
  std::string name;
  int width_px = 0, height_px = 0;
};

std::vector<PictureSize> SizesOf(const BenchSourceOptions& options) {
  std::vector<PictureSize> sizes;
  for (const std::string& text :
       options.sizes.empty() ? std::vector<std::string>{"L", "K"} : options.sizes) {
    if (text == "K") {
      sizes.push_back({"K", 640, 480});
    } else if (text == "L") {
      sizes.push_back({"L", 256, 256});
    } else {
      const auto parts = SplitPixels("--size", text, 'x', "K, L or WIDTHxHEIGHT");
      if (parts.size() != 2 || parts[0] < 64 || parts[1] < 64) {
        throw UsageError(fmt::format(
            "--size: K, L or WIDTHxHEIGHT, both at least 64, is expected, found '{}'", text));
      }
      sizes.push_back({text, parts[0], parts[1]});
    }
  }
  return sizes;
}

SourcePicture Simulated(const BenchSourceOptions& options, const PictureSize& size,
                        const model::Camera& camera, int views) {
  ProgressLine progress("simulating", options.common.quiet);
  SourcePicture picture;
  picture.name = size.name;
  picture.views = views;
  picture.whole = MakeBenchScene(camera, views, views, options.seed.value_or(kUsualSeed),
                                 options.common.threads, [&](int done, int total) {
                                   ThrowIfInterrupted();
                                   progress.Show(done, total);
                                 });
  CutParts(options.full, &picture);
  return picture;
}

SourcePicture Given(const BenchSourceOptions& options, int views) {
  EstimateOptions given = options.given;
  given.common = options.common;
  given.views.text = fmt::format("{0}x{0}", views);
  PreparedEstimate prepared = PrepareEstimate(given);
  SourcePicture picture;
  picture.name = std::filesystem::path(given.picture_path).stem().string();
  picture.views = views;
  picture.whole.input = std::move(prepared.input);
  CutParts(options.full, &picture);
  return picture;
}

void MeasureTimes(const Bench& bench, const std::set<int>& tables, const SourcePicture& picture,
                  std::vector<SourceRow>* rows) {
  std::vector<Contender> contenders;
  if (tables.count(1) > 0) AddTable1(bench, picture, &contenders);
  if (tables.count(2) > 0) AddTable2(bench, picture, &contenders);
  if (tables.count(3) > 0) AddTable3(bench, picture, &contenders);
  Measure(*bench.options, &contenders, rows);
}

void MeasureLenses(const Bench& bench, const SourcePicture& picture, std::vector<SourceRow>* rows) {
  std::vector<Contender> contenders;
  AddTable4(bench, picture, &contenders);
  Measure(*bench.options, &contenders, rows);
}

std::set<int> TablesOf(const BenchSourceOptions& options) {
  std::set<int> tables(options.tables.begin(), options.tables.end());
  if (tables.empty()) tables = {1, 2, 3, 4};
  if (!options.given.picture_path.empty() && options.given.camera_path.empty()) {
    if (!options.tables.empty() && tables.count(4) > 0) {
      throw UsageError("--table 4 compares lenses: with --image it needs --camera");
    }
    if (tables.erase(4) > 0) spdlog::warn("table 4 needs --camera; it is left out");
  }
  return tables;
}

std::vector<SourceRow> MeasureAll(const Bench& bench) {
  const BenchSourceOptions& options = *bench.options;
  const std::set<int> tables = TablesOf(options);
  std::set<int> views(options.views.begin(), options.views.end());
  if (views.empty()) views = {3, 5, 7};
  const int views_of_lenses = options.views.empty() ? kViewsOfTable4 : *views.rbegin();
  const bool times = *tables.begin()<4, lenses = tables.count(4)> 0;
  std::vector<SourceRow> rows;
  if (!options.given.picture_path.empty()) {
    for (const int count : views) {
      if (times) MeasureTimes(bench, tables, Given(options, count), &rows);
    }
    if (lenses) MeasureLenses(bench, Given(options, views_of_lenses), &rows);
    return rows;
  }
  for (const PictureSize& size : SizesOf(options)) {
    const model::Camera thin = BenchCamera(size.width_px, size.height_px);
    for (const int count : views) {
      if (times) MeasureTimes(bench, tables, Simulated(options, size, thin, count), &rows);
    }
    if (!lenses) continue;
    const model::Camera thick = ThickBenchCamera(size.width_px, size.height_px);
    MeasureLenses(bench, Simulated(options, size, thick, views_of_lenses), &rows);
  }
  return rows;
}

void CheckUsage(const BenchSourceOptions& options) {
  const EstimateOptions& given = options.given;
  const bool has_picture = !given.picture_path.empty();
  const auto needs = [](bool is_given, bool fits, const std::string& message) {
    if (is_given && !fits) throw UsageError(message);
  };
  needs(has_picture != !given.depth_path.empty(), false, "--image and --depth belong together");
  needs(!given.camera_path.empty(), has_picture, "--camera is that of --image, which is not given");
  const DepthOptions usual;
  needs(!given.depth.kind.empty() || !given.depth.unit.empty() ||
            given.depth.disparity_scale != usual.disparity_scale ||
            given.depth.disparity_offset_px != usual.disparity_offset_px,
        has_picture, "--depth-kind and what belongs to it are of --depth, which is not given");
  needs(!options.sizes.empty(), !has_picture,
        "--size is of simulated pictures, and --image gives one");
  needs(options.seed.has_value(), !has_picture,
        "--seed is of simulated pictures, and --image gives one");
}

CommandResult BenchSource(const BenchSourceOptions& options) {
  CheckUsage(options);
  Bench bench;
  bench.options = &options;
  bench.threads = model::ResolveThreads(options.common.threads);
  bench.processor =
      kernels::OpenBackend(kernels::ParseDeviceRequest("cpu"), nullptr, ThrowIfInterrupted);
  std::string notice;
  bench.device = kernels::OpenBackend(kernels::ParseDeviceRequest(options.device), &notice,
                                      ThrowIfInterrupted);
  if (!bench.device->is_opencl()) {
    bench.device = nullptr;
    spdlog::warn("rows of OpenCL are left out: {}",
                 notice.empty() ? "--device " + options.device : notice);
  }
  bench.triad_bytes_per_second = TriadBytesPerSecond(bench.threads);
  const std::vector<SourceRow> rows = MeasureAll(bench);

  std::string text = fmt::format(
      "Medians of {} runs, or of as many as fill a minute. Machines differ: what compares are the "
      "ratios inside a table. Published: "
      "means of the\nsource's four pictures. {}\n",
      options.repeat,
      bench.device ? "OpenCL: " + bench.device->description() : std::string("No OpenCL device"));
  nlohmann::json json_rows = nlohmann::json::array();
  for (int table = 1; table <= 4; ++table) {
    const auto is_of_table = [&](const SourceRow& row) { return row.table == table; };
    if (std::none_of(rows.begin(), rows.end(), is_of_table)) continue;
    text += "\n" + SourceTableText(table, rows);
    for (const SourceRow& row : rows) {
      if (row.table == table) json_rows.push_back(SourceRowJson(row, rows));
    }
  }
  PrintResult(options.common, text);
  nlohmann::json machine = MachineJson();
  machine["triad_bytes_per_second"] = bench.triad_bytes_per_second;
  machine["threads"] = bench.threads;
  machine["opencl"] = bench.device ? nlohmann::json(bench.device->description()) : nlohmann::json();
  return {{{"status", "ok"},
           {"reason", ""},
           {"machine", machine},
           {"repeat", options.repeat},
           {"seed", options.seed.value_or(kUsualSeed)},
           {"full", options.full},
           {"rows", json_rows}},
          ""};
}

}  // namespace

void AddBenchSourceCommand(CLI::App* bench, CommandAction* action) {
  CLI::App* command = bench->add_subcommand(
      "source", "The source's tables 1 to 4, measured here beside what it published");
  const auto options = std::make_shared<BenchSourceOptions>();
  command->add_option("--table", options->tables, "Which (all): 1 2 3 4")
      ->check(CLI::Range(1, 4))
      ->type_name("N");
  command
      ->add_option("--views", options->views,
                   "Across and down (3 5 7; of table 4 the largest given, else 5)")
      ->check(CLI::Range(2, 31))
      ->type_name("N");
  command
      ->add_option("--size", options->sizes,
                   "Of simulated pictures: K (640x480), L (256x256) or WIDTHxHEIGHT (L K)")
      ->type_name("SIZE");
  command->add_option("--image", options->given.picture_path, "A picture in place of the simulated")
      ->type_name("FILE");
  command->add_option("--depth", options->given.depth_path, "Its depth map")->type_name("FILE");
  command->add_option("--camera", options->given.camera_path, "Its camera")->type_name("FILE");
  AddDepthOptions(command, &options->given.depth);
  command->add_option("--repeat", options->repeat, "Times that each is run; the median counts")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str()
      ->type_name("N");
  command->add_flag("--full", options->full, "All blocks of the pictures, not a sample");
  command->add_option("--seed", options->seed, "Of texture and noise (1)")->type_name("N");
  AddDeviceOption(command, &options->device);
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] { RunCommand(options->common, [&] { return BenchSource(*options); }); };
  });
}

}  // namespace thicklens::tools
