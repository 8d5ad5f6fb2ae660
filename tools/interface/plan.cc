#include "thicklens/plan.h"

#include <fmt/format.h>

#include <string>

#include "thicklens/base/yaml_reader.h"
#include "tools/interface/run_scope.h"
#include "tools/interface/validation.h"

namespace thicklens {
namespace {

// The reasons of the calibration begin with the field: "frames is 3: it must be ..".
template <typename Options>
void RequireValidPlan(const Options& options) {
  std::string why;
  if (options.IsValid(&why)) return;
  throw OptionError(why.substr(0, why.find(' ')), why);
}

// Electrons at full scale for noise that is stated as a part of it: so many that their own shot
// noise does not count.
constexpr double kNoShotNoise = 1e9;

}  // namespace

ExpectedSweep PredictSweep(const PlanConditions& conditions, const SweepDesign& design,
                           const RunControl& run) {
  checks::RequireValid(run);
  checks::RequireValidCamera(conditions.camera);
  RequireValidPlan(conditions);
  const RunScope scope(run);
  return calib::ExpectSweep(conditions, design);
}

SweepPlan ProposeSweep(const PlanConditions& conditions, const PlanWishes& wishes,
                       const RunControl& run) {
  checks::RequireValid(run);
  checks::RequireValidCamera(conditions.camera);
  RequireValidPlan(conditions);
  RequireValidPlan(wishes);
  const RunScope scope(run);
  return calib::PlanSweep(conditions, wishes);
}

SweepSimulation PlannedSimulation(const PlanConditions& conditions, const SweepDesign& design) {
  SweepSimulation simulation;
  simulation.camera = conditions.camera;
  simulation.camera.distortion.reset();  // its frames are undistorted before they are measured
  model::CameraCalibration truth;
  truth.image_distance_mm =
      Measured{model::ImageDistanceMm(conditions.camera.lens, conditions.focus_depth_mm), 0};
  truth.blur_ratio = Measured{conditions.blur_ratio, 0};
  truth.blur_floor_px = Measured{conditions.blur_floor_px, 0};
  truth.evidence.method = "assumed";
  simulation.camera.calibration = truth;
  simulation.target.kind = conditions.texture;
  simulation.target.contrast = conditions.contrast;
  simulation.target.feature_size_mm = design.feature_size_mm;
  simulation.first_depth_mm = design.nearest_mm;
  simulation.step_mm = design.step_mm;
  simulation.frame_count = design.frames;
  simulation.reading_sigma_mm = conditions.reading_sigma_mm;
  simulation.light_level = conditions.light_level;
  simulation.lamp_falloff = conditions.lamp_falloff;
  simulation.full_well_electrons = conditions.full_well_electrons;
  simulation.read_noise_electrons =
      conditions.full_well_electrons > 0 ? conditions.read_noise_electrons : 0;
  if (conditions.noise_sigma) {
    simulation.full_well_electrons = kNoShotNoise;
    simulation.read_noise_electrons = *conditions.noise_sigma * kNoShotNoise;
  }
  simulation.bits = conditions.bits;
  return simulation;
}

std::string PlannedSimulationYaml(const PlanConditions& conditions, const SweepDesign& design,
                                  const std::string& camera_path) {
  const SweepSimulation simulation = PlannedSimulation(conditions, design);
  const model::Sensor& sensor = conditions.camera.sensor;
  const auto number = [](double value) { return YamlNumber(value); };
  std::string quoted;  // a quote within single quotes is doubled
  for (const char c : camera_path) quoted += c == '\'' ? std::string("''") : std::string(1, c);
  return fmt::format(
      "# A planned sweep: {} frames from {:.6g} to {:.6g} mm.\n"
      "#   thicklens simulate sweep THIS_FILE -o DIR\n"
      "schema: thicklens/simulate-sweep/1\n"
      "camera: '{}'\n"
      "size_px: [{}, {}]\n"
      "truth: {{focus_depth_mm: {}, blur_ratio: {}, blur_floor_px: {}}}\n"
      "target: {{kind: {}, contrast: {}, feature_size_mm: {}}}\n"
      "bench: {{first_depth_mm: {}, step_mm: {}, frames: {}, reading_sigma_mm: {}}}\n"
      "light: {{level: {}, lamp_falloff: {}}}\n"
      "noise: {{full_well_electrons: {}, read_noise_electrons: {}}}\n"
      "bits: {}\n"
      "seed: 1\n",
      design.frames, design.nearest_mm, design.farthest_mm(), quoted, sensor.width_px,
      sensor.height_px, number(conditions.focus_depth_mm), number(conditions.blur_ratio),
      number(conditions.blur_floor_px), model::TargetKindName(conditions.texture),
      number(conditions.contrast), number(design.feature_size_mm), number(design.nearest_mm),
      number(design.step_mm), design.frames, number(conditions.reading_sigma_mm),
      number(conditions.light_level), conditions.lamp_falloff,
      number(simulation.full_well_electrons), number(simulation.read_noise_electrons),
      conditions.bits);
}

std::string PlannedReadingsCsv(const SweepDesign& design) {
  std::string text = "image,reading_mm\n";
  for (int i = 0; i < design.frames; ++i) {
    text += fmt::format("frame_{:03d}.png,{:.10g}\n", i, design.nearest_mm + i * design.step_mm);
  }
  return text;
}

}  // namespace thicklens
