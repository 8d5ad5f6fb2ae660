#ifndef THICKLENS_TESTS_BENCHMARKS_ACCURACY_TRIAL_H_
#define THICKLENS_TESTS_BENCHMARKS_ACCURACY_TRIAL_H_

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/calib/calibrate.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::accuracy {

// What the calibration is told of the lens floor.
enum class Floor {
  kExact,     // the truth; the variance with a stated error of .01 px^2 all the same
  kDrawn,     // the variance drawn about the truth with that error
  kMeasured,  // nothing: the target is a knife edge, on which it is measured
};
std::string FloorName(Floor floor);

struct TrialSettings {
  int size_px = 192;
  model::Psf psf = model::Psf::kGaussian;
  std::optional<model::PupilLaw> pupil_law;  // absent: the simulator's own choice
  bool zero_is_known = true;                 // the calibration is told the bench zero
  std::uint64_t first_seed = 1;
  bool map_field = false;
  int calibration_threads = 1;
  model::LinearPicture picture;  // of the target `picture`
};

// One simulated sweep: a case of configs/sweeps, a target, and which of their sweeps it is.
struct TrialKey {
  std::string case_name;
  int case_number = 0;
  model::TargetKind target = model::TargetKind::kDeadLeaves;
  int index = 0;
};

struct Measured {
  double error = 0;                            // value minus truth
  double sigma = 0;                            // as the calibration states it: statistical
  double interval_low = 0, interval_high = 0;  // the systematic interval minus the truth
  double z() const { return error / sigma; }
};

// One calibration of it.
struct Trial {
  TrialKey key;
  Floor floor = Floor::kExact;
  int frames = 0;
  double step_mm = 0;
  double true_blur_ratio = 0;
  bool done = false;   // zf, d1 and kappa were found
  std::string reason;  // of a trial that is not done: numbers replaced by #, so that they count
  bool partial = false;
  Measured focus_depth_mm, image_distance_mm, blur_ratio;
  std::optional<Measured> blur_floor_px;
  std::optional<double> recipe_error_mm;  // zf of the source's recipe, mean-normalised index
  double seconds = 0;  // CPU time of the calibration; of several threads, time that passed
};

model::SweepSimulationOptions Simulation(const TrialKey& key, const TrialSettings& settings);

// Simulates the sweep of a key and calibrates it, once for each kind of floor.
std::vector<Trial> RunTrials(const TrialKey& key, const TrialSettings& settings,
                             const std::vector<Floor>& floors);

}  // namespace thicklens::accuracy

#endif  // THICKLENS_TESTS_BENCHMARKS_ACCURACY_TRIAL_H_
