#include "benchmarks/accuracy/processing_study.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <iostream>
#include <opencv2/imgproc.hpp>
#include <opencv2/photo.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tests/calib/damaged_sweep.h"
#include "thicklens/base/parallel.h"
#include "thicklens/calib/camera_response.h"

namespace thicklens::accuracy {
namespace {

using Json = nlohmann::ordered_json;
using testing::SimulatedSweep;

constexpr double kFocalLengthMm = 50;  // of case ii

// The target that is photographed, and the aperture.
struct Scene {
  std::string name;
  model::TargetKind target;
  double f_number;
};

std::vector<Scene> Scenes() {
  return {{"dead leaves, f/2.8", model::TargetKind::kDeadLeaves, 2.8},
          {"pink noise, f/2.8", model::TargetKind::kPinkNoise, 2.8},
          {"dead leaves, f/16", model::TargetKind::kDeadLeaves, 16}};
}

struct Processing {
  std::string name;
  std::function<void(SimulatedSweep*)> apply;  // empty: none
};

// Applies an operation to each frame, 8-bit grey levels.
template <typename Operation>
std::function<void(SimulatedSweep*)> ToEachFrame(const Operation& operation) {
  return [operation](SimulatedSweep* sweep) {
    for (cv::Mat& frame : *sweep->stored) {
      cv::Mat processed;
      operation(frame, &processed);
      frame = processed;
    }
  };
}

Processing NonLocalMeans(float strength) {
  return {fmt::format("non-local means of strength {:g}", strength),
          ToEachFrame([strength](const cv::Mat& frame, cv::Mat* processed) {
            cv::fastNlMeansDenoising(frame, *processed, strength);
          })};
}

Processing Bilateral() {
  return {"bilateral filter, 5 px, 12 grey levels",
          ToEachFrame([](const cv::Mat& frame, cv::Mat* processed) {
            cv::bilateralFilter(frame, *processed, 5, 12, 2);
          })};
}

Processing Jpeg(int quality) {
  return {fmt::format("JPEG of quality {}", quality),
          [quality](SimulatedSweep* sweep) { StoreAsJpeg(sweep, quality); }};
}

Processing UnsharpMask(double strength) {
  return {fmt::format("unsharp masking of strength {:g} at 1 px", strength),
          ToEachFrame([strength](const cv::Mat& frame, cv::Mat* processed) {
            cv::Mat wide;
            cv::GaussianBlur(frame, wide, cv::Size(), 1);
            cv::addWeighted(frame, 1 + strength, wide, -strength, 0, *processed);
          })};
}

// The first row is what the others are compared with.
std::vector<Processing> Kinds() {
  return {{"as they are", {}},
          {"linear, read as srgb",
           [](SimulatedSweep* sweep) {
             sweep->sweep.camera.sensor.transfer = model::TransferCurve::Srgb();
           }},
          NonLocalMeans(3),
          NonLocalMeans(6),
          Bilateral(),
          Jpeg(20),
          Jpeg(50),
          Jpeg(85),
          Jpeg(95),
          UnsharpMask(0.5),
          UnsharpMask(1),
          UnsharpMask(2)};
}

model::SweepSimulationOptions OptionsOf(const Scene& scene, std::size_t number,
                                        const TrialSettings& settings, int index) {
  // The seeds of the scenes are far apart, so that no noise is used twice.
  model::SweepSimulationOptions options = testing::SweepCase(
      "ii", 0, settings.first_seed + 1000000U * number + static_cast<std::uint64_t>(index));
  model::Sensor& sensor = options.camera.sensor;
  sensor.width_px = 320;
  sensor.height_px = 240;
  sensor.principal_point_px = {0.5 * (sensor.width_px - 1), 0.5 * (sensor.height_px - 1)};
  sensor.transfer = model::TransferCurve::Linear();
  options.camera.lens.aperture_radius_mm = kFocalLengthMm / (2 * scene.f_number);
  options.camera.psf = settings.psf;
  options.target.kind = scene.target;
  return options;
}

struct Outcome {
  std::optional<double> blur_ratio;  // absent: refused
  calib::CameraResponse response;
};

// Processes and calibrates one sweep in each way.
std::vector<Outcome> OutcomesOf(const model::SweepSimulationOptions& options,
                                const TrialSettings& settings) {
  SimulatedSweep original = testing::Simulate(options);
  GiveFloor(&original);
  calib::CalibrationOptions how;
  how.threads = settings.calibration_threads;
  how.map_field = settings.map_field;
  std::vector<Outcome> outcomes;
  for (const Processing& processing : Kinds()) {
    SimulatedSweep sweep = DeepCopy(original);
    if (processing.apply) processing.apply(&sweep);
    const calib::Calibration c = Calibrate(sweep.sweep, how);
    Outcome outcome;
    if (c.summary.blur_ratio) outcome.blur_ratio = c.summary.blur_ratio->value;
    outcome.response = c.diagnostics.response;
    outcomes.push_back(outcome);
  }
  return outcomes;
}

// The smallest and the largest of some numbers.
class Range {
 public:
  void Add(double value) {
    least_ = is_empty_ ? value : std::min(least_, value);
    most_ = is_empty_ ? value : std::max(most_, value);
    is_empty_ = false;
  }
  bool is_empty() const { return is_empty_; }
  double least() const { return least_; }
  double most() const { return most_; }
  std::string Text(const std::string& format) const {
    const std::string least = fmt::format(fmt::runtime(format), least_);
    const std::string most = fmt::format(fmt::runtime(format), most_);
    return least == most ? least : least + " to " + most;
  }

