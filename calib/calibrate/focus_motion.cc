#include "calib/calibrate/focus_motion.h"

#include <cmath>

#include "thicklens/model/thick_lens.h"

namespace thicklens::calib {

double SensorDistanceOf(const model::ThickLens& lens, double focus_depth_mm) {
  return model::ImageDistanceMm(lens, focus_depth_mm) - lens.lens_thickness_mm;
}

FocusMotion::FocusMotion(const FocusSweep& sweep, model::SweepMotion moves,
                         double sensor_distance_mm, double focus_reading_mm)
    : lens_(sweep.camera.lens),
      moves_(moves),
      are_focus_distances_(sweep.readings_are_focus_distances),
      sign_(are_focus_distances_ ? 1 : model::DirectionSign(sweep.direction)),
      focus_reading_mm_(focus_reading_mm) {
  xf_mm_ = are_focus_distances_ ? SensorDistanceOf(lens_, focus_reading_mm) : sensor_distance_mm;
  zf_mm_ = model::FocusDepthMm(lens_, xf_mm_ + lens_.lens_thickness_mm);
  const bool lens_moves = moves_ == model::SweepMotion::kLens;
  const double part = xf_mm_ / zf_mm_;
  // dc/dD = -(1 - (f1/f2) (xf/zf)^2)/xf for the lens, -1/xf for the sensor.
  if (lens_moves) g_ = 1 - lens_.front_focal_length_mm / lens_.rear_focal_length_mm * part * part;
  u_mm_ = lens_moves ? xf_mm_ / (1 + part) : xf_mm_;
  a_ = g_ * u_mm_ / xf_mm_;
}

double FocusMotion::SensorDistanceMm(double reading_mm) const {
  return are_focus_distances_ ? SensorDistanceOf(lens_, reading_mm)
                              : xf_mm_ + sign_ * (reading_mm - focus_reading_mm_);
}

double FocusMotion::ReadingOfSensorDistance(double sensor_distance_mm) const {
  return are_focus_distances_
             ? model::FocusDepthMm(lens_, sensor_distance_mm + lens_.lens_thickness_mm)
             : focus_reading_mm_ + sign_ * (sensor_distance_mm - xf_mm_);
}

double FocusMotion::DefocusAt(double sensor_distance_mm) const {
  const double depth_mm =
      zf_mm_ - (moves_ == model::SweepMotion::kLens ? sensor_distance_mm - xf_mm_ : 0);
  return model::DefocusPerAperture(lens_, sensor_distance_mm + lens_.lens_thickness_mm, depth_mm);
}

std::optional<double> FocusMotion::DefocusPerAperture(double reading_mm) const {
  const double distance_mm = SensorDistanceMm(reading_mm);
  const double depth_mm = zf_mm_ - (moves_ == model::SweepMotion::kLens ? distance_mm - xf_mm_ : 0);
  if (!(distance_mm > 0) || !(depth_mm > 0)) return std::nullopt;
  return DefocusAt(distance_mm);
}

double FocusMotion::BlurGrowth() const {
  const double per_distance = std::abs(g_) / xf_mm_;
  if (!are_focus_distances_) return per_distance;
  // D = f2 z/(z - f1) of the focus distance z.
  return per_distance * std::abs(model::ImageDistanceSlope(lens_, zf_mm_));
}

std::optional<double> FocusMotion::EquivalentDepthMm(double reading_mm) const {
  const double distance_mm = SensorDistanceMm(reading_mm);
  const double depth_mm = zf_mm_ - (moves_ == model::SweepMotion::kLens ? distance_mm - xf_mm_ : 0);
  if (!(distance_mm > 0) || !(depth_mm > 0)) return std::nullopt;
  const double inverse = 1 - DefocusAt(distance_mm) / a_;
  if (!(inverse > 0) || !std::isfinite(inverse)) return std::nullopt;
  return u_mm_ / inverse;
}

// Newton's method on c(D) = A (1 - u/z'), whose start is exact if the sensor moves.
std::optional<double> FocusMotion::ReadingAt(double equivalent_depth_mm) const {
  if (!(equivalent_depth_mm > 0)) return std::nullopt;
  const double wanted = a_ * (1 - u_mm_ / equivalent_depth_mm);
  double distance_mm = xf_mm_ - wanted * xf_mm_ / g_;
  constexpr int kMaxSteps = 30;
  constexpr double kSlopeStep = 1e-6, kConverged = 1e-13;
  for (int step = 0; step < kMaxSteps; ++step) {
    const double depth_mm =
        zf_mm_ - (moves_ == model::SweepMotion::kLens ? distance_mm - xf_mm_ : 0);
    if (!(distance_mm > 0) || !(depth_mm > 0)) return std::nullopt;
    const double h_mm = kSlopeStep * distance_mm;
    const double slope =
        (DefocusAt(distance_mm + h_mm) - DefocusAt(distance_mm - h_mm)) / (2 * h_mm);
    const double move_mm = (wanted - DefocusAt(distance_mm)) / slope;
    if (!std::isfinite(move_mm)) return std::nullopt;
    distance_mm += move_mm;
    if (std::abs(move_mm) < kConverged * xf_mm_) break;
  }
  if (are_focus_distances_ && !(distance_mm > lens_.rear_focal_length_mm)) return std::nullopt;
  return ReadingOfSensorDistance(distance_mm);
}

double FocusMotion::EquivalentCentreMm(double centre_of_perspective_mm) const {
  // The centre is mu K/(1 + mu K/zf), K the defocus scale.
  const double shift_mm = centre_of_perspective_mm / (1 - centre_of_perspective_mm / zf_mm_);
  const double mu = shift_mm / model::DefocusScaleMm(lens_, xf_mm_ + lens_.lens_thickness_mm);
  return -a_ * mu * u_mm_ / (1 - a_ * mu);
}

model::ThickLens FocusMotion::EquivalentLens() const {
  const double m = std::abs(a_);
  const double f_mm = u_mm_ * m / (1 + m);
  return {f_mm, f_mm, 0, lens_.aperture_radius_mm};
}

}  // namespace thicklens::calib
