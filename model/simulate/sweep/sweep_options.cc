// Valid options of a simulated sweep.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "model/simulate/simulated_camera.h"
#include "model/simulate/sweep/tilted_target.h"
#include "thicklens/base/error.h"
#include "thicklens/base/pi.h"
#include "thicklens/base/validity.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::model {
namespace {

bool IsValidTarget(const TargetOptions& target, std::string* why) {
  std::string inner;
  if (target.kind == TargetKind::kGrid && !target.grid)
    return Fail(why, "target.grid is missing: it is needed for the kind 'grid'");
  if (target.grid && !target.grid->IsValid(&inner)) return Fail(why, "target.grid: " + inner);
  if (!(target.contrast > 0 && target.contrast <= 1)) {
    return Fail(why, fmt::format("target.contrast is {}: it must be above 0 and at most 1",
                                 target.contrast));
  }
  if (!(target.feature_size_mm >= 0) || !std::isfinite(target.feature_size_mm)) {
    return Fail(
        why,
        fmt::format(
            "target.feature_size_mm is {}: it must be > 0, or 0 for a size chosen by the program",
            target.feature_size_mm));
  }
  if (!(std::abs(target.edge_angle_deg) <= 90)) {
    return Fail(why, fmt::format("target.edge_angle_deg is {}: it must be between -90 and 90",
                                 target.edge_angle_deg));
  }
  if (!(target.ink_sigma_mm >= 0) || !std::isfinite(target.ink_sigma_mm)) {
    return Fail(why,
                fmt::format("target.ink_sigma_mm is {}: it must be >= 0", target.ink_sigma_mm));
  }
  if (!(std::abs(target.tilt_deg) <= 80)) {
    return Fail(
        why, fmt::format("target.tilt_deg is {}: it must be between -80 and 80", target.tilt_deg));
  }
  if (!(target.spacing_mm >= 0) || !std::isfinite(target.spacing_mm)) {
    return Fail(why, fmt::format("target.spacing_mm is {}: it must be > 0, or 0 for one chosen by "
                                 "the program",
                                 target.spacing_mm));
  }
  return true;
}

bool IsValidPart(const ReliefPartOptions& part, double nearest_depth_mm, std::string* why) {
  if (!part.centre_mm.allFinite()) {
    return Fail(why, "target.relief: centre_mm must be two finite numbers");
  }
  if (!(part.size_mm.minCoeff() > 0) || !part.size_mm.allFinite()) {
    return Fail(why, fmt::format("target.relief: size_mm is [{}, {}]: both must be > 0",
                                 part.size_mm.x(), part.size_mm.y()));
  }
  if (part.shape != ReliefPartOptions::Shape::kRectangle && part.size_mm.x() != part.size_mm.y()) {
    return Fail(why, fmt::format("target.relief: size_mm of a disc or gear is [{}, {}]: both must "
                                 "be its diameter",
                                 part.size_mm.x(), part.size_mm.y()));
  }
  // A part that stands nearer than half of the target's depth is no relief but another object.
  if (!(part.height_mm > 0 && part.height_mm < 0.5 * nearest_depth_mm)) {
    return Fail(why,
                fmt::format("target.relief: height_mm is {}: it must be > 0 and less than half "
                            "of the nearest depth, {} mm",
                            part.height_mm, nearest_depth_mm));
  }
  return true;
}

// The blur of another outline is known for flat textures and one plane of focus.
bool IsValidAperture(const SweepSimulationOptions& options, std::string* why) {
  if (!options.aperture.IsValid(why)) return false;
  if (options.aperture.IsRound()) return true;
  const bool is_edge = options.target.kind == TargetKind::kPrintedEdge ||
                       options.target.kind == TargetKind::kKnifeEdge;
  if (options.camera.psf != Psf::kDisc)
    return Fail(why, "aperture.blades is stated: the camera must have psf: disc");
  if (options.pupil_law != PupilLaw::kUniform)
    return Fail(why, "aperture.blades is stated: pupil_law must be stated as uniform");
  if (is_edge || !options.target.relief.empty() || options.aberrations.DisplaceFocus()) {
    return Fail(why,
                "aperture.blades is stated: the target must be no edge and have no relief, and the "
                "lens neither field curvature nor astigmatism");
  }
  return true;
}

// Parts hide the target, but not one another.
bool IsValidRelief(const SweepSimulationOptions& options, std::string* why) {
  const std::vector<ReliefPartOptions>& parts = options.target.relief;
  if (parts.empty()) return true;
  const bool is_edge = options.target.kind == TargetKind::kPrintedEdge ||
                       options.target.kind == TargetKind::kKnifeEdge;
  if (is_edge || options.target.tilt_deg != 0 || options.aberrations.DisplaceFocus() ||
      options.aberrations.distortion != 0 || options.aberrations.axial_colour_mm) {
    return Fail(why,
                "target.relief is stated: the target must be no edge and have tilt_deg 0, and "
                "the lens no aberrations");
  }
  const double nearest_mm = std::min(options.DepthMm(0), options.DepthMm(options.FarthestFrame()));
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (!IsValidPart(parts[i], nearest_mm, why)) return false;
    for (std::size_t j = 0; j < i; ++j) {
      const Eigen::Vector2d apart_mm = (parts[i].centre_mm - parts[j].centre_mm).cwiseAbs();
      const Eigen::Vector2d reach_mm = 0.5 * (parts[i].size_mm + parts[j].size_mm);
      if (apart_mm.x() < reach_mm.x() && apart_mm.y() < reach_mm.y()) {
        return Fail(why, fmt::format("target.relief: parts {} and {} overlap: their rectangles "
                                     "must be apart",
                                     j + 1, i + 1));
      }
    }
  }
  return true;
}