 private:
  bool is_empty_ = true;
  double least_ = 0, most_ = 0;
};

// One cell of the table: a kind of processing on a scene.
struct Cell {
  int sweeps = 0, refused = 0, transfer = 0, loss = 0, sharpened = 0, compressed = 0;
  Range change_percent, power, loss_percent, loss_sigmas, shift_over_half_loss;
  std::vector<std::string> better_transfers;

  void Add(const Outcome& outcome, const Outcome& original) {
    ++sweeps;
    const calib::CameraResponse& response = outcome.response;
    std::optional<double> change;
    if (outcome.blur_ratio && original.blur_ratio)
      change = *outcome.blur_ratio / *original.blur_ratio - 1;
    if (change) {
      change_percent.Add(100 * *change);
    } else {
      ++refused;
    }
    if (response.ContradictsTransfer()) {
      ++transfer;
      power.Add(response.light_exponent->value);
      const std::string& better = response.better_transfer;
      if (std::count(better_transfers.begin(), better_transfers.end(), better) == 0)
        better_transfers.push_back(better);
    }
    if (response.weak_detail_loss) {
      const model::Estimate& measured = *response.weak_detail_loss;
      loss_percent.Add(100 * measured.value);
      loss_sigmas.Add(measured.value / measured.sigma);
      if (change && response.LosesWeakDetail())
        shift_over_half_loss.Add(2 * *change / measured.value);
    }
    loss += response.LosesWeakDetail() ? 1 : 0;
    sharpened += response.IsSharpened() ? 1 : 0;
    compressed += response.IsCompressed() ? 1 : 0;
  }

  std::string Text() const {
    if (change_percent.is_empty()) return "refused";
    return change_percent.Text("{:+.1f}") +
           (refused > 0 ? fmt::format(" %, {} refused", refused) : " %");
  }

