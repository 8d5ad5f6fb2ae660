#include "tools/bench/profile_measurement.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <system_error>
#include <tuple>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/utc_time.h"
#include "thicklens/estimator/compare.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/scene_simulator.h"
#include "tools/bench/bench_machine.h"
#include "tools/bench/bench_parts.h"
#include "tools/bench/bench_scene.h"
#include "tools/bench/bench_solvers.h"
#include "tools/options/estimate_call.h"
#include "tools/options/file_seconds.h"
#include "tools/system/build_info.h"
#include "tools/system/machine.h"
#include "tools/system/program_run.h"
#include "tools/system/temporary_folder.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

// Warnings about simulated images are not of interest.
class OnlyErrors {
 public:
  OnlyErrors() : level_(spdlog::get_level()) { spdlog::set_level(spdlog::level::err); }
  ~OnlyErrors() { spdlog::set_level(level_); }
  OnlyErrors(const OnlyErrors&) = delete;
  OnlyErrors& operator=(const OnlyErrors&) = delete;

 private:
  spdlog::level::level_enum level_;
};

// The files in the folder of a case; each run has a folder of its own.
constexpr char kImage[] = "picture.png", kDepth[] = "depth.pfm", kCamera[] = "camera.yaml";
constexpr char kLightField[] = "light-field", kSummary[] = "summary.json";

struct Prepared {
  EstimateOptions options;
  fs::path folder;
  std::optional<model::LightField> truth;
};

// The measurements of a case.
struct CaseRuns {
  Prepared prepared;
  std::vector<std::vector<estimator::TimedWorkload>> runs;  // of each plan
  std::vector<double> file_seconds;                         // of each round
};

model::EncodedImage FirstChannel(const model::EncodedImage& image) {
  model::EncodedImage grey = image;
  grey.channels = 1;
  grey.values.clear();
  for (std::size_t i = 0; i < image.values.size(); i += static_cast<std::size_t>(image.channels)) {
    grey.values.push_back(image.values[i]);
  }
  return grey;
}

Prepared Prepare(const ProfileCase& what, const ProfileRun& run, const fs::path& folder) {
  model::Camera camera = BenchCamera(what.size_px, what.size_px);
  camera.lens.aperture_radius_mm *= what.aperture;
  model::SceneSimulationOptions scene =
      what.cards ? CardsScene(camera, what.views, what.views, run.seed)
                 : SlantedScene(camera, what.views, what.views, run.seed);
  for (model::SceneLayer& layer : scene.layers) {
    if (what.colour) layer.texture.saturation = model::SceneLayer().texture.saturation;
  }
  const model::SceneRun stoppable = {run.threads, [](int, int) { ThrowIfCancelled(); }};
  const model::SceneSimulator simulator(scene, std::vector<model::LayerPixels>(scene.layers.size()),
                                        run.threads);
  const model::EncodedImage stored = simulator.Store(simulator.RenderNoiseless(stoppable));
  fs::create_directories(folder);
  Prepared prepared;
  prepared.folder = folder;
  EstimateOptions& options = prepared.options;
  options.image_path = (folder / kImage).string();
  options.depth_path = (folder / kDepth).string();
  options.camera_path = (folder / kCamera).string();
  options.output_folder = (folder / kLightField).string();
  WriteFileAtomically(options.image_path,
                      io::EncodePng(what.colour ? stored : FirstChannel(stored)));
  WriteFileAtomically(options.depth_path, io::EncodePfm(simulator.RenderDepth()));
  WriteFileAtomically(options.camera_path, model::CameraToYaml(simulator.camera()));
  options.depth.kind = "z";
  options.depth.unit = "mm";
  options.views.text = fmt::format("{0}x{0}", what.views);
  options.common.quiet = true;
  options.common.threads = run.threads;
  if (what.use == ProfileCase::Use::kTimeAndViews) {
    prepared.truth = simulator.RenderLightField(what.views, what.views, stoppable);
    if (!what.colour) prepared.truth = GreyViews(*prepared.truth);
  }
  return prepared;
}

double PsnrDb(const Prepared& prepared, const model::LightField& estimate, int threads) {
  const model::LightField& truth = *prepared.truth;
  return estimator::CompareLightFields(truth, estimate,
                                       BorderPx({truth.s_count, truth.t_count, 1, {}}),
                                       std::nullopt, threads)
      .mean.psnr_db;
}