// Every ray must meet the target, and not too far away.
bool IsWhollyVisible(const Camera& camera, double tilt_deg, std::string* why) {
  constexpr double kMinNearness = 0.2;
  const Sensor& sensor = camera.sensor;
  const double axis_px = sensor.principal_point_px.x();
  const TiltedTarget target(tilt_deg * kPi / 180, 1, camera.focal_scale_px());
  const double least =
      std::min(target.Nearness(-0.5 - axis_px), target.Nearness(sensor.width_px - 0.5 - axis_px));
  if (least >= kMinNearness) return true;
  return Fail(why,
              fmt::format("target.tilt_deg is {}: one side of the image would miss the target, or "
                          "see it at more than five times its depth: a tilt nearer to 0 is needed",
                          tilt_deg));
}

}  // namespace

std::string TargetKindName(TargetKind kind) {
  switch (kind) {
    case TargetKind::kDeadLeaves:
      return "dead-leaves";
    case TargetKind::kPinkNoise:
      return "pink-noise";
    case TargetKind::kWhiteNoise:
      return "white-noise";
    case TargetKind::kCheckerboard:
      return "checkerboard";
    case TargetKind::kSiemensStar:
      return "siemens-star";
    case TargetKind::kImage:
      return "image";
    case TargetKind::kGrid:
      return "grid";
    case TargetKind::kPrintedEdge:
      return "printed-edge";
    case TargetKind::kKnifeEdge:
      return "knife-edge";
    case TargetKind::kMesh:
      return "mesh";
    case TargetKind::kGroundGlass:
      return "ground-glass";
    case TargetKind::kPinholes:
      return "pinholes";
    case TargetKind::kBeads:
      return "beads";
  }
  throw Error("no such kind of target");
}

EffectSet SweepEffects() {
  return {
      Effect::kThickness,     Effect::kDefocus,       Effect::kApertureShape, Effect::kFalloff,
      Effect::kPixelBox,      Effect::kLensFloor,     Effect::kShotNoise,     Effect::kReadNoise,
      Effect::kQuantisation,  Effect::kTransferCurve, Effect::kLampFalloff,   Effect::kFlicker,
      Effect::kMagnification, Effect::kDrift,         Effect::kTilt,          Effect::kReadingError,
      Effect::kShading,       Effect::kDust,          Effect::kAberrations,   Effect::kDistortion,
      Effect::kBands,         Effect::kExposureDrift};
}

