#ifndef THICKLENS_TESTS_BENCHMARKS_ACCURACY_TRIAL_H_
#define THICKLENS_TESTS_BENCHMARKS_ACCURACY_TRIAL_H_

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/calib/calibrate.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::accuracy {

// How the calibration gets the blur floor.
enum class Floor {
  kExact,     // the true variance, with a stated error of 0.01 px^2 nevertheless
  kDrawn,     // a variance drawn about the truth with that error
  kMeasured,  // not at all: the target is a knife edge, on which the floor is measured
};
std::string FloorName(Floor floor);

struct TrialSettings {
  int size_px = 192;
  model::Psf psf = model::Psf::kGaussian;
  std::optional<model::PupilLaw> pupil_law;  // absent: the simulator's default
  bool zero_is_known = true;                 // the calibration gets the bench offset
  std::uint64_t first_seed = 1;
  bool map_field = false;
  int calibration_threads = 1;
  model::LinearImage image;  // image for the target `image`
};

// One simulated sweep: a case of configs/sweeps, a target, and the number of the sweep among those
// of that case and target.
struct TrialKey {
  std::string case_name;
  int case_number = 0;
  model::TargetKind target = model::TargetKind::kDeadLeaves;
  int index = 0;
};

struct Measured {
  double error = 0;                            // value minus truth
  double sigma = 0;                            // statistical sigma, as the calibration states it
  double interval_low = 0, interval_high = 0;  // the systematic interval minus the truth
  double z() const { return error / sigma; }
};

// One calibration of the sweep.
struct Trial {
  TrialKey key;
  Floor floor = Floor::kExact;
  int frames = 0;
  double step_mm = 0;
  double true_blur_ratio = 0;
  bool done = false;  // zf, d1 and kappa were found
  // Reason of a failure, with numbers replaced by #, so that equal reasons can be counted
  std::string reason;
  bool partial = false;
  Measured focus_depth_mm, image_distance_mm, blur_ratio;
  std::optional<Measured> blur_floor_px;
  // Zf error of the paper's recipe with the mean-normalised index
  std::optional<double> recipe_error_mm;
  double seconds = 0;  // CPU time of the calibration, or elapsed time if it has several threads
};

model::SweepSimulationOptions Simulation(const TrialKey& key, const TrialSettings& settings);

// Sets what the calibration found, compared with the truth.
void FillTrial(const calib::Calibration& calibration, const model::SweepTruth& truth, Trial* trial);

// Simulates the sweep of a key and calibrates it, once for each kind of floor.
std::vector<Trial> RunTrials(const TrialKey& key, const TrialSettings& settings,
                             const std::vector<Floor>& floors);

}  // namespace thicklens::accuracy

#endif  // THICKLENS_TESTS_BENCHMARKS_ACCURACY_TRIAL_H_