// Runs a process of its own, and returns its summary.
nlohmann::json RunOnce(const std::string& program, const Prepared& prepared,
                       const estimator::EstimatePlan& plan) {
  const EstimateOptions& options = prepared.options;
  std::vector<std::string> words = {"estimate",
                                    kImage,
                                    kDepth,
                                    "--camera",
                                    kCamera,
                                    "--depth-kind",
                                    options.depth.kind,
                                    "--depth-unit",
                                    options.depth.unit,
                                    "--views",
                                    options.views.text,
                                    "--threads",
                                    fmt::format("{}", options.common.threads),
                                    "-o",
                                    kLightField,
                                    "--json",
                                    kSummary,
                                    "--quiet"};
  const std::vector<std::string> of_plan = PlanWords(plan);
  words.insert(words.end(), of_plan.begin(), of_plan.end());
  const ProgramRun ended =
      RunProgram(program, words, prepared.folder, std::numeric_limits<double>::infinity());
  nlohmann::json summary;
  if (ended.exit_code == 0) {
    summary =
        nlohmann::json::parse(ReadWholeFile((prepared.folder / kSummary).string()), nullptr, false);
  }
  if (!summary.is_object() || !summary.contains("seconds")) {
    throw Error(fmt::format("{} {}: it ended with {} (signal {}) and wrote: {}", program,
                            ShellCommand(words), ended.exit_code, ended.signal, ended.err));
  }
  return summary;
}

estimator::TimedWorkload Timed(const estimator::Workload& load, const nlohmann::json& seconds) {
  const auto of = [&](const char* part) { return seconds.at(part).get<double>(); };
  // Parts are measured one by one: rounding may put them above the whole.
  estimator::PartSeconds parts;
  double left = of("total");
  const auto take = [&left](double part) {
    part = std::clamp(part, 0.0, left);
    left -= part;
    return part;
  };
  parts.read = take(of("read"));
  parts.setup = take(of("setup") - of("read"));
  parts.solve = take(of("solve"));
  parts.files = take(of("files"));
  return {load, of("total"), parts};
}

// Returns the run whose whole time is the median, and the slower of two. It is one run and not a
// mean, so that its parts add up to its whole time.
estimator::TimedWorkload MiddleRun(std::vector<estimator::TimedWorkload> runs) {
  const auto middle = runs.begin() + static_cast<std::ptrdiff_t>(runs.size() / 2);
  std::nth_element(runs.begin(), middle, runs.end(),
                   [](const estimator::TimedWorkload& a, const estimator::TimedWorkload& b) {
                     return a.seconds < b.seconds;
                   });
  return *middle;
}

// Returns the median and the maximum of |ratio - 1|.
std::pair<double, double> ErrorsOf(std::vector<double> ratios) {
  for (double& ratio : ratios) ratio = std::abs(ratio - 1);
  return {Median(ratios), *std::max_element(ratios.begin(), ratios.end())};
}

// Plans of one solver differ only in the time of solving.
void FitLaws(MeasuredProfile* measured) {
  std::vector<estimator::PlanProfile>& plans = measured->profile.plans;
  std::map<std::string, std::vector<std::size_t>> of_solver;
  for (std::size_t i = 0; i < plans.size(); ++i) of_solver[plans[i].plan.solver].push_back(i);
  for (const auto& [solver, members] : of_solver) {
    estimator::TimesOfPlans times;
    for (const std::size_t i : members) times.push_back(measured->loads[i]);
    const std::vector<estimator::TimeModel> models = estimator::FitTimeModels(times);
    const std::vector<std::vector<double>> ratios = estimator::LeftOutRatios(times);
    for (std::size_t k = 0; k < members.size(); ++k) {
      estimator::PlanProfile& plan = plans[members[k]];
      plan.time_model = models[k];
      std::tie(plan.median_error, plan.largest_error) = ErrorsOf(ratios[k]);
    }
  }
}

void TakeLarger(const estimator::Workload& load, estimator::Workload* largest) {
  largest->megapixels = std::max(largest->megapixels, load.megapixels);
  largest->channels = std::max(largest->channels, load.channels);
  largest->views = std::max(largest->views, load.views);
  largest->blur_sigma_px = std::max(largest->blur_sigma_px, load.blur_sigma_px);
}

}  // namespace

