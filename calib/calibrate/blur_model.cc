#include "thicklens/calib/blur_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "thicklens/model/thick_lens.h"

namespace thicklens::calib {

bool IsDepth(double depth_mm) { return std::isfinite(depth_mm) && depth_mm > 0; }

bool HasBlur(const FrameMeasurement& frame) { return frame.blur_sigma_error_px > 0; }

namespace {

// Returns whether a sensor at this distance can have an object in focus.
bool IsImageDistance(const FocusSweep& sweep, double image_distance_mm) {
  const model::ThickLens& lens = sweep.camera.lens;
  return image_distance_mm - lens.lens_thickness_mm >= lens.rear_focal_length_mm;
}

}  // namespace

std::optional<BlurModel> BlurModel::Of(const FocusSweep& sweep, const Calibration& calibration) {
  if (!calibration.diagnostics.blur.done || !calibration.summary.image_distance_mm ||
      !calibration.summary.blur_ratio)
    return std::nullopt;
  const double image_distance_mm = calibration.summary.image_distance_mm->value;
  if (!std::isfinite(calibration.summary.blur_ratio->value) ||
      !IsImageDistance(sweep, image_distance_mm))
    return std::nullopt;
  BlurModel blur(sweep, image_distance_mm);
  blur.kappa_ = calibration.summary.blur_ratio->value;
  blur.TakeFloor(calibration);
  blur.TakeCovariance(calibration);
  return blur;
}

std::optional<BlurModel> BlurModel::OfSide(const FocusSweep& sweep, const Calibration& calibration,
                                           const SideFit& side) {
  const model::ThickLens& lens = sweep.camera.lens;
  if (!side.done || !(side.focus_depth_mm.value > lens.front_focal_length_mm) ||
      !std::isfinite(side.blur_ratio.value))
    return std::nullopt;
  BlurModel blur(sweep, model::ImageDistanceMm(lens, side.focus_depth_mm.value));
  blur.kappa_ = side.blur_ratio.value;
  if (!IsImageDistance(sweep, blur.image_distance_mm_)) return std::nullopt;
  blur.TakeFloor(calibration);
  return blur;
}

BlurModel BlurModel::OfTruth(const FocusSweep& sweep, const model::SweepTruth& truth) {
  BlurModel blur(sweep, truth.image_distance_mm);
  blur.floor_squared_px2_ = truth.blur_floor_px * truth.blur_floor_px;
  // The blur of the frames shows whether defocus was simulated.
  double product = 0, square = 0;
  for (const model::SweepTruth::Frame& frame : truth.frames) {
    if (!IsDepth(frame.depth_mm)) continue;
    const double defocus_px2 = std::pow(blur.SignedDefocusPx(frame.depth_mm), 2);
    product += defocus_px2 * (frame.blur_sigma_px * frame.blur_sigma_px - blur.floor_squared_px2_);
    square += defocus_px2 * defocus_px2;
  }
  blur.kappa_ = square > 0 ? std::sqrt(std::max(0.0, product / square)) : truth.blur_ratio;
  return blur;
}

double BlurModel::SigmaPx(double depth_mm) const {
  return std::sqrt(floor_squared_px2_ + kappa_ * kappa_ * std::pow(SignedDefocusPx(depth_mm), 2));
}

// The signed defocus is q = r c(z)/p with c(z) = [f1 D - (D - f2) z]/(f2 z), and sigma^2 = S0 +
// (kappa q)^2. Therefore d sigma/d z = kappa^2 q dq/dz / sigma with dc/dz = -f1 D/(f2 z^2) (derived
// here, [D88]).
double BlurModel::SlopePxPerMm(double depth_mm) const {
  const model::ThickLens& lens = sweep_->camera.lens;
  const double sigma_px = SigmaPx(depth_mm);
  if (!(sigma_px > 0)) return 0;
  const double slope_per_mm = -lens.front_focal_length_mm *
                              (image_distance_mm_ - lens.lens_thickness_mm) /
                              (lens.rear_focal_length_mm * depth_mm * depth_mm);
  return kappa_ * kappa_ * SignedDefocusPx(depth_mm) * slope_per_mm * lens.aperture_radius_mm /
         sweep_->camera.sensor.pixel_pitch_mm / sigma_px;
}

// Derivatives of sigma, in addition to the one along z, through which the offset acts (derived
// here, [D88]): kappa q^2/sigma by kappa, floor/sigma by the floor, and kappa^2 q dq/dD / sigma by
// d1, with dc/dD = (f1 - z)/(f2 z).
std::optional<double> BlurModel::SigmaErrorPx(double depth_mm) const {
  const double sigma_px = SigmaPx(depth_mm);
  if (!covariance_ || !(sigma_px > 0)) return std::nullopt;
  const model::ThickLens& lens = sweep_->camera.lens;
  const double q_px = SignedDefocusPx(depth_mm);
  const double q_by_d1 = (lens.front_focal_length_mm - depth_mm) /
                         (lens.rear_focal_length_mm * depth_mm) * lens.aperture_radius_mm /
                         sweep_->camera.sensor.pixel_pitch_mm;
  const Eigen::Vector4d gradient(kappa_ * kappa_ * q_px * q_by_d1 / sigma_px,
                                 kappa_ * q_px * q_px / sigma_px,
                                 std::sqrt(floor_squared_px2_) / sigma_px, SlopePxPerMm(depth_mm));
  const double variance_px2 = gradient.dot(*covariance_ * gradient);
  if (!std::isfinite(variance_px2)) return std::nullopt;
  return std::sqrt(std::max(0.0, variance_px2));
}

std::optional<double> BlurModel::ResidualSigmas(const FrameMeasurement& frame) const {
  if (!HasBlur(frame) || !frame.in_blur_fit || !frame.rejection.empty() || !IsDepth(frame.depth_mm))
    return std::nullopt;
  const double sd_px =
      std::hypot(frame.blur_sigma_error_px,
                 SlopePxPerMm(frame.depth_mm) * frame.depth_per_reading * sweep_->reading_sigma_mm);
  return (frame.blur_sigma_px - SigmaPx(frame.depth_mm)) / sd_px;
}

void BlurModel::TakeFloor(const Calibration& calibration) {
  if (calibration.summary.blur_floor_px &&
      std::isfinite(calibration.summary.blur_floor_px->value)) {
    floor_squared_px2_ = std::pow(calibration.summary.blur_floor_px->value, 2) +
                         std::pow(calibration.diagnostics.blur.astigmatic_blur_px, 2);
    return;
  }
  floor_squared_px2_ = FloorSquaredFromFrames(calibration);
  floor_from_frames_ = true;
}

void BlurModel::TakeCovariance(const Calibration& calibration) {
  // Where the lens or the sensor moves, the errors of d1 and of the depths of the frames cancel.
  if (model::MovesFocus(calibration.diagnostics.moves)) return;
  const auto count = static_cast<Eigen::Index>(calibration.diagnostics.covariance_order.size());
  if (count == 0 || calibration.diagnostics.covariance.rows() != count ||
      calibration.diagnostics.covariance.cols() != count)
    return;
  const std::array<const char*, 4> names = {"image_distance_mm", "blur_ratio", "blur_floor_px",
                                            "bench_offset_mm"};
  std::array<Eigen::Index, 4> at{};
  for (std::size_t i = 0; i < names.size(); ++i)
    at[i] = std::find(calibration.diagnostics.covariance_order.begin(),
                      calibration.diagnostics.covariance_order.end(), names[i]) -
            calibration.diagnostics.covariance_order.begin();
  if (at[0] == count || at[1] == count) return;
  covariance_ = Eigen::Matrix4d::Zero();
  for (std::size_t i = 0; i < names.size(); ++i)
    for (std::size_t j = 0; j < names.size(); ++j)
      if (at[i] < count && at[j] < count)
        (*covariance_)(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
            calibration.diagnostics.covariance(at[i], at[j]);
}

double BlurModel::SignedDefocusPx(double depth_mm) const {
  return sweep_->camera.lens.aperture_radius_mm *
         model::DefocusPerAperture(sweep_->camera.lens, image_distance_mm_, depth_mm) /
         sweep_->camera.sensor.pixel_pitch_mm;
}

// Weighted mean of sigma^2 - (kappa r_defocus/p)^2: the floor that best continues the fit if the
// fit has none of its own. var(sigma^2) = (2 sigma)^2 var(sigma).
double BlurModel::FloorSquaredFromFrames(const Calibration& calibration) const {
  double sum = 0, weight_sum = 0;
  for (const FrameMeasurement& frame : calibration.frames) {
    if (!frame.in_blur_fit || !IsDepth(frame.depth_mm) || !HasBlur(frame) ||
        !(frame.blur_sigma_px > 0))
      continue;
    const double sd_px2 = 2 * frame.blur_sigma_px * frame.blur_sigma_error_px;
    const double weight = frame.blur_fit_weight / (sd_px2 * sd_px2);
    sum += weight * (std::pow(frame.blur_sigma_px, 2) -
                     kappa_ * kappa_ * std::pow(SignedDefocusPx(frame.depth_mm), 2));
    weight_sum += weight;
  }
  return weight_sum > 0 ? std::max(0.0, sum / weight_sum) : 0;
}

}  // namespace thicklens::calib