// [D146] The errors of a stage, each on top of the right reading.
double StageOptions::Written(double reading_mm, bool is_falling, int frame_index) const {
  double written_mm = (1 + lead_error) * reading_mm;
  if (screw_error_mm != 0) {
    written_mm += screw_error_mm *
                  std::sin(2 * kPi * reading_mm / screw_period_mm + screw_phase_deg * kPi / 180);
  }
  if (is_falling) written_mm += backlash_mm;
  if (frame_index >= slip_from_frame) written_mm += slip_mm;
  return resolution_mm > 0 ? resolution_mm * std::round(written_mm / resolution_mm) : written_mm;
}

int SweepSimulationOptions::StepsOf(int frame_index) const {
  return stage.there_and_back ? std::min(frame_index, frame_count - 1 - frame_index) : frame_index;
}

int SweepSimulationOptions::FarthestFrame() const {
  return stage.there_and_back ? (frame_count - 1) / 2 : frame_count - 1;
}

bool SweepSimulationOptions::IsFalling(int frame_index) const {
  // A frame at the turn that repeats the position is not approached anew.
  const int turn = FarthestFrame() + (stage.there_and_back && frame_count % 2 == 0 ? 1 : 0);
  const bool is_back = stage.there_and_back && frame_index > turn;
  return is_back != (DirectionSign(direction) * step_mm < 0);
}

double SweepSimulationOptions::ImageDistanceMm(int frame_index) const {
  return MovesFocus(moves) ? first_image_distance_mm + StepsOf(frame_index) * step_mm
                           : camera.image_distance_mm();
}

double SweepSimulationOptions::DepthMm(int frame_index) const {
  return MovesFocus(moves) ? DepthAt(ImageDistanceMm(frame_index))
                           : first_depth_mm + StepsOf(frame_index) * step_mm;
}

double SweepSimulationOptions::DepthAt(double image_distance_mm) const {
  return camera.focus_depth_mm() -
         (moves == SweepMotion::kLens ? image_distance_mm - camera.image_distance_mm() : 0);
}

