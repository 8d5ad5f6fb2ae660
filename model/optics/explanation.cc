#include "thicklens/model/explanation.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "thicklens/model/thick_lens.h"

namespace thicklens::model {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kDepthOfFieldRadiiPx[] = {0.5, 1};

// r_defocus, mm on the sensor: [S25], [S26]; for a point at infinity their limit r (D - f2)/f2,
// from c(z) = f1 D/(f2 z) - (D - f2)/f2. D is measured from the rear principal plane.
double RadiusMm(const ThickLens& lens, double image_distance_mm, double depth_mm) {
  if (std::isfinite(depth_mm)) return BlurRadiusMm(lens, image_distance_mm, depth_mm);
  const double rear_distance_mm = image_distance_mm - lens.lens_thickness_mm;
  return lens.aperture_radius_mm * std::abs(rear_distance_mm / lens.rear_focal_length_mm - 1);
}

// |m| = f1 D/(f2 z); 0 at infinity.
double Magnification(const ThickLens& lens, double image_distance_mm, double depth_mm) {
  if (!std::isfinite(depth_mm)) return 0;
  return std::abs(ChiefRayMagnification(lens, image_distance_mm, depth_mm));
}

// Standard deviation of kappa r |c(z)|/p from those of kappa and d1: where c(z) is small, at focus,
// it is the plane of focus that counts. With the covariance of the two where the camera file has
// it.
double DefocusErrorPx(const Camera& camera, const Explanation& known, const DepthRow& row,
                      double depth_mm) {
  const double by_ratio_px = row.blur_radius_px;
  const double step_mm = 1e-6 * known.image_distance_mm;
  const double moved_mm = RadiusMm(camera.lens, known.image_distance_mm + step_mm, depth_mm);
  const double by_distance_px_per_mm =
      known.blur_ratio * (moved_mm - row.blur_radius_mm) / step_mm / camera.sensor.pixel_pitch_mm;
  double covariance = 0;
  const auto& order = camera.calibration->covariance_order;
  const auto distance = std::find(order.begin(), order.end(), "image_distance_mm");
  const auto ratio = std::find(order.begin(), order.end(), "blur_ratio");
  if (distance != order.end() && ratio != order.end())
    covariance = camera.calibration->covariance(distance - order.begin(), ratio - order.begin());
  const double variance = std::pow(by_ratio_px * known.blur_ratio_sigma, 2) +
                          std::pow(by_distance_px_per_mm * known.image_distance_sigma_mm, 2) +
                          2 * by_ratio_px * by_distance_px_per_mm * covariance;
  return std::sqrt(std::max(0.0, variance));
}

DepthRow RowAt(const Camera& camera, const Explanation& known, double depth_mm) {
  const double pitch_mm = camera.sensor.pixel_pitch_mm;
  const ThickLens thin = ThinLensEquivalent(camera.lens);
  DepthRow row;
  row.depth_mm = depth_mm;
  row.blur_radius_mm = RadiusMm(camera.lens, known.image_distance_mm, depth_mm);
  row.blur_radius_px = row.blur_radius_mm / pitch_mm;
  row.defocus_sigma_px = known.blur_ratio * row.blur_radius_px;
  row.defocus_sigma_error_px = DefocusErrorPx(camera, known, row, depth_mm);
  row.sigma_px = std::hypot(row.defocus_sigma_px, known.blur_floor_px.value_or(0));
  row.magnification = Magnification(camera.lens, known.image_distance_mm, depth_mm);
  row.thin_blur_radius_px = RadiusMm(thin, known.image_distance_mm, depth_mm) / pitch_mm;
  row.thin_magnification = Magnification(thin, known.image_distance_mm, depth_mm);
  return row;
}

double FarthestCornerPx(const Sensor& sensor) {
  const Eigen::Vector2d last_px(sensor.width_px - 1, sensor.height_px - 1);
  const Eigen::Vector2d& centre_px = sensor.principal_point_px;
  return centre_px.cwiseAbs().cwiseMax((last_px - centre_px).cwiseAbs()).norm();
}

// c(z) is f1 D/(f2 z) - (D - f2)/f2, of the thin lens d1/z - (d1 - f1)/f1, and both are 1 at z =
// f1: they part by |b| (1 - f1/z), b = D/f2 - d1/f1. Derived here [D8].
double ThinUpToMm(const Camera& camera, double image_distance_mm) {
  const ThickLens& lens = camera.lens;
  const double rear_distance_mm = image_distance_mm - lens.lens_thickness_mm;
  const double apart = std::abs(rear_distance_mm / lens.rear_focal_length_mm -
                                image_distance_mm / lens.front_focal_length_mm);
  const double limit = kThinTolerancePx * camera.sensor.pixel_pitch_mm / lens.aperture_radius_mm;
  return apart <= limit ? kInfinity : lens.front_focal_length_mm / (1 - limit / apart);
}

// The thin lens's magnification at the same d1 is d1/z, the thick one's f1 D/(f2 z): their ratio is
// the same at every depth.
ThinComparison CompareWithThin(const Camera& camera, double image_distance_mm) {
  const ThickLens& lens = camera.lens;
  const ThickLens thin = ThinLensEquivalent(lens);
  ThinComparison comparison;
  comparison.same_lens =
      lens.front_focal_length_mm == lens.rear_focal_length_mm && lens.lens_thickness_mm == 0;
  if (image_distance_mm >= thin.rear_focal_length_mm)
    comparison.focus_depth_mm = FocusDepthMm(thin, image_distance_mm);
  comparison.scale_ratio = ChiefRayMagnification(thin, image_distance_mm, 1) /
                           ChiefRayMagnification(lens, image_distance_mm, 1);
  comparison.alike_up_to_mm = ThinUpToMm(camera, image_distance_mm);
  comparison.corner_shift_px = (comparison.scale_ratio - 1) * FarthestCornerPx(camera.sensor);
  return comparison;
}

}  // namespace

