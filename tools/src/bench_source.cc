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
  std::vector<int> tables = {1, 2, 3, 4};
  std::vector<int> views = {3, 5, 7};
  std::vector<std::string> sizes;  // empty: K and L
  EstimateOptions given;           // picture, depth, camera
  std::string device = "auto";
  int repeat = 5;
  bool full = false;
  std::uint64_t seed = 1;
};

// A picture of one number of views, and the parts of it that stand for it where all would take too
// long.
struct SourcePicture {
  std::string name;
  char size = ' ';  // 'K' or 'L' of the source
  int views = 0;
  BenchScene whole;
  std::vector<BenchScene> parts;
  std::optional<BlockSample> sample;  // absent: the parts are the whole
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

// Four parts of four by four blocks, in the middles of the picture's quarters: near, far and at
// the plane of focus.
void CutParts(bool full, SourcePicture* picture) {
  constexpr int kPartPx = 4 * kSourceBlockPx;
  const int width_px = picture->whole.input.picture.width_px;
  const int height_px = picture->whole.input.picture.height_px;
  const bool is_small = width_px < 2 * kPartPx || height_px < 2 * kPartPx ||
                        width_px * height_px == 4 * kPartPx * kPartPx;
  if (full || is_small) {
    picture->parts = {picture->whole};
    return;
  }
  BlockSample sample{0, BlocksOf(picture->whole.input.picture)};
  for (const int quarter_y : {1, 3}) {
    for (const int quarter_x : {1, 3}) {
      picture->parts.push_back(
          PartOf(picture->whole, {quarter_x * width_px / 4 - kPartPx / 2,
                                  quarter_y * height_px / 4 - kPartPx / 2, kPartPx, kPartPx}));
      sample.solved += BlocksOf(picture->parts.back().input.picture);
    }
  }
  picture->sample = sample;
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

double PsnrDb(const BenchScene& scene, const model::LightField& estimate, int threads) {
  return estimator::CompareLightFields(scene.truth, estimate, BorderPx(scene.input.picture),
                                       std::nullopt, threads)
      .mean.psnr_db;
}

// Solves the parts by blocks; the row gets the mean of their PSNRs and the worst residual.
Contender ByBlocks(SourceRow row, const SourcePicture& picture, BlockSolver solver, int threads,
                   kernels::Backend* backend) {
  row.extrapolated = picture.sample;
  return {
      row, [&picture, solver, threads, backend](SourceRow* out) {
        estimator::BlockOptions options;
        options.solver = solver;
        options.block_px = kSourceBlockPx;
        options.threads = threads;
        options.progress = [](int, int) { ThrowIfInterrupted(); };
        double seconds = 0, psnr_db = 0, residual = 0;
        bool converged = true;
        for (const BenchScene& part : picture.parts) {
          estimator::EstimateSummary summary;
          const model::LightField estimate =
              estimator::EstimateByBlocks(part.input, options, backend, &summary);
          seconds += summary.setup_seconds + summary.solve_seconds;
          residual = std::max(residual, summary.relative_residual);
          converged = converged && summary.converged;
          if (out->seconds.empty() && part.has_truth()) {
            psnr_db += PsnrDb(part, estimate, threads) / static_cast<double>(picture.parts.size());
          }
        }
        if (out->seconds.empty() && picture.whole.has_truth()) {
          out->psnr_true_views_db = psnr_db;
        }
        if (out->table == 3) {
          out->relative_residual = residual;
          if (estimator::IsIterative(solver)) out->converged = converged;
        }
        return picture.sample ? seconds * picture.sample->all / picture.sample->solved : seconds;
      }};
}

Contender OfWholePicture(SourceRow row, const SourcePicture& picture, LightFieldSolver solver,
                         int threads) {
  return {std::move(row), [&picture, solver = std::move(solver), threads](SourceRow* out) {
            const Clock::time_point start = Clock::now();
            const model::LightField estimate = solver.estimate(picture.whole.input);
            const double seconds = SecondsSince(start);
            if (out->seconds.empty() && picture.whole.has_truth()) {
              out->psnr_true_views_db = PsnrDb(picture.whole, estimate, threads);
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
  if (bench.device) add("opencl", 1, bench.device.get());
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
  const double triad = bench.triad_bytes_per_second;
  const auto add = [&](const std::string& name, int threads,
                       std::shared_ptr<kernels::Kernels<float>> kernels) {
    SourceRow row = RowOf(2, picture, name, threads);
    row.published = PublishedSeconds(2, name, picture.size, picture.views);
    contenders->push_back(
        {std::move(row), [light_field, kernels, threads, bytes, triad](SourceRow* out) {
           const Clock::time_point start = Clock::now();
           estimator::Photograph(*light_field, light_field->weights, nullptr, nullptr,
                                 kernels.get(), threads);
           const double seconds = SecondsSince(start);
           const double share = bytes / seconds / triad;
           out->bandwidth_share = std::max(out->bandwidth_share.value_or(0), share);
           return seconds;
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
  auto parts = std::make_shared<SourcePicture>();
  parts->whole = std::move(taken);
  CutParts(!picture.sample, parts.get());
  return {
      row, [parts, &bench](SourceRow* out) {
        estimator::BlockOptions options;
        options.block_px = kSourceBlockPx;
        options.threads = bench.threads;
        options.progress = [](int, int) { ThrowIfInterrupted(); };
        const auto count = static_cast<double>(parts->parts.size());
        double seconds = 0, macade = 0, delta_e94 = 0, psnr_db = 0;
        bool has_edges = true;
        for (const BenchScene& part : parts->parts) {
          estimator::EstimateSummary summary;
          const model::LightField estimate =
              estimator::EstimateByBlocks(part.input, options, bench.processor.get(), &summary);
          seconds += summary.setup_seconds + summary.solve_seconds;
          if (!out->seconds.empty()) continue;
          const model::LinearPicture again = estimator::Photograph(
              estimate, part.input.weights, &*part.input.camera, nullptr, nullptr, bench.threads);
          const estimator::PictureScores scores = estimator::ComparePictures(
              estimator::StoredValuesOf(part.input.picture, part.input.transfer),
              estimator::StoredValuesOf(again, part.input.transfer), BorderPx(part.input.picture));
          has_edges = has_edges && scores.macade_standin.has_value();
          macade += scores.macade_standin.value_or(0) / count;
          delta_e94 += scores.delta_e94_mean / count;
          if (part.has_truth()) psnr_db += PsnrDb(part, estimate, bench.threads) / count;
        }
        if (out->seconds.empty()) {
          if (has_edges) out->macade_standin = macade;
          out->delta_e94_mean = delta_e94;
          if (parts->whole.has_truth()) out->psnr_true_views_db = psnr_db;
        }
        return parts->sample ? seconds * parts->sample->all / parts->sample->solved : seconds;
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
  if (!picture.whole.input.camera) {
    spdlog::warn("{}: table 4 needs --camera; it is left out", picture.name);
    return;
  }
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
      if (spent[i] < kEnoughSeconds) {
        const Clock::time_point start = Clock::now();
        contender.row.seconds.push_back(contender.run(&contender.row));
        spent[i] += SecondsSince(start);
      }
      progress.Show(++done, total);
    }
  }
  for (Contender& contender : *contenders) rows->push_back(std::move(contender.row));
}

struct PictureSize {
  std::string name;
  char size = ' ';
  int width_px = 0, height_px = 0;
};

std::vector<PictureSize> SizesOf(const BenchSourceOptions& options) {
  std::vector<PictureSize> sizes;
  for (const std::string& text :
       options.sizes.empty() ? std::vector<std::string>{"L", "K"} : options.sizes) {
    if (text == "K") {
      sizes.push_back({"K", 'K', 640, 480});
    } else if (text == "L") {
      sizes.push_back({"L", 'L', 256, 256});
    } else {
      const auto parts = SplitPixels("--size", text, 'x', "K, L or WIDTHxHEIGHT");
      if (parts.size() != 2 || parts[0] < 64 || parts[1] < 64) {
        throw UsageError(fmt::format(
            "--size: K, L or WIDTHxHEIGHT, both at least 64, is expected, found '{}'", text));
      }
      sizes.push_back({text, ' ', parts[0], parts[1]});
    }
  }
  return sizes;
}

SourcePicture Simulated(const BenchSourceOptions& options, const PictureSize& size,
                        const model::Camera& camera, int views) {
  ProgressLine progress("simulating", options.common.quiet);
  SourcePicture picture;
  picture.name = size.name;
  picture.size = size.size;
  picture.views = views;
  picture.whole = MakeBenchScene(camera, views, views, options.seed, 0, [&](int done, int total) {
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

void MeasureTimes(const Bench& bench, const SourcePicture& picture, std::vector<SourceRow>* rows) {
  const auto& tables = bench.options->tables;
  const auto wants = [&](int table) {
    return std::find(tables.begin(), tables.end(), table) != tables.end();
  };
  std::vector<Contender> contenders;
  if (wants(1)) AddTable1(bench, picture, &contenders);
  if (wants(2)) AddTable2(bench, picture, &contenders);
  if (wants(3)) AddTable3(bench, picture, &contenders);
  Measure(*bench.options, &contenders, rows);
}

// The source does not say how many views its table 4 had.
constexpr int kViewsOfTable4 = 5;

void MeasureLenses(const Bench& bench, const SourcePicture& picture, std::vector<SourceRow>* rows) {
  std::vector<Contender> contenders;
  AddTable4(bench, picture, &contenders);
  Measure(*bench.options, &contenders, rows);
}

std::vector<SourceRow> MeasureAll(const Bench& bench) {
  const BenchSourceOptions& options = *bench.options;
  const std::set<int> tables(options.tables.begin(), options.tables.end());
  const bool times = *tables.begin()<4, lenses = tables.count(4)> 0;
  std::vector<SourceRow> rows;
  if (!options.given.picture_path.empty()) {
    if (times) {
      for (const int views : options.views) MeasureTimes(bench, Given(options, views), &rows);
    }
    if (lenses) MeasureLenses(bench, Given(options, kViewsOfTable4), &rows);
    return rows;
  }
  for (const PictureSize& size : SizesOf(options)) {
    if (times) {
      for (const int views : options.views) {
        MeasureTimes(bench,
                     Simulated(options, size, BenchCamera(size.width_px, size.height_px), views),
                     &rows);
      }
    }
    if (lenses) {
      MeasureLenses(
          bench,
          Simulated(options, size, ThickBenchCamera(size.width_px, size.height_px), kViewsOfTable4),
          &rows);
    }
  }
  return rows;
}

void CheckUsage(const BenchSourceOptions& options) {
  const EstimateOptions& given = options.given;
  if (given.picture_path.empty() != given.depth_path.empty()) {
    throw UsageError("--image and --depth belong together");
  }
  if (given.picture_path.empty() && !given.camera_path.empty()) {
    throw UsageError("--camera is that of --image, which is not given");
  }
  if (!given.picture_path.empty() && !options.sizes.empty()) {
    throw UsageError("--size is of simulated pictures, and --image gives one");
  }
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
      if (row.table == table) json_rows.push_back(SourceRowJson(row));
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
           {"seed", options.seed},
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
  command->add_option("--views", options->views, "Of tables 1 to 3, across and down (3 5 7)")
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
  command->add_option("--seed", options->seed, "Of texture and noise")
      ->capture_default_str()
      ->type_name("N");
  AddDeviceOption(command, &options->device);
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] { RunCommand(options->common, [&] { return BenchSource(*options); }); };
  });
}

}  // namespace thicklens::tools
