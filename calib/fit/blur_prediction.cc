#include "calib/fit/blur_prediction.h"

namespace thicklens::calib {
namespace {

// R is the radius of the blur on the sensor, px, with its sign (positive nearer than focus; for a
// telecentric pupil farther) and its derivatives, [S25], [S26] with K = f1 zf/(zf - f1):
//   perspective: R = (r/p) K (1/z - 1/zf);  telecentric: R = (r/p) K (z - zf)/zf^2.
// The derivatives are derived here [D72]. Valid for zf > f1, z > 0; R is 0 at z = zf.
struct Radius {
  double value = 0, by_focus = 0, by_depth = 0, by_depth_twice = 0;
};

Radius RadiusPx(const BlurFitSetup& setup, double zf, double z) {
  const double f1 = setup.lens.front_focal_length_mm;
  const double a = setup.lens.aperture_radius_mm / setup.pixel_pitch_mm;
  const double beyond = zf - f1;
  const double k = f1 * zf / beyond;
  if (setup.law == BlurModel::kPerspective) {
    return {a * k * (1 / z - 1 / zf), a * f1 * (1 - f1 / z) / (beyond * beyond), -a * k / (z * z),
            2 * a * k / (z * z * z)};
  }
  const double by_focus =
      -a * f1 * (zf * beyond + (z - zf) * (2 * zf - f1)) / (zf * zf * beyond * beyond);
  return {a * k * ((z - zf) / (zf * zf)), by_focus, a * k / (zf * zf), 0};
}

// The variance that astigmatism adds, E = ((r/p) K w)^2 with w half of the difference of 1/zf along
// x and along y [D137], and its derivative by zf. dK/dzf = -f1^2/(zf - f1)^2.
struct Minimum {
  double value = 0, by_focus = 0;
};

Minimum AstigmaticMinimum(const BlurFitSetup& setup, double zf) {
  const double f1 = setup.lens.front_focal_length_mm;
  const double beyond = zf - f1;
  const double k = f1 * zf / beyond;
  const double size =
      setup.lens.aperture_radius_mm / setup.pixel_pitch_mm * setup.half_astigmatism_per_mm;
  return {size * size * k * k, -2 * size * size * k * f1 * f1 / (beyond * beyond)};
}

}  // namespace

double AstigmaticVariance(const BlurFitSetup& setup, double focus_depth_mm) {
  return AstigmaticMinimum(setup, focus_depth_mm).value;
}

double DefocusVariance(const BlurFitSetup& setup, double focus_depth_mm, double depth_mm) {
  const double radius_px = RadiusPx(setup, focus_depth_mm, depth_mm).value;
  return radius_px * radius_px;
}

double FittedDefocusVariance(const BlurFitSetup& setup, const BlurFitResult& fit, double depth_mm) {
  const double kappa = fit.values[kBlurRatio];
  return kappa * kappa * DefocusVariance(setup, fit.values[kFocusDepth], depth_mm);
}

BlurPrediction PredictBlur(const BlurFitSetup& setup, const Eigen::Vector4d& global,
                           double depth_mm, double scale) {
  const Radius r = RadiusPx(setup, global[kFocusDepth], depth_mm);
  const double s2 = 1 / (scale * scale);
  const double kappa = global[kBlurRatio];
  const double kappa2 = kappa * kappa;
  const Minimum least = AstigmaticMinimum(setup, global[kFocusDepth]);
  BlurPrediction p;
  p.value = s2 * (global[kFloorVariance] + kappa2 * (r.value * r.value + least.value));
  p.by_depth = s2 * kappa2 * 2 * r.value * r.by_depth;
  p.by_depth_twice = s2 * kappa2 * 2 * (r.by_depth * r.by_depth + r.value * r.by_depth_twice);
  p.by_global[kFocusDepth] = s2 * kappa2 * (2 * r.value * r.by_focus + least.by_focus);
  p.by_global[kBlurRatio] = s2 * 2 * kappa * (r.value * r.value + least.value);
  p.by_global[kFloorVariance] = s2;
  p.by_global[kBenchOffset] = p.by_depth;
  return p;
}

}  // namespace thicklens::calib
