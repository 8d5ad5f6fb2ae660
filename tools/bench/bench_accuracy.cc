#include "tools/bench/bench_accuracy.h"

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
#include <system_error>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/stopwatch.h"
#include "thicklens/base/utc_time.h"
#include "thicklens/estimator/blas.h"
#include "thicklens/io/scene_pixels.h"
#include "thicklens/kernels/device.h"
#include "tools/bench/bench_loop.h"
#include "tools/bench/bench_machine.h"
#include "tools/bench/bench_parts.h"
#include "tools/bench/bench_report.h"
#include "tools/bench/bench_scene.h"
#include "tools/bench/bench_solvers.h"
#include "tools/bench/cost_page.h"
#include "tools/bench/cost_plans.h"
#include "tools/bench/cost_rows.h"
#include "tools/bench/profile_measurement.h"
#include "tools/options/bench_options.h"
#include "tools/options/estimate_profile.h"
#include "tools/options/light_field_options.h"
#include "tools/options/option_values.h"
#include "tools/system/build_info.h"
#include "tools/system/machine.h"
#include "tools/system/peak_memory.h"
#include "tools/system/progress_line.h"

namespace thicklens::tools {
namespace {

struct BenchAccuracyOptions {
  CommonOptions common;
  std::vector<std::string> scenes;  // empty: UsualScenes()
  std::vector<int> views;  // empty: kDefaultViews, and 3 and 7 for each solver with its defaults
  std::optional<int> size_px;
  std::string device = "auto";
  int repeat = 5;
  bool full = false;
  std::optional<std::uint64_t> seed;
  std::string report_folder;
  bool save_profile = false;
  std::string profile_path;  // empty: the user's own
};

const std::vector<std::string>& UsualScenes() {
  static const std::vector<std::string> scenes = {"slanted", "cards"};
  return scenes;
}
bool IsOfTheBench(const std::string& scene) {
  return std::count(UsualScenes().begin(), UsualScenes().end(), scene) > 0;
}
constexpr int kDefaultViews = 5;
constexpr int kDefaultSizePx = 256;
constexpr std::uint64_t kDefaultSeed = 1;

// The backends that plans are computed on.
struct Backends {
  std::shared_ptr<kernels::Backend> processor, device;  // device: null if there is none
  int threads = 1;
};

// A built-in scene of the bench, or a description with the images that it names.
struct Scene {
  std::string name;
  std::optional<model::SceneSimulationOptions> description;
  std::vector<model::LayerPixels> pixels;
};

// All errors in the list of scenes are reported before anything is measured.
std::vector<Scene> ScenesOf(const BenchAccuracyOptions& options) {
  std::vector<Scene> scenes;
  for (const std::string& name : options.scenes.empty() ? UsualScenes() : options.scenes) {
    for (const Scene& other : scenes) {
      if (other.name == name) throw UsageError(fmt::format("--scene: '{}' is given twice", name));
    }
    Scene scene;
    scene.name = name;
    if (!IsOfTheBench(name)) {
      scene.description = model::ReadSceneSimulation(name);
      ReportDeprecated(options.common, scene.description->notices);
      if (options.seed) scene.description->seed = *options.seed;
      scene.pixels = io::ReadScenePixels(*scene.description);
    }
    scenes.push_back(std::move(scene));
  }
  const auto is_file = [](const Scene& scene) { return scene.description.has_value(); };
  if (options.size_px && std::all_of(scenes.begin(), scenes.end(), is_file)) {
    throw UsageError("--size-px is for the scenes slanted and cards; a file states its own size");
  }
  if (std::set<int>(options.views.begin(), options.views.end()).size() != options.views.size()) {
    throw UsageError("--views: a number is given twice");
  }
  return scenes;
}

// The photographs of built-in scenes are grey, so that all solvers compute one channel; those of a
// file are used as they are.
BenchScene Simulate(const BenchAccuracyOptions& options, const Scene& scene, int views,
                    int threads) {
  ProgressLine progress("simulating", options.common.quiet);
  const auto tell = [&](int done, int total) {
    ThrowIfCancelled();
    progress.Show(done, total);
  };
  const std::uint64_t seed = options.seed.value_or(kDefaultSeed);
  const int size_px = options.size_px.value_or(kDefaultSizePx);
  if (!scene.description) {
    const bool is_slanted = scene.name == UsualScenes().front();
    return is_slanted ? MakeBenchScene(size_px, size_px, views, views, seed, threads, tell)
                      : MakeOccludedScene(size_px, size_px, views, views, seed, threads, tell);
  }
  model::SceneSimulationOptions description = *scene.description;
  description.u_count = description.v_count = views;
  return SimulateBenchScene(description, scene.pixels, {threads, tell});
}

void TakeRun(const PlanRun& run, CostRow* row) {
  row->setup_seconds.push_back(run.setup_seconds);
  row->solve_seconds.push_back(run.solve_seconds);
  row->views_seconds.push_back(run.views_seconds);
  row->seconds.push_back(run.seconds());
}

void Score(const SampledImage& image, const std::vector<model::LightField>& estimates, int threads,
           CostRow* row) {
  row->scored = ScoredAreaOf(image);
  row->scores = ScoresOfViews(image, estimates, threads);
  row->reprojection_db = ScoresOfImages(image, estimates, threads).psnr_db;
}

void RunBlocks(const SampledImage& image, int threads, kernels::Backend* backend, CostRow* row) {
  const bool is_first = row->seconds.empty();
  if (is_first) WarmUp(image, row->plan, backend);
  const PartsRun run = RunParts(image, row->plan, threads, backend);
  row->setup_seconds.push_back(run.setup_seconds);
  row->solve_seconds.push_back(run.solve_seconds);
  row->views_seconds.push_back(0);  // the solver computes the views directly
  row->seconds.push_back(run.seconds());
  if (!is_first) return;
  row->sample = image.sample;
  row->iterations = run.iterations;
  row->converged = run.converged;
  row->relative_residual = run.relative_residual;
  row->rcond = run.rcond;
  Score(image, run.estimates, threads, row);
}

void RunWhole(const SampledImage& image, int threads, kernels::Backend* backend, CostRow* row) {
  const bool is_first = row->seconds.empty();
  const auto run_once = [&] {
    return row->is_warping ? RunWarping(image.whole.input, threads)
                           : RunPlan(row->plan, image.whole.input, threads, backend);
  };
  // A device compiles only once; on the processor one part warms up as well as the blocks do.
  if (is_first && row->plan.on_opencl) {
    run_once();
  } else if (is_first) {
    WarmUpWhole(image, [&](const estimator::EstimateInput& input) {
      row->is_warping ? RunWarping(input, threads) : RunPlan(row->plan, input, threads, backend);
    });
  }
  const std::optional<double> held_mib = is_first ? ForgetPeakMemory() : std::nullopt;
  const PlanRun run = run_once();
  TakeRun(run, row);
  if (!is_first) return;
  if (held_mib) row->peak_memory_mib = PeakMemoryMib() - *held_mib;
  row->iterations = run.iterations;
  row->converged = run.converged;
  row->relative_residual = run.relative_residual;
  Score(image, PartsOf(image, run.light_field), threads, row);
}

// A row that fails states the reason, and the other rows go on.
void RunRow(const SampledImage& image, const Backends& backends, CostRow* row) {
  kernels::Backend* backend = (row->plan.on_opencl ? backends.device : backends.processor).get();
  try {
    if (!row->is_warping && row->plan.solver == "blocks") {
      RunBlocks(image, backends.threads, backend, row);
    } else {
      RunWhole(image, backends.threads, backend, row);
    }
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {
    row->failure = error.what();
  }
}

void Measure(const BenchAccuracyOptions& options, const SampledImage& image,
             const Backends& backends, std::vector<CostRow>* rows) {
  // For plans that take this long, fewer runs are sufficient.
  constexpr double kEnoughSeconds = 20;
  ProgressLine progress("measuring", options.common.quiet);
  std::vector<double> spent(rows->size());
  MeasureInRounds(options.repeat, rows->size(), &progress, [&](int, std::size_t i) {
    CostRow& row = (*rows)[i];
    if (!row.failure.empty() || !(spent[i] < kEnoughSeconds)) return;
    const Clock::time_point start = Clock::now();
    RunRow(image, backends, &row);
    spent[i] += SecondsSince(start);
  });
}

std::vector<CostRow> MeasureScene(const BenchAccuracyOptions& options, const Scene& scene,
                                  int views, const PlanGrid& grid, const Backends& backends) {
  SampledImage image;
  image.whole = Simulate(options, scene, views, backends.threads);
  CutParts(options.full, PartCount::kFour, &image);
  std::vector<CostRow> rows;
  CostRow row;
  row.scene = scene.name;
  row.views = views;
  for (const estimator::EstimatePlan& plan : PlansOf(grid)) {
    row.plan = plan;
    rows.push_back(row);
  }
  row.plan = {};
  row.is_warping = true;
  rows.push_back(row);
  Measure(options, image, backends, &rows);
  return rows;
}

std::vector<CostRow> MeasureAll(const BenchAccuracyOptions& options,
                                const std::vector<Scene>& scenes, const Backends& backends) {
  PlanGrid all;
  all.full = options.full;
  all.opencl = backends.device != nullptr;
  PlanGrid base = all;
  base.base_only = !options.full;
  const bool are_given = !options.views.empty();
  std::vector<CostRow> rows;
  for (const Scene& scene : scenes) {
    for (const int views : are_given ? options.views : std::vector<int>{kDefaultViews, 3, 7}) {
      const bool is_main = are_given || views == kDefaultViews;
      for (CostRow& row : MeasureScene(options, scene, views, is_main ? all : base, backends)) {
        rows.push_back(std::move(row));
      }
    }
  }
  MarkFront(&rows);
  return rows;
}

std::string AboutText(const BenchAccuracyOptions& options, const Backends& backends,
                      double triad_bytes_per_second) {
  return fmt::format(
      "{}, {} thread(s), {:.3g} GB/s (triad), BLAS: {}, OpenCL: {}; medians of {} runs, or of as "
      "many as fit into 20 s; thicklens {}, {}",
      ProcessorName(), backends.threads, 1e-9 * triad_bytes_per_second,
      estimator::BlasDescription(), backends.device ? backends.device->description() : "none",
      options.repeat, Version(), NowIso8601());
}

std::string ProfilePathOf(const BenchAccuracyOptions& options) {
  return options.profile_path.empty() ? UserProfilePath() : options.profile_path;
}

// Claims a file in a folder that may not exist yet.
OutputFile ClaimProfile(const BenchAccuracyOptions& options) {
  const std::string path = ProfilePathOf(options);
  if (path.empty()) {
    throw UsageError(
        "--save-profile: neither XDG_CONFIG_HOME nor HOME is set; name the file to write");
  }
  if (options.profile_path.empty()) {
    std::error_code failure;
    std::filesystem::create_directories(std::filesystem::path(path).parent_path(), failure);
  }
  return OutputFile(path);
}

CommandResult SaveProfile(const BenchAccuracyOptions& options) {
  OutputFile file = ClaimProfile(options);
  ProfileRun run;
  run.threads = ResolveThreads(options.common.threads);
  run.repeat = options.repeat;
  run.seed = options.seed.value_or(kDefaultSeed);
  MeasuredProfile measured;
  {
    ProgressLine progress("measuring", options.common.quiet);
    run.progress = [&](int done, int total) {
      ThrowIfCancelled();
      progress.Show(done, total);
    };
    measured = MeasureProfile(PlansOfProfile(), run);
  }
  const nlohmann::json profile = ProfileJson(measured.profile);
  file.Commit(profile.dump(2) + "\n");
  PrintResult(
      options.common,
      fmt::format(
          "{}\nthe profile is in {}: estimate --quality, --within and --psnr-loss use it{}\n",
          ProfileTable(measured), file.path(),
          options.profile_path.empty() ? "" : " if --profile names it"));
  nlohmann::json loads = nlohmann::json::array();
  for (std::size_t i = 0; i < measured.loads.size(); ++i) {
    const estimator::PlanProfile& plan = measured.profile.plans[i];
    for (const auto* of_plan : {&measured.loads[i], &measured.checks[i]}) {
      for (const estimator::TimedWorkload& timed : *of_plan) {
        loads.push_back(
            {{"plan", estimator::PlanName(plan.plan)},
             {"in_the_model", of_plan == &measured.loads[i]},
             {"megapixels", timed.load.megapixels},
             {"channels", timed.load.channels},
             {"views", timed.load.views},
             {"blur_sigma_px", timed.load.blur_sigma_px},
             {"file_seconds", timed.load.file_seconds},
             {"seconds", timed.seconds},
             {"parts",
              {{"read", timed.parts.read},
               {"setup", timed.parts.setup},
               {"solve", timed.parts.solve},
               {"files", timed.parts.files}}},
             {"expected_seconds", timed.parts.read + plan.time_model.Seconds(timed.load)}});
      }
    }
  }
  return {BenchSummary({{"output", file.path()}, {"profile", profile}, {"loads", loads}}), "",
          true};
}

CommandResult BenchAccuracy(const BenchAccuracyOptions& options) {
  if (options.save_profile) return SaveProfile(options);
  const std::vector<Scene> scenes = ScenesOf(options);
  BenchReport report(options.report_folder);
  Backends backends;
  backends.threads = ResolveThreads(options.common.threads);
  backends.processor =
      kernels::OpenBackend(kernels::ParseDeviceRequest("cpu"), nullptr, ThrowIfCancelled);
  std::string notice;
  backends.device =
      kernels::OpenBackend(kernels::ParseDeviceRequest(options.device), &notice, ThrowIfCancelled);
  if (!backends.device->is_opencl()) {
    backends.device = nullptr;
    if (!notice.empty()) spdlog::warn("rows with OpenCL are left out: {}", notice);
  }
  const double triad = TriadBytesPerSecond(backends.threads);
  const std::vector<CostRow> rows = MeasureAll(options, scenes, backends);
  const std::string about = AboutText(options, backends, triad);
  std::vector<Plot> figures;
  for (const std::vector<CostRow>& group : CostGroups(rows)) {
    figures.push_back(CostFigure(group, fmt::format("prices-{}", figures.size() + 1)));
  }
  report.Commit(CostPage(rows, about), CostCsv(rows), figures);
  std::string text =
      about + "\n" + CostTable(rows) +
      "\n> on the Pareto front: no other plan is both faster and better. Seconds of the solver, "
      "without reading and writing; differences below the spread are a tie.\nMiB: largest increase "
      "of memory during the run. photo: PSNR of the photograph computed from the views.\n";
  if (std::any_of(rows.begin(), rows.end(), [](const CostRow& row) { return row.sample; })) {
    text +=
        "extrapol.: from four parts of 64 x 64 px, with the worst of their iterations, residuals "
        "and rcond;\nthe front uses these seconds as they are. --full runs everything.\n";
  }
  PrintResult(options.common, text);
  nlohmann::json json_rows = nlohmann::json::array();
  for (const CostRow& row : rows) json_rows.push_back(CostRowJson(row));
  nlohmann::json summary = BenchSummary({{"repeat", options.repeat},
                                         {"seed", options.seed.value_or(kDefaultSeed)},
                                         {"full", options.full},
                                         {"rows", json_rows}});
  summary["machine"]["triad_bytes_per_second"] = triad;
  summary["machine"]["threads"] = backends.threads;
  summary["machine"]["opencl"] =
      backends.device ? nlohmann::json(backends.device->description()) : nlohmann::json();
  return {std::move(summary), "", !options.report_folder.empty()};
}

}  // namespace

void AddBenchAccuracyCommand(CLI::App* bench, CommandAction* action) {
  CLI::App* command = bench->add_subcommand(
      "accuracy", "Run time and accuracy of each way to a light field, against true views");
  const auto options = std::make_shared<BenchAccuracyOptions>();
  command
      ->add_option("--scene", options->scenes,
                   "slanted, cards (both), or the file of a scene, as for simulate image")
      ->type_name("SCENE");
  command
      ->add_option("--views", options->views,
                   "Views across and down, with all plans for each (default: 5, and 3 and 7 for "
                   "each solver with its defaults)")
      ->check(CLI::Range(2, 31))
      ->type_name("N");
  command
      ->add_option(
          "--size-px", options->size_px,
          fmt::format("Side of the images of slanted and cards (default {})", kDefaultSizePx))
      ->check(CLI::Range(64, 4096))
      ->type_name("PX");
  AddRepeatOption(command, &options->repeat);
  command->add_flag("--full", options->full,
                    "Combine all choices, and solve all blocks, not a sample: takes hours");
  command
      ->add_option("--seed", options->seed,
                   "Seed of texture and noise (default 1, or that of the scene file)")
      ->type_name("N");
  AddBenchReportOption(command, &options->report_folder);
  AddDeviceOption(command, &options->device);
  CLI::Option* profile =
      command
          ->add_option("--save-profile", options->profile_path,
                       "Measure the profile for estimate --quality, --within and --psnr-loss on "
                       "this machine, instead of the list, and write it to this file; without a "
                       "name, to the file that estimate reads by default")
          ->expected(0, 1)
          ->type_name("FILE");
  for (const char* of_list :
       {"--scene", "--views", "--size-px", "--full", "--report", "--device"}) {
    profile->excludes(of_list);
  }
  AddCommonOptions(command, &options->common);
  command->callback([options, action, profile] {
    *action = [options, profile] {
      options->save_profile = profile->count() > 0;
      std::vector<std::string> files;
      for (const std::string& scene : options->scenes) {
        if (!IsOfTheBench(scene)) files.push_back(scene);
      }
      RequireDistinctFiles({options->common.json_path, options->report_folder,
                            options->save_profile ? ProfilePathOf(*options) : std::string()},
                           files);
      RunCommand(options->common, [&] { return BenchAccuracy(*options); });
    };
  });
}

}  // namespace thicklens::tools