std::vector<double> InverselySpacedDepthsMm(const DepthRange& range, int count) {
  std::vector<double> depths;
  for (int i = 0; i < count; ++i) {
    const double t = static_cast<double>(i) / (count - 1);
    depths.push_back(1 / ((1 - t) / range.near_mm + t / range.far_mm));
  }
  // Rounding shall not move the ends, nor make infinity of them or out of it.
  depths.front() = range.near_mm;
  depths.back() = range.far_mm;
  return depths;
}

Explanation ExplainCamera(const Camera& camera, const DepthRange& range, int count) {
  Explanation known;
  known.camera_name = camera.name;
  known.image_distance_mm = camera.image_distance_mm();
  known.front_focal_length_mm = camera.lens.front_focal_length_mm;
  known.blur_ratio = camera.blur_ratio();
  known.image_distance_sigma_mm = camera.calibration->image_distance_mm->sigma;
  known.blur_ratio_sigma = camera.calibration->blur_ratio->sigma;
  known.focus_depth_mm = camera.focus_depth_mm();
  if (camera.calibration->blur_floor_px)
    known.blur_floor_px = camera.calibration->blur_floor_px->value;
  for (const double depth_mm : InverselySpacedDepthsMm(range, count))
    known.rows.push_back(RowAt(camera, known, depth_mm));
  for (const double radius_px : kDepthOfFieldRadiiPx) {
    const DepthOfField field = DepthOfFieldMm(camera.lens, known.image_distance_mm,
                                              radius_px * camera.sensor.pixel_pitch_mm);
    known.depth_of_field.push_back({radius_px, field.near_mm, field.far_mm});
  }
  known.distortion = camera.distortion;
  known.thin = CompareWithThin(camera, known.image_distance_mm);
  // The hyperfocal depth follows from r f1/(zf - f1) = 1 px, the limit of r K |1/z - 1/zf| for z to
  // infinity.
  known.hyperfocal_mm = camera.lens.front_focal_length_mm *
                        (1 + camera.lens.aperture_radius_mm / camera.sensor.pixel_pitch_mm);
  // The aperture's image lies in the rear principal plane, of the aperture's own size.
  known.working_f_number = (known.image_distance_mm - camera.lens.lens_thickness_mm) /
                           (2 * camera.lens.aperture_radius_mm);
  return known;
}

}  // namespace thicklens::model
