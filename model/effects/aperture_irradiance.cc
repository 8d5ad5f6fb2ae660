#include "model/effects/aperture_irradiance.h"

#include <cmath>

#include "model/optics/ray_irradiance.h"
#include "thicklens/base/pi.h"

namespace thicklens::model {

Aperture ApertureOf(const EffectOptics& optics, const EffectSet& effects) {
  if (!effects.Has(Effect::kDefocus)) return Aperture::kPinhole;
  return optics.is_disc() && effects.Has(Effect::kApertureShape) ? Aperture::kDisc
                                                                 : Aperture::kGaussian;
}

const std::vector<AperturePoint>& AperturePoints(Aperture aperture) {
  static const std::vector<AperturePoint> pinhole = {{0, 0, 1}};
  // Gauss-Hermite rule of three nodes on each axis.
  static const std::vector<AperturePoint> gaussian = [] {
    std::vector<AperturePoint> points;
    const double at[] = {-std::sqrt(3.0), 0, std::sqrt(3.0)},
                 weight[] = {1.0 / 6, 2.0 / 3, 1.0 / 6};
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) points.push_back({at[i], at[j], weight[i] * weight[j]});
    }
    return points;
  }();
  // Abramowitz and Stegun 25.4.61, seven points of a disc of radius 2.
  static const std::vector<AperturePoint> disc = [] {
    std::vector<AperturePoint> points = {{0, 0, 0.25}};
    const double radius = 2 * std::sqrt(2.0 / 3);
    for (int i = 0; i < 6; ++i) {
      points.push_back({radius * std::cos(kPi * i / 3), radius * std::sin(kPi * i / 3), 0.125});
    }
    return points;
  }();
  return aperture == Aperture::kPinhole ? pinhole : aperture == Aperture::kDisc ? disc : gaussian;
}

Irradiance IrradianceAt(const EffectOptics& optics, const Eigen::Vector2d& position_px,
                        double image_distance_mm, Aperture aperture) {
  const Sensor& sensor = optics.camera().sensor;
  const auto values_at = [&](const Eigen::Vector2d& from_axis_px) {
    std::vector<double> values;
    for (const AperturePoint& point : AperturePoints(aperture)) {
      const Eigen::Vector2d aperture_mm =
          optics.aperture_sigma_mm() * Eigen::Vector2d(point.x, point.y);
      values.push_back(
          RayIrradiance(from_axis_px / optics.scale_px() - aperture_mm * optics.inverse_focus(),
                        sensor.pixel_pitch_mm * from_axis_px, aperture_mm, image_distance_mm));
    }
    return values;
  };
  const auto mean_of = [&](const std::vector<double>& values) {
    double sum = 0;
    for (std::size_t i = 0; i < values.size(); ++i)
      sum += AperturePoints(aperture)[i].weight * values[i];
    return sum;
  };
  Irradiance irradiance;
  irradiance.over_mean = values_at(position_px - sensor.principal_point_px);
  const std::vector<double> on_axis = values_at({0, 0});
  for (std::size_t i = 0; i < on_axis.size(); ++i) irradiance.over_mean[i] /= on_axis[i];
  irradiance.mean = mean_of(irradiance.over_mean);
  for (double& value : irradiance.over_mean) value /= irradiance.mean;
  return irradiance;
}

}  // namespace thicklens::model