bool SweepSimulationOptions::IsValid(std::string* why) const {
  if (!IsSimulatable(camera, why) || !IsValidTarget(target, why)) return false;
  if (!camera.calibration->blur_floor_px) {
    return Fail(
        why, fmt::format("camera '{}': blur_floor_px is missing: a simulation needs its true value",
                         camera.name));
  }
  if (!IsWhollyVisible(camera, target.tilt_deg, why)) return false;
  if (!(frame_count >= 1 && frame_count <= 100000)) {
    return Fail(why, fmt::format("bench.frames is {}: it must be from 1 to 100000", frame_count));
  }
  if (!(counts_per_mm >= 0) || !std::isfinite(counts_per_mm)) {
    return Fail(why, fmt::format("bench.counts_per_mm is {}: it must be finite and > 0, or absent "
                                 "for readings in mm",
                                 counts_per_mm));
  }
  if (counts_per_mm > 0 && !MovesFocus(moves)) {
    return Fail(why, fmt::format("bench.counts_per_mm is {}, but the {} moves: counts are those of "
                                 "a drive of the lens or the sensor (bench.moves)",
                                 counts_per_mm, SweepMotionName(moves)));
  }
  const auto possible = [](double length_mm) { return length_mm > 0 && std::isfinite(length_mm); };
  const double thickness_mm = camera.lens.lens_thickness_mm;
  const double first_mm = ImageDistanceMm(0), last_mm = ImageDistanceMm(FarthestFrame());
  if (!possible(first_mm - thickness_mm) || !possible(last_mm - thickness_mm)) {
    return Fail(why, fmt::format("bench: the image distances run from {} to {} mm: they must be "
                                 "finite and > {}",
                                 first_mm, last_mm, std::max(0.0, thickness_mm)));
  }
  if (!possible(DepthMm(0)) || !possible(DepthMm(FarthestFrame()))) {
    return Fail(why, fmt::format("bench: the depths run from {} to {} mm: they must be finite and "
                                 "> 0",
                                 DepthMm(0), DepthMm(FarthestFrame())));
  }
  if (!std::isfinite(bench_offset_mm)) {
    return Fail(why, fmt::format("bench.offset_mm is {}: it must be finite", bench_offset_mm));
  }
  const std::pair<const char*, double> amounts[] = {
      {"bench.reading_sigma_mm", reading_sigma_mm},
      {"bench.stage.resolution_mm", stage.resolution_mm},
      {"drift_sigma_px", drift_sigma_px},
      {"noise.full_well_electrons", full_well_electrons},
      {"noise.read_noise_electrons", read_noise_electrons}};
  for (const auto& [field, value] : amounts) {
    if (!(value >= 0) || !std::isfinite(value)) {
      return Fail(why, fmt::format("{} is {}: it must be finite and >= 0", field, value));
    }
  }
  for (const auto& [field, value] :
       {std::pair{"backlash_mm", stage.backlash_mm},
        std::pair{"screw_error_mm", stage.screw_error_mm},
        std::pair{"screw_phase_deg", stage.screw_phase_deg}, std::pair{"slip_mm", stage.slip_mm}}) {
    if (!std::isfinite(value))
      return Fail(why, fmt::format("bench.stage.{} is {}: it must be finite", field, value));
  }
  if (!(stage.screw_period_mm > 0) || !std::isfinite(stage.screw_period_mm)) {
    return Fail(why, fmt::format("bench.stage.screw_period_mm is {}: it must be finite and > 0",
                                 stage.screw_period_mm));
  }
  if (!(stage.slip_from_frame >= 0 && stage.slip_from_frame < frame_count)) {
    return Fail(why, fmt::format("bench.stage.slip_from_frame is {}: it must be from 0 to {}, the "
                                 "last frame",
                                 stage.slip_from_frame, frame_count - 1));
  }
  if (!(std::abs(stage.lead_error) <= 0.5)) {
    return Fail(why, fmt::format("bench.stage.lead_error is {}: it must be from -0.5 to 0.5",
                                 stage.lead_error));
  }
  if (read_noise_electrons > 0 && !(full_well_electrons > 0)) {
    return Fail(why, fmt::format("noise.read_noise_electrons is {}: noise in electrons needs "
                                 "noise.full_well_electrons > 0",
                                 read_noise_electrons));
  }
  if (!(light_level > 0 && light_level <= 1)) {
    return Fail(why,
                fmt::format("light.level is {}: it must be above 0 and at most 1", light_level));
  }
  if (!(flicker >= 0 && flicker <= 0.5)) {
    return Fail(why, fmt::format("light.flicker is {}: it must be from 0 to 0.5", flicker));
  }
  if (!(corner_stops >= -6 && corner_stops <= 2)) {
    return Fail(why, fmt::format("fixed_to_frame.corner_stops is {}: it must be from -6 to 2",
                                 corner_stops));
  }
  if (!(speck_count >= 0 && speck_count <= 10000)) {
    return Fail(
        why, fmt::format("fixed_to_frame.specks is {}: it must be from 0 to 10000", speck_count));
  }
  if (!(speck_depth >= 0 && speck_depth <= 1)) {
    return Fail(
        why, fmt::format("fixed_to_frame.speck_depth is {}: it must be from 0 to 1", speck_depth));
  }
  if (!(speck_radius_px >= 0.5 && speck_radius_px <= 1000)) {
    return Fail(why,
                fmt::format("fixed_to_frame.speck_radius_px is {}: it must be from 0.5 to 1000",
                            speck_radius_px));
  }
  if (!IsValidAperture(*this, why)) return false;
  if (!aberrations.IsValid(camera.lens, camera.focus_depth_mm(), why)) return false;
  if (!(band_amplitude >= 0 && band_amplitude <= 1)) {
    return Fail(why, fmt::format("bands.amplitude is {}: it must be from 0 to 1", band_amplitude));
  }
  if (!(band_period_px >= 2 && band_period_px <= 1e6)) {
    return Fail(why,
                fmt::format("bands.period_px is {}: it must be from 2 to 1e6", band_period_px));
  }
  if (!(std::abs(exposure_drift_stops) <= 10)) {
    return Fail(why, fmt::format("light.exposure_drift_stops is {}: it must be from -10 to 10",
                                 exposure_drift_stops));
  }
  if (!IsValidRelief(*this, why)) return false;
  if (bits != 8 && bits != 16) {
    return Fail(why, fmt::format("bits is {}: it must be 8 or 16", bits));
  }
  return true;
}

}  // namespace thicklens::model
