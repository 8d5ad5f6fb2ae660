#include "tools/bench/bench_source.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/deprecation.h"
#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/stopwatch.h"
#include "thicklens/kernels/device.h"
#include "thicklens/model/thick_lens.h"
#include "tools/bench/bench_loop.h"
#include "tools/bench/bench_machine.h"
#include "tools/bench/bench_scene.h"
#include "tools/bench/bench_source_rows.h"
#include "tools/bench/bench_source_tables.h"
#include "tools/options/bench_options.h"
#include "tools/options/deprecated_names.h"
#include "tools/options/estimate_call.h"
#include "tools/options/light_field_options.h"
#include "tools/options/option_values.h"
#include "tools/system/progress_line.h"

namespace thicklens::tools {
namespace {

struct BenchSourceOptions {
  CommonOptions common;
  std::vector<int> tables;         // empty: all
  std::vector<int> views;          // empty: 3, 5 and 7, and kViewsOfTable4 for table 4
  std::vector<std::string> sizes;  // empty: K and L
  EstimateOptions given;           // image, depth, camera
  std::string device = "auto";
  int repeat = 5;
  bool full = false;
  std::optional<std::uint64_t> seed;
};

// The paper does not state the number of views of its table 4.
constexpr int kViewsOfTable4 = 5;
constexpr std::uint64_t kDefaultSeed = 1;

// The bench's lens with a thickness of 3 mm and another rear focal length, with the same focus.
model::Camera ThickBenchCamera(int width_px, int height_px) {
  model::Camera camera = BenchCamera(width_px, height_px);
  const double focus_depth_mm = camera.focus_depth_mm();
  camera.lens.rear_focal_length_mm = 12.8;
  camera.lens.lens_thickness_mm = 3;
  camera.calibration->image_distance_mm =
      model::Estimate{model::ImageDistanceMm(camera.lens, focus_depth_mm), 0};
  return camera;
}

void Measure(const BenchSourceOptions& options, std::vector<SourceContender>* contenders,
             std::vector<SourceRow>* rows) {
  ProgressLine progress("measuring", options.common.quiet);
  std::vector<double> spent(contenders->size(), 0.0);
  MeasureInRounds(options.repeat, contenders->size(), &progress, [&](int, std::size_t i) {
    SourceContender& contender = (*contenders)[i];
    // A contender that takes so long is measured less often: its times scatter relatively little.
    constexpr double kEnoughSeconds = 60;
    if (!contender.row.failure.empty() || !(spent[i] < kEnoughSeconds)) return;
    const Clock::time_point start = Clock::now();
    try {
      contender.row.seconds.push_back(contender.run(&contender.row));
    } catch (const Interrupted&) {
      throw;
    } catch (const Error& error) {  // one row, and not those beside it
      contender.row.failure = error.what();
    }
    spent[i] += SecondsSince(start);
  });
  for (SourceContender& contender : *contenders) rows->push_back(std::move(contender.row));
}

struct ImageSize {
  std::string name;
  int width_px = 0, height_px = 0;
};

std::vector<ImageSize> SizesOf(const BenchSourceOptions& options) {
  std::vector<ImageSize> sizes;
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

SourceImage Simulated(const BenchSourceOptions& options, const ImageSize& size,
                      const model::Camera& camera, int views) {
  ProgressLine progress("simulating", options.common.quiet);
  SourceImage image;
  image.name = size.name;
  image.views = views;
  image.whole = MakeBenchScene(camera, views, views, options.seed.value_or(kDefaultSeed),
                               options.common.threads, [&](int done, int total) {
                                 ThrowIfCancelled();
                                 progress.Show(done, total);
                               });
  Cut(options.full, &image);
  return image;
}

SourceImage Given(const BenchSourceOptions& options, int views) {
  EstimateOptions given = options.given;
  given.common = options.common;
  given.views.text = fmt::format("{0}x{0}", views);
  given.ignore_exif = !given.camera_path.empty();  // the times do not depend on it
  const Problem problem = PrepareProblemOf(given);
  SourceImage image;
  image.name = std::filesystem::path(given.image_path).stem().string();
  image.views = views;
  image.whole.input = problem.input();
  Cut(options.full, &image);
  return image;
}

void MeasureTimes(const BenchSourceOptions& options, const SourceBench& bench,
                  const std::set<int>& tables, const SourceImage& image,
                  std::vector<SourceRow>* rows) {
  std::vector<SourceContender> contenders;
  if (tables.count(1) > 0) AddTable1(bench, image, &contenders);
  if (tables.count(2) > 0) AddTable2(bench, image, &contenders);
  if (tables.count(3) > 0) AddTable3(bench, image, &contenders);
  Measure(options, &contenders, rows);
}

void MeasureLenses(const BenchSourceOptions& options, const SourceBench& bench,
                   const SourceImage& image, std::vector<SourceRow>* rows) {
  std::vector<SourceContender> contenders;
  AddTable4(bench, image, &contenders);
  Measure(options, &contenders, rows);
}

std::set<int> TablesOf(const BenchSourceOptions& options) {
  std::set<int> tables(options.tables.begin(), options.tables.end());
  if (tables.empty()) tables = {1, 2, 3, 4};
  if (!options.given.image_path.empty() && options.given.camera_path.empty()) {
    if (!options.tables.empty() && tables.count(4) > 0) {
      throw UsageError("--table 4 compares lenses: with --image it needs --camera");
    }
    if (tables.erase(4) > 0) spdlog::warn("table 4 needs --camera and is left out");
  }
  return tables;
}

std::vector<SourceRow> MeasureAll(const BenchSourceOptions& options, const SourceBench& bench) {
  const std::set<int> tables = TablesOf(options);
  std::set<int> views(options.views.begin(), options.views.end());
  if (views.empty()) views = {3, 5, 7};
  const int views_of_lenses = options.views.empty() ? kViewsOfTable4 : *views.rbegin();
  const bool times = *tables.begin()<4, lenses = tables.count(4)> 0;
  std::vector<SourceRow> rows;
  if (!options.given.image_path.empty()) {
    for (const int count : views) {
      if (times) MeasureTimes(options, bench, tables, Given(options, count), &rows);
    }
    if (lenses) MeasureLenses(options, bench, Given(options, views_of_lenses), &rows);
    return rows;
  }
  for (const ImageSize& size : SizesOf(options)) {
    const model::Camera thin = BenchCamera(size.width_px, size.height_px);
    for (const int count : views) {
      if (times) MeasureTimes(options, bench, tables, Simulated(options, size, thin, count), &rows);
    }
    if (!lenses) continue;
    const model::Camera thick = ThickBenchCamera(size.width_px, size.height_px);
    MeasureLenses(options, bench, Simulated(options, size, thick, views_of_lenses), &rows);
  }
  return rows;
}

void CheckUsage(const BenchSourceOptions& options) {
  const EstimateOptions& given = options.given;
  const bool has_image = !given.image_path.empty();
  const auto needs = [](bool is_given, bool fits, const std::string& message) {
    if (is_given && !fits) throw UsageError(message);
  };
  needs(has_image != !given.depth_path.empty(), false,
        "--image and --depth must be given together");
  needs(!given.camera_path.empty(), has_image, "--camera requires --image");
  const DepthOptions usual;
  needs(!given.depth.kind.empty() || !given.depth.unit.empty() ||
            given.depth.disparity_scale != usual.disparity_scale ||
            given.depth.disparity_offset_px != usual.disparity_offset_px,
        has_image, "--depth-kind and its settings require --depth");
  needs(!options.sizes.empty(), !has_image,
        "--size is for simulated images and cannot be used with --image");
  needs(options.seed.has_value(), !has_image,
        "--seed is for simulated images and cannot be used with --image");
}

CommandResult BenchSource(const BenchSourceOptions& options) {
  CheckUsage(options);
  SourceBench bench;
  bench.threads = ResolveThreads(options.common.threads);
  bench.processor =
      kernels::OpenBackend(kernels::ParseDeviceRequest("cpu"), nullptr, ThrowIfCancelled);
  std::string notice;
  bench.device =
      kernels::OpenBackend(kernels::ParseDeviceRequest(options.device), &notice, ThrowIfCancelled);
  if (!bench.device->is_opencl()) {
    bench.device = nullptr;
    spdlog::warn("rows with OpenCL are left out: {}",
                 notice.empty() ? "--device " + options.device : notice);
  }
  bench.triad_bytes_per_second = TriadBytesPerSecond(bench.threads);
  const std::vector<SourceRow> rows = MeasureAll(options, bench);

  std::string text = fmt::format(
      "Medians of {} runs, or of as many as fit into a minute. Machines differ, so compare the "
      "ratios\ninside a table. Published: means of the paper's four images.\n{}\n",
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
  nlohmann::json summary = BenchSummary({{"repeat", options.repeat},
                                         {"seed", options.seed.value_or(kDefaultSeed)},
                                         {"full", options.full},
                                         {"rows", json_rows}});
  summary["machine"]["triad_bytes_per_second"] = bench.triad_bytes_per_second;
  summary["machine"]["threads"] = bench.threads;
  summary["machine"]["opencl"] =
      bench.device ? nlohmann::json(bench.device->description()) : nlohmann::json();
  return {std::move(summary), ""};
}

constexpr char kBench[] = "bench ";
constexpr char kPaperCommand[] = "paper";

// `name` is the command's present or a former name.
void AddPaperCommand(CLI::App* bench, const std::string& name, CommandAction* action) {
  CLI::App* command = bench->add_subcommand(
      name, "Measure the paper's tables 1 to 4 here, beside its published values");
  const bool is_former = name != kPaperCommand;
  if (is_former) command->group("");  // hidden in --help
  const auto options = std::make_shared<BenchSourceOptions>();
  command->add_option("--table", options->tables, "Tables to measure: 1 2 3 4 (default all)")
      ->check(CLI::Range(1, 4))
      ->type_name("N");
  command
      ->add_option(
          "--views", options->views,
          "Views across and down (default 3 5 7; table 4 uses the largest given, otherwise 5)")
      ->check(CLI::Range(2, 31))
      ->type_name("N");
  command
      ->add_option(
          "--size", options->sizes,
          "Size of simulated images: K (640x480), L (256x256) or WIDTHxHEIGHT (default L K)")
      ->type_name("SIZE");
  command
      ->add_option("--image", options->given.image_path, "Image to use instead of simulated ones")
      ->type_name("FILE");
  command->add_option("--depth", options->given.depth_path, "Depth map of --image")
      ->type_name("FILE");
  command->add_option("--camera", options->given.camera_path, "Camera file of --image")
      ->type_name("FILE");
  AddDepthOptions(command, "Required with --depth", &options->given.depth);
  AddRepeatOption(command, &options->repeat);
  command->add_flag("--full", options->full, "Solve all blocks of the images, not a sample");
  command->add_option("--seed", options->seed, "Seed of texture and noise (default 1)")
      ->type_name("N");
  AddDeviceOption(command, &options->device);
  AddCommonOptions(command, &options->common);
  command->callback([options, name, is_former, action] {
    if (is_former) {
      options->common.deprecated.push_back(
          DeprecationText({kBench + name, kBench + std::string(kPaperCommand)}));
    }
    *action = [options] {
      const EstimateOptions& given = options->given;
      RequireDistinctFiles({options->common.json_path},
                           {given.image_path, given.depth_path, given.camera_path});
      RunCommand(options->common, [&] { return BenchSource(*options); });
    };
  });
}

}  // namespace

void AddBenchSourceCommand(CLI::App* bench, CommandAction* action) {
  const std::string now = kPaperCommand;
  AddPaperCommand(bench, now, action);
  for (const std::string& former : FormerNames(NameKind::kCommand, kBench + now)) {
    AddPaperCommand(bench, former.substr(std::string(kBench).size()), action);
  }
}

}  // namespace thicklens::tools
