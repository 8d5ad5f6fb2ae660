#ifndef THICKLENS_TESTS_CALIB_CALIBRATE_PLANNED_SWEEP_H_
#define THICKLENS_TESTS_CALIB_CALIBRATE_PLANNED_SWEEP_H_

#include <cmath>
#include <cstdint>
#include <mutex>
#include <random>
#include <string>
#include <vector>

#include "tests/calib/simulated_sweep.h"
#include "thicklens/base/parallel.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/sweep_plan.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::testing {

// Conditions with a camera of configs/cameras, restricted to the middle of its sensor.
inline calib::PlanConditions PlanFor(const std::string& camera, int size_px,
                                     double focus_depth_mm) {
  calib::PlanConditions conditions;
  conditions.camera =
      model::ReadCamera(THICKLENS_SOURCE_DIR "/configs/cameras/" + camera + ".yaml");
  model::Sensor& sensor = conditions.camera.sensor;
  sensor.width_px = sensor.height_px = size_px;
  sensor.principal_point_px.setConstant(0.5 * (size_px - 1));
  conditions.focus_depth_mm = focus_depth_mm;
  conditions.blur_floor_sigma_px = 0;
  conditions.offset_sigma_mm = 0;
  return conditions;
}

inline model::SweepSimulationOptions SimulationOf(const calib::PlanConditions& conditions,
                                                  const calib::SweepDesign& design,
                                                  std::uint64_t seed) {
  model::SweepSimulationOptions options;
  options.camera = conditions.camera;
  model::CameraCalibration truth;
  truth.image_distance_mm =
      model::Estimate{model::ImageDistanceMm(conditions.camera.lens, conditions.focus_depth_mm), 0};
  truth.blur_ratio = model::Estimate{conditions.blur_ratio, 0};
  truth.blur_floor_px = model::Estimate{conditions.blur_floor_px, 0};
  options.camera.calibration = truth;
  options.target.kind = conditions.texture;
  options.target.contrast = conditions.contrast;
  options.target.feature_size_mm = design.feature_size_mm;
  options.first_depth_mm = design.nearest_mm;
  options.step_mm = design.step_mm;
  options.frame_count = design.frames;
  options.reading_sigma_mm = conditions.reading_sigma_mm;
  options.light_level = conditions.light_level;
  options.lamp_falloff = conditions.lamp_falloff;
  options.full_well_electrons = conditions.full_well_electrons;
  options.read_noise_electrons = conditions.read_noise_electrons;
  options.bits = conditions.bits;
  options.seed = seed;
  return options;
}

// The errors of calibrated sweeps of a plan, each with its own texture, noise, errors of readings,
// and stated offset and floor that are wrong by their standard deviations.
struct SweepErrors {
  std::vector<double> focus_depth_mm, image_distance_mm, blur_ratio;
  std::vector<std::string> refusals;
};

inline SweepErrors SimulatedErrors(const calib::PlanConditions& conditions,
                                   const calib::SweepDesign& design, int sweeps,
                                   std::uint64_t first_seed) {
  SweepErrors errors;
  std::mutex mutex;
  ParallelFor(sweeps, 0, [&](int i) {
    const std::uint64_t seed = first_seed + static_cast<std::uint64_t>(i);
    SimulatedSweep simulated = Simulate(SimulationOf(conditions, design, seed));
    std::mt19937_64 engine(seed);
    const auto normal = [&engine] {  // Box and Muller
      const auto uniform = [&] { return (static_cast<double>(engine() >> 11) + 0.5) * 0x1p-53; };
      const double radius = std::sqrt(-2 * std::log(uniform()));
      return radius * std::cos(6.283185307179586 * uniform());
    };
    const double floor_sigma_px = conditions.blur_floor_sigma_px.value_or(0);
    simulated.sweep.floor.given_px =
        model::Estimate{conditions.blur_floor_px + floor_sigma_px * normal(), floor_sigma_px};
    simulated.sweep.offset_mm.reset();
    if (conditions.offset_sigma_mm) {
      simulated.sweep.offset_mm =
          model::Estimate{*conditions.offset_sigma_mm * normal(), *conditions.offset_sigma_mm};
    }
    calib::CalibrationOptions how;
    how.map_field = false;
    how.threads = 1;
    const calib::Calibration found = calib::Calibrate(simulated.sweep, how);
    const std::lock_guard<std::mutex> lock(mutex);
    const calib::CalibrationSummary& summary = found.summary;
    if (!summary.focus_depth_mm || !summary.image_distance_mm || !summary.blur_ratio) {
      errors.refusals.push_back(summary.reason);
      return;
    }
    const model::SweepTruth& truth = simulated.truth;
    errors.focus_depth_mm.push_back(summary.focus_depth_mm->value - truth.focus_depth_mm);
    errors.image_distance_mm.push_back(summary.image_distance_mm->value - truth.image_distance_mm);
    errors.blur_ratio.push_back(summary.blur_ratio->value - truth.blur_ratio);
  });
  return errors;
}

inline double StandardDeviation(const std::vector<double>& sample) {
  double mean = 0, squares = 0;
  const auto count = static_cast<double>(sample.size());
  for (const double value : sample) mean += value / count;
  for (const double value : sample) squares += (value - mean) * (value - mean);
  return std::sqrt(squares / (count - 1));
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_CALIB_CALIBRATE_PLANNED_SWEEP_H_