const std::vector<ProfileCase>& UsualProfileCases() {
  using Use = ProfileCase::Use;
  static const std::vector<ProfileCase> cases = {
      {96, 3, true, false, 1, Use::kTimeAndViews},  {96, 5, false, true, 1, Use::kTimeAndViews},
      {128, 9, true, true, 0.5, Use::kTime},        {160, 5, true, false, 1, Use::kTimeAndViews},
      {160, 7, false, true, 1, Use::kTimeAndViews}, {192, 3, false, true, 0.5, Use::kTimeAndViews},
      {192, 5, true, true, 1, Use::kTimeAndViews},  {224, 9, true, false, 2.5, Use::kTime},
      {256, 5, true, false, 0.5, Use::kTime},       {288, 9, false, false, 1.5, Use::kTime},
      {320, 3, true, true, 1, Use::kTime},          {352, 7, true, false, 1, Use::kTime},
      {384, 5, false, true, 2, Use::kTime},         {416, 5, true, true, 0.5, Use::kTime},
      {448, 3, false, false, 0.7, Use::kTime},      {448, 7, true, false, 1, Use::kTime},
      {480, 3, true, false, 1, Use::kTime},         {256, 3, true, true, 0.05, Use::kTime},
      {400, 5, true, false, 0.02, Use::kTime},      {320, 7, false, true, 0.15, Use::kTime},
      {560, 3, true, true, 0.05, Use::kCheck},      {600, 5, true, true, 1, Use::kCheck},
      {640, 7, false, true, 0.8, Use::kCheck},      {720, 3, true, false, 1, Use::kCheck}};
  return cases;
}

std::vector<estimator::EstimatePlan> PlansOfProfile() {
  std::vector<estimator::EstimatePlan> plans;
  for (estimator::EstimatePlan plan : WholeImagePlans()) {
    if (plan.solver == "grid") continue;
    plans.push_back(plan);
    if (plan.prior == "ridge" || plan.prior == "gradient") continue;
    plan.tolerance = plan.solver == "scene" ? 0.01 : 0.1;
    plans.push_back(plan);
  }
  return plans;
}

MeasuredProfile MeasureProfile(const std::vector<estimator::EstimatePlan>& plans,
                               const ProfileRun& run) {
  const OnlyErrors silence;
  const TemporaryFolder folder("profile");
  MeasuredProfile measured;
  estimator::EstimateProfile& profile = measured.profile;
  profile.processor = ProcessorName();
  profile.date = NowIso8601();
  profile.build = BuildInfo();
  profile.threads = ResolveThreads(run.threads);
  profile.probe_seconds = ProbeSeconds(profile.threads);
  profile.runs = run.repeat;
  profile.from = "this run";
  measured.loads.resize(plans.size());
  measured.checks.resize(plans.size());
  for (const estimator::EstimatePlan& plan : plans) {
    profile.plans.emplace_back();
    profile.plans.back().plan = plan;
  }
  const std::string program = run.program.empty() ? ThisProgram() : run.program;
  int& judged = measured.judged;
  int done = 0;
  const int total =
      static_cast<int>(run.cases.size()) * (1 + static_cast<int>(plans.size()) * run.repeat);
  std::vector<CaseRuns> cases;
  for (const ProfileCase& what : run.cases) {
    if (run.progress) run.progress(done++, total);
    const fs::path of_case = folder.path() / fmt::format("case-{}", cases.size());
    cases.push_back({Prepare(what, run, of_case), {}, {}});
    cases.back().runs.resize(plans.size());
    const Prepared& prepared = cases.back().prepared;
    if (!prepared.truth) continue;
    ++judged;
    profile.warping_psnr_db += PsnrDb(
        prepared, RunWarping(PrepareProblemOf(prepared.options).input(), run.threads).light_field,
        run.threads);
  }
  if (judged == 0) throw Error("a profile needs a case that is judged by true views");
  // The cases run in rounds: a machine that is slower for a minute affects one run of each, and not
  // all runs of one case.
  for (int round = 0; round < run.repeat; ++round) {
    for (CaseRuns& of_case : cases) {
      const Prepared& prepared = of_case.prepared;
      const estimator::Workload load = MeasuredWorkload(PrepareProblemOf(prepared.options).input());
      of_case.file_seconds.push_back(load.file_seconds);
      for (std::size_t i = 0; i < plans.size(); ++i) {
        if (run.progress) run.progress(done++, total);
        const nlohmann::json summary = RunOnce(program, prepared, plans[i]);
        of_case.runs[i].push_back(Timed(load, summary["seconds"]));
        const std::string& made = prepared.options.output_folder;
        if (prepared.truth && round == 0) {
          profile.plans[i].psnr_db += PsnrDb(prepared, io::ReadLightField(made, {}), run.threads);
        }
        std::error_code ignored;
        fs::remove_all(made, ignored);
      }
    }
  }
  for (std::size_t c = 0; c < cases.size(); ++c) {
    const bool is_check = run.cases[c].use == ProfileCase::Use::kCheck;
    for (std::size_t i = 0; i < plans.size(); ++i) {
      estimator::TimedWorkload middle = MiddleRun(std::move(cases[c].runs[i]));
      middle.load.file_seconds = Median(cases[c].file_seconds);
      if (!is_check) TakeLarger(middle.load, &profile.largest);
      (is_check ? measured.checks : measured.loads)[i].push_back(middle);
    }
  }
  profile.warping_psnr_db /= judged;
  for (estimator::PlanProfile& plan : profile.plans) plan.psnr_db /= judged;
  FitLaws(&measured);
  return measured;
}

