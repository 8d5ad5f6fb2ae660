#include "benchmarks/accuracy/fault_study.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <iostream>

#include "tests/calib/damaged_sweep.h"
#include "thicklens/base/parallel.h"

namespace thicklens::accuracy {
namespace {

using testing::SimulatedSweep;

struct Damage {
  std::string name;
  std::function<void(model::SweepSimulationOptions*)> before;  // changes the simulation
  std::function<void(SimulatedSweep*)> after;
  int fewest_frames = 0;  // number of frames that the case needs for it
};

std::vector<Damage> Damages() {
  const auto options = [](auto change) {
    return std::function<void(model::SweepSimulationOptions*)>(change);
  };
  return {
      {"clean", {}, {}},
      {"flicker 20 %", options([](auto* o) { o->flicker = 0.2; }), {}},
      {"JPEG quality 90", {}, [](SimulatedSweep* s) { StoreAsJpeg(s, 90); }},
      {"dust", {}, [](SimulatedSweep* s) { AddDust(s); }},
      {"faults planted", {}, [](SimulatedSweep* s) { PlantFaults(s); }, 30},
      {"JPEG quality 20", {}, [](SimulatedSweep* s) { StoreAsJpeg(s, 20); }},
      {"sRGB taken as linear",
       options([](auto* o) { o->camera.sensor.transfer = model::TransferCurve::Srgb(); }),
       [](SimulatedSweep* s) { s->sweep.camera.sensor.transfer = model::TransferCurve::Linear(); }},
      {"vignetting 48 %", {}, [](SimulatedSweep* s) { Vignette(s, 0.48); }},
      {"fixed glare", {}, [](SimulatedSweep* s) { AddGlare(s); }},
      {"readings 5 % long", {}, [](SimulatedSweep* s) { ScaleReadings(s, 1.05); }},
      {"bench offset 2 mm off", {}, [](SimulatedSweep* s) { s->sweep.offset_mm->value += 2; }},
      {"readings reversed", {}, [](SimulatedSweep* s) { ReverseReadings(s); }},
  };
}

// Result of calibrating the damaged sweep.
struct Row {
  std::string outcome, first_warning;
  bool done = false;
  int rejected = 0;
  double focus_error_mm = 0, focus_sigma_mm = 0, focus_beyond_mm = 0;
  double ratio_error = 0, ratio_sigma = 0, ratio_beyond = 0;  // relative to kappa
};

// Returns how far the truth lies outside the stated interval: the systematic one, widened by 2
// sigma.
double Beyond(const calib::Result& result, double truth) {
  const Eigen::Vector2d interval =
      result.systematic.value_or(Eigen::Vector2d(result.value, result.value));
  const double lowest = std::min(interval.x(), result.value) - 2 * result.sigma;
  const double highest = std::max(interval.y(), result.value) + 2 * result.sigma;
  return std::max({0.0, lowest - truth, truth - highest});
}

Row RunOne(const std::string& case_name, const Damage& damage, const TrialSettings& settings) {
  TrialKey key;
  key.case_name = case_name;
  model::SweepSimulationOptions options = Simulation(key, settings);
  if (options.frame_count < damage.fewest_frames) {
    Row row;
    row.outcome = "not run";
    row.first_warning =
        fmt::format("of {} frames, {} are needed", options.frame_count, damage.fewest_frames);
    return row;
  }
  if (damage.before) damage.before(&options);
  SimulatedSweep simulated = testing::Simulate(options);
  GiveFloor(&simulated);
  if (damage.after) damage.after(&simulated);
  calib::CalibrationOptions how;
  how.threads = settings.calibration_threads;
  how.map_field = settings.map_field;
  const calib::Calibration c = Calibrate(simulated.sweep, how);
  Row row;
  row.outcome = OutcomeName(c.summary.outcome);
  row.first_warning = c.summary.outcome == calib::Outcome::kRefused ? c.summary.reason
                      : c.summary.warnings.empty()                  ? ""
                                                                    : c.summary.warnings.front();
  row.rejected =
      static_cast<int>(std::count_if(c.frames.begin(), c.frames.end(),
                                     [](const auto& frame) { return !frame.rejection.empty(); }));
  row.done = c.summary.focus_depth_mm && c.summary.blur_ratio;
  if (!row.done) return row;
  const model::SweepTruth& truth = simulated.truth;
  row.focus_error_mm = c.summary.focus_depth_mm->value - truth.focus_depth_mm;
  row.focus_sigma_mm = c.summary.focus_depth_mm->sigma;
  row.focus_beyond_mm = Beyond(*c.summary.focus_depth_mm, truth.focus_depth_mm);
  row.ratio_error = c.summary.blur_ratio->value / truth.blur_ratio - 1;
  row.ratio_sigma = c.summary.blur_ratio->sigma / truth.blur_ratio;
  row.ratio_beyond = Beyond(*c.summary.blur_ratio, truth.blur_ratio) / truth.blur_ratio;
  return row;
}

void PrintRow(const std::string& case_name, const std::string& damage, const Row& row) {
  if (row.done) {
    std::cout << fmt::format(
        "{:<5}{:<22}{:<9}{:>4}{:>10.3f}{:>9.3f}{:>9.3f}{:>9.2f}{:>8.2f}{:>9.2f}", case_name, damage,
        row.outcome, row.rejected, row.focus_error_mm, row.focus_sigma_mm, row.focus_beyond_mm,
        100 * row.ratio_error, 100 * row.ratio_sigma, 100 * row.ratio_beyond);
  } else {
    std::cout << fmt::format("{:<5}{:<22}{:<9}{:>4}{:>54}", case_name, damage, row.outcome,
                             row.rejected, "");
  }
  std::cout << "  " << row.first_warning.substr(0, 110) << "\n";
}

}  // namespace

nlohmann::ordered_json RunFaultStudy(const std::vector<std::string>& cases,
                                     const TrialSettings& settings, int threads) {
  const std::vector<Damage> damages = Damages();
  const auto columns = static_cast<int>(damages.size());
  std::vector<Row> rows(cases.size() * damages.size());
  ParallelFor(static_cast<int>(rows.size()), threads, [&](int i) {
    rows[static_cast<std::size_t>(i)] =
        RunOne(cases[static_cast<std::size_t>(i / columns)],
               damages[static_cast<std::size_t>(i % columns)], settings);
  });
  std::cout << "\nA whole sweep damaged: errors, sigmas, and how far the truth lies beyond 2 sigma "
               "around the\nsystematic interval\n"
            << fmt::format("{:<5}{:<22}{:<9}{:>4}{:>10}{:>9}{:>9}{:>9}{:>8}{:>9}  {}\n", "case",
                           "damage", "outcome", "out", "zf mm", "sigma", "beyond", "kappa %",
                           "sigma", "beyond", "first warning, or why refused");
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::string& case_name = cases[i / damages.size()];
    const Damage& damage = damages[i % damages.size()];
    const Row& row = rows[i];
    PrintRow(case_name, damage.name, row);
    nlohmann::ordered_json entry = {{"case", case_name},
                                    {"damage", damage.name},
                                    {"outcome", row.outcome},
                                    {"frames_rejected", row.rejected},
                                    {"first_warning_or_reason", row.first_warning}};
    if (row.done) {
      entry["focus_depth_error_mm"] = row.focus_error_mm;
      entry["focus_depth_sigma_mm"] = row.focus_sigma_mm;
      entry["focus_depth_beyond_mm"] = row.focus_beyond_mm;
      entry["blur_ratio_relative_error"] = row.ratio_error;
      entry["blur_ratio_relative_sigma"] = row.ratio_sigma;
      entry["blur_ratio_relative_beyond"] = row.ratio_beyond;
    }
    json.push_back(entry);
  }
  return json;
}

}  // namespace thicklens::accuracy
