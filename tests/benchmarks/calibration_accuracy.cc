// Measures the accuracy of calibrations and of their error bars: it simulates seeded sweeps of the
// cases in configs/sweeps, each of several targets, calibrates them and compares the results with
// the truth.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <exception>
#include <fstream>
#include <iostream>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "benchmarks/accuracy/fault_study.h"
#include "benchmarks/accuracy/kinds_study.h"
#include "benchmarks/accuracy/processing_study.h"
#include "benchmarks/accuracy/pupil_law_study.h"
#include "benchmarks/accuracy/tables.h"
#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"

namespace thicklens::accuracy {
namespace {

const std::vector<std::string> kCases = {"i", "ii", "iii", "iv", "v"};
const std::vector<model::TargetKind> kTargets = {
    model::TargetKind::kWhiteNoise,   model::TargetKind::kPinkNoise,
    model::TargetKind::kCheckerboard, model::TargetKind::kSiemensStar,
    model::TargetKind::kDeadLeaves,   model::TargetKind::kImage,
    model::TargetKind::kKnifeEdge};

struct Arguments {
  std::vector<std::string> cases = kCases;
  std::vector<std::string> targets;
  std::vector<std::string> floors = {"exact", "drawn"};
  int sweeps = 20;
  int threads = 0;
  TrialSettings settings;
  std::string psf = "gaussian";
  std::string image_path;
  std::string json_path;
  bool faults = false;
  bool pupil_laws = false;
  bool processing = false;
  bool benches = false;
  bool check = false;
  KindsOptions kinds;
};

std::vector<std::string> TargetNames() {
  std::vector<std::string> names;
  for (const model::TargetKind kind : kTargets) names.push_back(model::TargetKindName(kind));
  return names;
}

// Reads an image as a screen would show it: sRGB light is made linear.
model::LinearImage ReadImage(const std::string& path) {
  const cv::Mat stored = cv::imread(path, cv::IMREAD_GRAYSCALE);
  if (stored.empty())
    throw Error(path +
                ": cannot be read as an image; a PNG, JPEG or TIFF file is "
                "expected");
  model::LinearImage image{stored.cols, stored.rows, 1, {}};
  for (int y = 0; y < stored.rows; ++y) {
    for (int x = 0; x < stored.cols; ++x) {
      image.values.push_back(static_cast<float>(
          model::TransferCurve::Srgb().Decode(stored.at<std::uint8_t>(y, x) / 255.0)));
    }
  }
  return image;
}

void AddOptions(CLI::App* app, Arguments* arguments) {
  const auto positive = CLI::PositiveNumber;
  app->add_option("--case", arguments->cases, "cases of configs/sweeps: i ii iii iv v (all)")
      ->check(CLI::IsMember(kCases));
  app->add_option("--target", arguments->targets,
                  "targets (all; `image` with --image alone): " + CLI::detail::join(TargetNames()))
      ->check(CLI::IsMember(TargetNames()));
  app->add_option(
         "--floor", arguments->floors,
         "blur floor of textures: exact, drawn about the truth (both); an edge measures it")
      ->check(CLI::IsMember({"exact", "drawn"}));
  app->add_option("--sweeps", arguments->sweeps, "sweeps of each case, target or kind (20)")
      ->check(CLI::Range(0, 20000));
  app->add_option("--size", arguments->settings.size_px, "side of the field in px (192)")
      ->check(CLI::Range(64, 4096));
  app->add_option("--psf", arguments->psf, "gaussian (default) or disc")
      ->check(CLI::IsMember({"gaussian", "disc"}));
  app->add_option("--image", arguments->image_path, "photograph for the target `image`")
      ->check(CLI::ExistingFile);
  app->add_option("--seed", arguments->settings.first_seed, "of the first sweep (1)")
      ->check(positive);
  app->add_option("--threads", arguments->threads, "sweeps at the same time (one per core)")
      ->check(CLI::NonNegativeNumber);
  app->add_option("--calibration-threads", arguments->settings.calibration_threads,
                  "of each calibration (1)")
      ->check(CLI::NonNegativeNumber);
  app->add_flag("--map-field", arguments->settings.map_field, "fit tiles and channels, too");
  app->add_flag("--faults", arguments->faults,
                "instead: one sweep of each case, damaged in one way after the other");
  app->add_flag("--pupil-laws", arguments->pupil_laws,
                "instead: sweeps under each law of the pupil, with a given and an unknown bench "
                "offset: whether the intervals hold the truth");
  app->add_flag("--processing", arguments->processing,
                "instead: sweeps whose frames were read with a wrong transfer curve, or denoised, "
                "compressed or sharpened: the change of kappa, and what is reported");
  CLI::Option* const benches = app->add_flag(
      "--benches", arguments->benches,
      "instead: sweeps of each kind of configs/accuracy/benches.yaml, with the goals");
  for (const char* const other : {"--faults", "--pupil-laws", "--processing"})
    benches->excludes(app->get_option(other));
  app->add_flag("--check", arguments->check,
                "with --benches: exit with 1 if a kind misses its goals")
      ->needs(benches);
  app->add_option("--kind", arguments->kinds.names, "with --benches: these kinds alone (all)")
      ->needs(benches);
  app->add_option("--mixtures", arguments->kinds.mixtures,
                  "with --benches: sweeps with random mixtures of the disturbances (0)")
      ->check(CLI::NonNegativeNumber)
      ->needs(benches);
  app->add_option("--json", arguments->json_path, "write the tables to a file");
}

std::vector<model::TargetKind> Targets(const Arguments& arguments) {
  std::vector<model::TargetKind> targets;
  for (const model::TargetKind kind : kTargets) {
    const std::string name = model::TargetKindName(kind);
    const bool named = std::count(arguments.targets.begin(), arguments.targets.end(), name) > 0;
    const bool is_image = kind == model::TargetKind::kImage;
    if (named && is_image && arguments.image_path.empty())
      throw Error("--target image: the photograph is missing; give it with --image FILE");
    if (named || (arguments.targets.empty() && !(is_image && arguments.image_path.empty())))
      targets.push_back(kind);
  }
  return targets;
}

std::vector<TrialKey> Keys(const Run& run, int sweeps) {
  std::vector<TrialKey> keys;
  for (const std::string& name : run.cases) {
    const auto number = std::find(kCases.begin(), kCases.end(), name) - kCases.begin();
    for (const model::TargetKind target : run.targets) {
      for (int i = 0; i < sweeps; ++i) {
        keys.push_back({name, static_cast<int>(number), target, i});
      }
    }
  }
  return keys;
}

void RunAll(const Arguments& arguments, Run* run) {
  const std::vector<TrialKey> keys = Keys(*run, arguments.sweeps);
  std::vector<std::vector<Trial>> results(keys.size());
  std::atomic<std::size_t> done{0};
  const auto begin = std::chrono::steady_clock::now();
  ParallelFor(static_cast<int>(keys.size()), arguments.threads, [&](int i) {
    const TrialKey& key = keys[static_cast<std::size_t>(i)];
    const bool is_edge = key.target == model::TargetKind::kKnifeEdge;
    results[static_cast<std::size_t>(i)] =
        RunTrials(key, run->settings, is_edge ? std::vector<Floor>{Floor::kMeasured} : run->floors);
    if (const std::size_t count = ++done; count % 20 == 0 || count == keys.size())
      std::cerr << fmt::format("{} of {} sweeps\n", count, keys.size());
  });
  for (const auto& result : results) {
    run->trials.insert(run->trials.end(), result.begin(), result.end());
  }
  std::cout << fmt::format(
      "{} sweeps of {} px, {} psf, in {:.0f} s\n", keys.size(), run->settings.size_px,
      arguments.psf,
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
}

// Returns false if the goals were to be checked and are missed.
bool RunStudy(Arguments arguments) {
  if (arguments.sweeps == 0 && arguments.kinds.mixtures == 0)
    throw Error("--sweeps: 0 sweeps are only of use with --mixtures");
  bool passes = true;
  if (arguments.psf == "disc") arguments.settings.psf = model::Psf::kDisc;
  if (!arguments.image_path.empty()) arguments.settings.image = ReadImage(arguments.image_path);
  nlohmann::ordered_json json;
  if (arguments.faults) {
    json["faults"] = RunFaultStudy(arguments.cases, arguments.settings, arguments.threads);
  } else if (arguments.pupil_laws) {
    json["pupil_laws"] =
        RunPupilLawStudy(arguments.cases, arguments.settings, arguments.sweeps, arguments.threads);
  } else if (arguments.benches) {
    KindsOptions kinds = arguments.kinds;
    kinds.path = THICKLENS_SOURCE_DIR "/configs/accuracy/benches.yaml";
    kinds.sweeps = arguments.sweeps;
    kinds.first_seed = arguments.settings.first_seed;
    kinds.threads = arguments.threads;
    json["benches"] = RunKindsStudy(kinds);
    for (const auto& row : json["benches"]) passes = passes && row.at("faults").empty();
  } else if (arguments.processing) {
    json["processing"] =
        RunProcessingStudy(arguments.settings, arguments.sweeps, arguments.threads);
  } else {
    Run run;
    run.settings = arguments.settings;
    run.cases = arguments.cases;
    run.targets = Targets(arguments);
    for (const std::string& floor : arguments.floors)
      run.floors.push_back(floor == "exact" ? Floor::kExact : Floor::kDrawn);
    RunAll(arguments, &run);
    json = PrintTables(run);
  }
  if (!arguments.json_path.empty()) {
    std::ofstream file(arguments.json_path);
    file << json.dump(2) << "\n";
    if (!file.flush()) throw Error(arguments.json_path + ": cannot be written");
  }
  return passes || !arguments.check;
}

}  // namespace
}  // namespace thicklens::accuracy

int main(int argc, char** argv) {
  thicklens::accuracy::Arguments arguments;
  CLI::App app("Accuracy of the calibration on simulated sweeps");
  thicklens::accuracy::AddOptions(&app, &arguments);
  CLI11_PARSE(app, argc, argv);
  cv::setNumThreads(1);  // the sweeps run in parallel
  try {
    return thicklens::accuracy::RunStudy(arguments) ? 0 : 1;
  } catch (const std::exception& e) {
    std::cerr << "thicklens_calibration_accuracy: error: " << e.what() << "\n";
    return 1;
  }
}