std::string ProfileTable(const MeasuredProfile& measured) {
  const estimator::EstimateProfile& profile = measured.profile;
  // For people to compare: an image of a common size, that takes to encode what these do.
  const auto millions = [](const estimator::Workload& load) {
    return load.megapixels * load.channels * load.views;
  };
  estimator::Workload usual{0.64 * 0.48, 3, 49, 2, 0};
  std::vector<double> encode_seconds;
  for (const estimator::TimedWorkload& timed : measured.loads.front()) {
    encode_seconds.push_back(timed.load.file_seconds / millions(timed.load));
  }
  usual.file_seconds = Median(encode_seconds) * millions(usual);
  std::string text = fmt::format("{:<32}{:>10}{:>10}{:>14}{:>18}{:>16}\n", "", "PSNR dB", "loss dB",
                                 "seconds at K", "law's error: mid", "largest");
  for (const estimator::PlanProfile& plan : profile.plans) {
    text += fmt::format("{:<32}{:>10.2f}{:>10.2f}{:>14.3g}{:>16.0f} %{:>14.0f} %\n",
                        estimator::PlanName(plan.plan), plan.psnr_db, profile.LossDb(plan),
                        plan.time_model.Seconds(usual), 100 * plan.median_error,
                        100 * plan.largest_error);
  }
  text += fmt::format(
      "{:<32}{:>10.2f}{:>10.2f}\n\n"
      "PSNR: against the true views, mean over {} of the {} images. K: 640 x 480 px in colour, 7 "
      "x 7\nviews, blur of 2 px, after it is read. model error: error of the predicted time, with "
      "reading, for\na image of a size that the model was not fitted to.\n\n",
      "warping (DIBR)", profile.warping_psnr_db, profile.best_psnr_db() - profile.warping_psnr_db,
      measured.judged, measured.loads.front().size());
  if (measured.checks.front().empty()) return text;
  text += "Larger images than any of these, as the model predicted them:\n";
  std::vector<double> ratios;
  for (std::size_t i = 0; i < profile.plans.size(); ++i) {
    for (const estimator::TimedWorkload& check : measured.checks[i]) {
      const double expected = check.parts.read + profile.plans[i].time_model.Seconds(check.load);
      text += fmt::format(
          "{:<32}{:.2f} megapixels, {} channel(s), {} views: {:.2f} s expected, {:.2f} s taken "
          "({:+.0f} %)\n",
          estimator::PlanName(profile.plans[i].plan), check.load.megapixels, check.load.channels,
          check.load.views, expected, check.seconds, 100 * (check.seconds / expected - 1));
      ratios.push_back(check.seconds / expected);
    }
  }
  const auto [middle, largest] = ErrorsOf(ratios);
  text += fmt::format("error of the prediction: {:.0f} % in the median, {:.0f} % at most\n",
                      100 * middle, 100 * largest);
  return text;
}

}  // namespace thicklens::tools