  // The findings that were reported, each with the number of sweeps unless it is all of them.
  std::string Reported() const {
    std::string text;
    const auto add = [&](int count, const std::string& what) {
      if (count == 0) return;
      text += (text.empty() ? "" : "; ") + what;
      if (count < sweeps) text += fmt::format(" in {} of {}", count, sweeps);
    };
    if (transfer > 0) {
      std::string names;
      for (const std::string& name : better_transfers) names += (names.empty() ? "" : ", ") + name;
      add(transfer, fmt::format("power {}, transfer {}", power.Text("{:.3f}"),
                                names.empty() ? "unknown" : names));
    }
    if (loss > 0) {
      add(loss, fmt::format("loss {} %, {} sigma", loss_percent.Text("{:.1f}"),
                            loss_sigmas.Text("{:.1f}")));
    }
    add(compressed, "blocks");
    add(sharpened, "sharpening");
    return text.empty() ? "no" : text;
  }
};

Json JsonOf(const Cell& cell) {
  const auto range = [](const Range& values) {
    return values.is_empty() ? Json() : Json({values.least(), values.most()});
  };
  return {{"sweeps", cell.sweeps},
          {"refused", cell.refused},
          {"blur_ratio_change_percent", range(cell.change_percent)},
          {"transfer_reported", cell.transfer},
          {"light_exponent", range(cell.power)},
          {"loss_reported", cell.loss},
          {"weak_detail_loss_percent", range(cell.loss_percent)},
          {"weak_detail_loss_sigmas", range(cell.loss_sigmas)},
          {"change_over_half_loss", range(cell.shift_over_half_loss)},
          {"sharpening_reported", cell.sharpened},
          {"compression_reported", cell.compressed}};
}

}  // namespace

nlohmann::ordered_json RunProcessingStudy(const TrialSettings& settings, int sweeps, int threads) {
  const std::vector<Scene> scenes = Scenes();
  const std::vector<Processing> kinds = Kinds();
  std::vector<std::vector<Outcome>> outcomes(scenes.size() * static_cast<std::size_t>(sweeps));
  std::atomic<std::size_t> done{0};
  ParallelFor(static_cast<int>(outcomes.size()), threads, [&](int i) {
    const std::size_t scene = static_cast<std::size_t>(i / sweeps);
    outcomes[static_cast<std::size_t>(i)] =
        OutcomesOf(OptionsOf(scenes[scene], scene, settings, i % sweeps), settings);
    std::cerr << fmt::format("{} of {} sweeps\n", ++done, outcomes.size());
  });

  std::cout << fmt::format(
      "\nChange of kappa by processing, and what was reported: {} sweeps of case ii for each "
      "target and aperture, 320 x 240 px, seeds from {}\n\n| frames |",
      sweeps, settings.first_seed);
  for (const Scene& scene : scenes) std::cout << fmt::format(" {} | reported |", scene.name);
  std::cout << "\n|---|";
  for (std::size_t i = 0; i < scenes.size(); ++i) std::cout << "---|---|";
  std::cout << "\n";
  Json rows = Json::array();
  Range shifts;
  for (std::size_t kind = 0; kind < kinds.size(); ++kind) {
    std::cout << fmt::format("| {} |", kinds[kind].name);
    for (std::size_t scene = 0; scene < scenes.size(); ++scene) {
      Cell cell;
      for (int i = 0; i < sweeps; ++i) {
        const auto& of_sweep =
            outcomes[scene * static_cast<std::size_t>(sweeps) + static_cast<std::size_t>(i)];
        cell.Add(of_sweep[kind], of_sweep.front());
      }
      if (!cell.shift_over_half_loss.is_empty()) {
        shifts.Add(cell.shift_over_half_loss.least());
        shifts.Add(cell.shift_over_half_loss.most());
      }
      std::cout << fmt::format(" {} | {} |", kind == 0 ? "0" : cell.Text(), cell.Reported());
      Json row = {{"frames", kinds[kind].name}, {"scene", scenes[scene].name}};
      row.update(JsonOf(cell));
      rows.push_back(row);
    }
    std::cout << "\n";
  }
  if (!shifts.is_empty()) {
    std::cout << fmt::format(
        "\nWhere a loss of weak detail was reported, kappa changed by {} times half the loss.\n",
        shifts.Text("{:.2g}"));
  }
  return {{"rows", rows}};
}

}  // namespace thicklens::accuracy
