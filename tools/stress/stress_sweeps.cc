#include "tools/stress/stress_sweeps.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/simulated_sweep.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/grey_focus.h"
#include "thicklens/model/light_field.h"
#include "tools/bench/bench_sweep.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

constexpr int kFieldPx = 192;
// The number of standard errors within which the truth must lie; by chance one of 16000 values does
// not.
constexpr double kMaxSigmas = 4;

double OffInSigmas(const nlohmann::json& summary, const char* name, double truth) {
  const nlohmann::json& found = summary.at(name);
  if (!found.is_object() || !found.at("value").is_number() || !found.at("sigma").is_number()) {
    throw Error(fmt::format("{} was not found: {}", name, found.dump()));
  }
  double from = found["value"], to = found["value"];
  if (found.contains("systematic") && found["systematic"].is_array()) {
    from = std::min(from, found["systematic"].at(0).get<double>());
    to = std::max(to, found["systematic"].at(1).get<double>());
  }
  const auto sigma = found["sigma"].get<double>();
  const double beyond = std::max({0.0, from - truth, truth - to});
  // A tolerance alone gives an interval and no standard error.
  if (!(sigma > 0)) {
    if (!(to > from)) throw Error(fmt::format("{} has a standard error of {:g}", name, sigma));
    return beyond > 0 ? std::numeric_limits<double>::infinity() : 0;
  }
  return beyond / sigma;
}

}  // namespace

model::SweepSimulationOptions StressSweep::UsualSimulation() {
  model::SweepSimulationOptions options = BenchSweepOptions();
  const model::Sensor& sensor = options.camera.sensor;
  options.camera = model::CropCamera(
      options.camera,
      {(sensor.width_px - kFieldPx) / 2, (sensor.height_px - kFieldPx) / 2, kFieldPx, kFieldPx});
  options.camera.calibration->blur_floor_px = model::Estimate{0.5, 0};
  return options;
}

model::SweepTruth WriteSweep(const fs::path& folder, const StressSweep& sweep) {
  const model::SweepSimulator simulator(sweep.simulation, {});
  const model::SweepTruth& truth = simulator.truth();
  std::vector<model::EncodedImage> frames;
  for (int i = 0; i < sweep.simulation.frame_count; ++i) {
    ThrowIfCancelled();
    frames.push_back(simulator.RenderFrame(i));
  }
  if (sweep.damage) sweep.damage(&frames);
  model::SweepFile file = io::DescribeSweep(sweep.simulation, simulator, false);
  file.floor.given_px = model::Estimate{truth.blur_floor_px, 0.01};
  model::Camera camera = simulator.camera();
  camera.calibration.reset();
  if (sweep.describe) sweep.describe(&file);
  if (sweep.change_camera) sweep.change_camera(&camera);
  const fs::path sweep_folder = folder / "sweep";
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const fs::path image = sweep_folder / truth.frames[i].image;
    fs::create_directories(image.parent_path());
    WriteFileAtomically(image.string(), io::EncodePng(frames[i]));
  }
  WriteFileAtomically((sweep_folder / "camera.yaml").string(), model::CameraToYaml(camera));
  WriteFileAtomically((sweep_folder / "sweep.yaml").string(), model::SweepToYaml(file));
  if (file.readings_are_counts)
    WriteFileAtomically((sweep_folder / "readings.csv").string(), model::ReadingsTable(file));
  return truth;
}

StressRun CalibrationOf(Requirement required) {
  StressRun run;
  run.output = "camera.yaml";
  run.arguments = {"calibrate", "sweep/sweep.yaml", "--no-field", "-o", run.output};
  run.required = std::move(required);
  return run;
}

namespace {

// Throws Error unless the largest term of the error, the advice and the measurement that is
// proposed are about the same thing.
void RequireAdviceAgrees(const nlohmann::json& summary) {
  const nlohmann::json& terms = summary.at("error_terms");
  if (terms.empty()) return;
  const auto has_remedy = [](const nlohmann::json& term) {
    return term.at("effect").get<double>() > 0 &&
           term.at("remedy").get<std::string>().rfind("no remedy", 0) != 0;
  };
  const std::string advice = summary.at("advice").is_null() ? "" : summary.at("advice");
  const std::string largest = terms.front().at("name");
  const auto chosen = std::find_if(terms.begin(), terms.end(), has_remedy);
  const nlohmann::json& next = summary.at("next_measurement");
  if (chosen == terms.end() && next.is_null()) return;
  for (std::size_t i = 1; i < terms.size(); ++i) {
    if (terms[i].at("effect") > terms[i - 1].at("effect"))
      throw Error("the terms of the error are not in their order: " + terms.dump());
  }
  if (chosen == terms.end() || next.is_null() || next.at("term") != chosen->at("name") ||
      next.at("larger_term") !=
          (chosen == terms.begin() ? nlohmann::json(nullptr) : nlohmann::json(largest)))
    throw Error("next_measurement is not about the largest term of the error: " + next.dump());
  if (advice.find(largest) == std::string::npos ||
      advice.find(chosen->at("name").get<std::string>()) == std::string::npos)
    throw Error(
        fmt::format("the largest term of the error is '{}', the advice is '{}'", largest, advice));
}

}  // namespace

Requirement FindsTruth(const model::SweepTruth& truth, double most_um) {
  return Solved(
      [=](const fs::path&, const nlohmann::json& summary) {
        RequireAdviceAgrees(summary);
        const double off =
            std::max({OffInSigmas(summary, "image_distance_mm", truth.image_distance_mm),
                      OffInSigmas(summary, "focus_depth_mm",
                                  model::GreyFocusDepthMm(truth.aberrations, truth.focus_depth_mm)),
                      OffInSigmas(summary, "blur_ratio", truth.blur_ratio)});
        const double off_um = 1000 * std::abs(summary["image_distance_mm"]["value"].get<double>() -
                                              truth.image_distance_mm);
        if (!(off_um <= most_um)) {
          throw Error(fmt::format("d1 is off by {:.3g} um, more than {:g}", off_um, most_um));
        }
        return off;
      },
      kMaxSigmas);
}

Requirement Warned(const std::vector<std::string>& words) {
  return Solved(
      [words](const fs::path&, const nlohmann::json& summary) {
        RequireAdviceAgrees(summary);
        for (const nlohmann::json& warning : summary.at("warnings")) {
          const std::string text = warning.get<std::string>();
          if (std::all_of(words.begin(), words.end(), [&](const std::string& word) {
                return text.find(word) != std::string::npos;
              })) {
            return 0.0;
          }
        }
        throw Error("no warning contains " + fmt::format("{}", fmt::join(words, ", ")) + ": " +
                    summary["warnings"].dump());
      },
      0);
}

}  // namespace thicklens::tools
