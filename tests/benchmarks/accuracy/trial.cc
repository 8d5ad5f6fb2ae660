#include "benchmarks/accuracy/trial.h"

#include <time.h>

#include <cmath>
#include <exception>
#include <regex>

#include "tests/calib/simulated_sweep.h"
#include "thicklens/model/grey_focus.h"

namespace thicklens::accuracy {
namespace {

using thicklens::testing::SimulatedSweep;

// Reasons that differ in their numbers only count as one reason.
std::string Countable(const std::string& reason) {
  static const std::regex number(R"([-+]?\d+(\.\d+)?(e[-+]?\d+)?)");
  const std::string text = std::regex_replace(reason, number, "#");
  return text.size() <= 160 ? text : text.substr(0, 157) + "...";
}

// The seeds of the cells of the table are far apart, so that no texture is used twice.
std::uint64_t Seed(const TrialKey& key, const TrialSettings& settings) {
  return settings.first_seed + 1000000U * static_cast<std::uint64_t>(key.case_number) +
         20000U * static_cast<std::uint64_t>(key.target) + static_cast<std::uint64_t>(key.index);
}

// CPU time of this thread. Elapsed time would include other sweeps and other programs on the
// machine.
double ThreadSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

Measured Compare(const calib::Result& result, double truth) {
  const Eigen::Vector2d interval =
      result.systematic.value_or(Eigen::Vector2d(result.value, result.value));
  return {result.value - truth, result.sigma, interval.x() - truth, interval.y() - truth};
}

}  // namespace

std::string FloorName(Floor floor) {
  switch (floor) {
    case Floor::kExact:
      return "exact";
    case Floor::kDrawn:
      return "drawn";
    default:
      return "measured";
  }
}

void FillTrial(const calib::Calibration& c, const model::SweepTruth& truth, Trial* trial) {
  trial->partial = c.summary.outcome == calib::Outcome::kPartial;
  if (c.diagnostics.paper_recipe.done && c.diagnostics.paper_recipe.normalised_focus_depth_mm > 0)
    trial->recipe_error_mm =
        c.diagnostics.paper_recipe.normalised_focus_depth_mm - truth.focus_depth_mm;
  if (c.summary.blur_floor_px)
    trial->blur_floor_px = Compare(*c.summary.blur_floor_px, truth.blur_floor_px);
  trial->done = c.summary.focus_depth_mm && c.summary.image_distance_mm && c.summary.blur_ratio;
  if (!trial->done) {
    trial->reason = Countable(c.summary.reason);
    return;
  }
  // Frames in colour are calibrated as grey.
  trial->focus_depth_mm = Compare(*c.summary.focus_depth_mm,
                                  model::GreyFocusDepthMm(truth.aberrations, truth.focus_depth_mm));
  trial->image_distance_mm = Compare(*c.summary.image_distance_mm, truth.image_distance_mm);
  trial->blur_ratio = Compare(*c.summary.blur_ratio, truth.blur_ratio);
}

model::SweepSimulationOptions Simulation(const TrialKey& key, const TrialSettings& settings) {
  model::SweepSimulationOptions options =
      testing::SweepCase(key.case_name, settings.size_px, Seed(key, settings));
  options.target.kind = key.target;
  options.camera.psf = settings.psf;
  options.pupil_law = settings.pupil_law;
  return options;
}

std::vector<Trial> RunTrials(const TrialKey& key, const TrialSettings& settings,
                             const std::vector<Floor>& floors) {
  const model::SweepSimulationOptions options = Simulation(key, settings);
  SimulatedSweep simulated = testing::Simulate(options, settings.image);
  if (key.target == model::TargetKind::kKnifeEdge)
    simulated.sweep.target = model::SweepTarget::kKnifeEdge;
  if (!settings.zero_is_known) simulated.sweep.offset_mm.reset();
  calib::CalibrationOptions how;
  how.map_field = settings.map_field;
  how.threads = settings.calibration_threads;

  std::vector<Trial> trials;
  for (const Floor floor : floors) {
    Trial trial;
    trial.key = key;
    trial.floor = floor;
    trial.frames = options.frame_count;
    trial.step_mm = std::abs(options.step_mm);
    trial.true_blur_ratio = simulated.truth.blur_ratio;
    simulated.sweep.floor = {};
    if (floor == Floor::kExact) GiveFloor(&simulated);
    if (floor == Floor::kDrawn) GiveDrawnFloor(&simulated, options.seed);
    try {
      const double begin = ThreadSeconds();
      const calib::Calibration c = calib::Calibrate(simulated.sweep, how);
      trial.seconds = how.threads == 1 ? ThreadSeconds() - begin : c.summary.seconds;
      FillTrial(c, simulated.truth, &trial);
    } catch (const std::exception& e) {
      trial.reason = Countable(std::string("error: ") + e.what());
    }
    trials.push_back(trial);
  }
  return trials;
}

}  // namespace thicklens::accuracy
