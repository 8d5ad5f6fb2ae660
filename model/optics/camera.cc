#include "thicklens/model/camera.h"

#include <fmt/format.h>

#include <cmath>

#include "thicklens/base/error.h"
#include "thicklens/base/validity.h"

namespace thicklens::model {
namespace {

// Reports everything that is missing at once, whichever a computation needs first.
[[noreturn]] void ThrowNotCalibrated(const Camera& camera) {
  const bool has_distance = camera.calibration && camera.calibration->image_distance_mm;
  const bool has_ratio = camera.calibration && camera.calibration->blur_ratio;
  const char* const missing = !has_distance && !has_ratio ? "image_distance_mm and blur_ratio are"
                              : has_ratio                 ? "image_distance_mm is"
                                                          : "blur_ratio is";
  throw Error(fmt::format(
      "{} is not calibrated yet: {} missing; run thicklens calibrate",
      camera.source.empty() ? fmt::format("camera '{}'", camera.name) : camera.source, missing));
}

// Whether the lens is that of the objective, up to the rounding of another way to compute it.
bool IsLensOf(const Objective& objective, const ThickLens& lens) {
  constexpr double kRounding = 1e-9;
  const ThickLens expected = LensOfObjective(objective);
  const auto same = [](double a, double b) { return std::abs(a - b) <= kRounding * b; };
  return same(lens.front_focal_length_mm, expected.front_focal_length_mm) &&
         same(lens.rear_focal_length_mm, expected.rear_focal_length_mm) &&
         std::abs(lens.lens_thickness_mm) <= kRounding * expected.front_focal_length_mm &&
         same(lens.aperture_radius_mm, expected.aperture_radius_mm);
}

}  // namespace

std::string PsfName(Psf psf) { return psf == Psf::kGaussian ? "gaussian" : "disc"; }

bool Sensor::IsValid(std::string* why) const {
  if (!(width_px > 0)) return Fail(why, fmt::format("width_px must be > 0, found {}", width_px));
  if (!(height_px > 0)) return Fail(why, fmt::format("height_px must be > 0, found {}", height_px));
  if (!(pixel_pitch_mm > 0) || !std::isfinite(pixel_pitch_mm)) {
    return Fail(why, fmt::format("pixel_pitch_mm must be > 0, found {}", pixel_pitch_mm));
  }
  if (!principal_point_px.allFinite()) {
    return Fail(why, fmt::format("principal_point_px must be finite, found ({}, {})",
                                 principal_point_px.x(), principal_point_px.y()));
  }
  return true;
}

bool Camera::IsValid(std::string* why) const {
  std::string inner;
  if (!lens.IsValid(&inner)) return Fail(why, "lens: " + inner);
  if (objective) {
    if (!objective->IsValid(&inner)) return Fail(why, "objective: " + inner);
    if (!IsLensOf(*objective, lens)) {
      return Fail(why, fmt::format("lens: it must be LensOfObjective of the objective, or the "
                                   "objective absent: front_focal_length_mm is {} and "
                                   "aperture_radius_mm {}, those of the objective are {} and {}",
                                   lens.front_focal_length_mm, lens.aperture_radius_mm,
                                   LensOfObjective(*objective).front_focal_length_mm,
                                   LensOfObjective(*objective).aperture_radius_mm));
    }
  }
  if (aperture_behind_front_mm && !std::isfinite(*aperture_behind_front_mm)) {
    return Fail(why, fmt::format("aperture_behind_front_mm must be finite, found {}",
                                 *aperture_behind_front_mm));
  }
  if (!sensor.IsValid(&inner)) return Fail(why, "sensor: " + inner);
  if (distortion) {
    if (!distortion->IsValid(&inner)) return Fail(why, "lens.distortion: " + inner);
    try {
      static_cast<void>(distortion->ScaledTo(sensor.width_px, sensor.height_px));
    } catch (const Error& error) {
      return Fail(why, std::string("lens.distortion: ") + error.what());
    }
  }
  if (!calibration) return true;
  const CameraCalibration& found = *calibration;
  const auto sigma_ok = [&](const std::optional<Estimate>& estimate, const char* field) {
    if (!estimate || (std::isfinite(estimate->value) && estimate->sigma >= 0)) return true;
    return Fail(why,
                fmt::format("calibration: {}: value must be finite and sigma >= 0, found {} +- {}",
                            field, estimate->value, estimate->sigma));
  };
  if (!sigma_ok(found.image_distance_mm, "image_distance_mm") ||
      !sigma_ok(found.blur_ratio, "blur_ratio") ||
      !sigma_ok(found.blur_floor_px, "blur_floor_px") ||
      !sigma_ok(found.bench_offset_mm, "bench_offset_mm")) {
    return false;
  }
  if (found.image_distance_mm) {
    const double nearest_mm = lens.lens_thickness_mm + lens.rear_focal_length_mm;
    if (!(found.image_distance_mm->value >= nearest_mm)) {
      return Fail(
          why, fmt::format("calibration: image_distance_mm must be >= lens_thickness_mm + "
                           "rear_focal_length_mm = {} (D >= f2: there the focus is at infinity), "
                           "found {}",
                           nearest_mm, found.image_distance_mm->value));
    }
  }
  if (found.blur_ratio && !(found.blur_ratio->value >= 0)) {
    return Fail(why, fmt::format("calibration: blur_ratio must be >= 0, found {}",
                                 found.blur_ratio->value));
  }
  if (found.blur_floor_px && !(found.blur_floor_px->value >= 0)) {
    return Fail(why, fmt::format("calibration: blur_floor_px must be >= 0, found {}",
                                 found.blur_floor_px->value));
  }
  return true;
}

double Camera::image_distance_mm() const {
  if (!calibration || !calibration->image_distance_mm) {
    ThrowNotCalibrated(*this);
  }
  return calibration->image_distance_mm->value;
}

double Camera::focus_depth_mm() const { return FocusDepthMm(lens, image_distance_mm()); }

double Camera::blur_ratio() const {
  if (!calibration || !calibration->blur_ratio) {
    ThrowNotCalibrated(*this);
  }
  return calibration->blur_ratio->value;
}

double Camera::focal_scale_px() const {
  return DefocusScaleMm(lens, image_distance_mm()) / sensor.pixel_pitch_mm;
}

std::vector<std::string> AssumedFields(const Camera& camera) {
  std::vector<std::string> fields;
  for (const auto& [field, statement] : camera.statements) {
    if (statement.assumed) fields.push_back(field);
  }
  if (camera.calibration && camera.calibration->evidence.method == "assumed")
    fields.emplace_back("calibration");
  return fields;
}

Camera ThinLensEquivalent(const Camera& camera) {
  // An objective stays: its lens is thin, and so is its own equivalent.
  Camera thin = camera;
  thin.lens = ThinLensEquivalent(camera.lens);
  thin.calibration->image_distance_mm->value =
      camera.focal_scale_px() * camera.sensor.pixel_pitch_mm;
  return thin;
}

}  // namespace thicklens::model
