#include "thicklens/model/light_field_grid.h"

#include <fmt/format.h>

#include <cmath>

#include "thicklens/base/error.h"
#include "thicklens/base/validity.h"

namespace thicklens::model {
namespace {

// Returns true if the crossings with the two planes determine a ray.
bool ArePlanesPossible(const LightFieldPlanes& planes, std::string* why) {
  if (!std::isfinite(planes.uv_depth_mm)) {
    return Fail(why, fmt::format("uv_depth_mm (zl) is {}: it must be finite", planes.uv_depth_mm));
  }
  if (!std::isfinite(planes.plane_spacing_mm) || planes.plane_spacing_mm == 0) {
    return Fail(why, fmt::format("plane_spacing_mm (d0) is {}: it must be finite and not 0",
                                 planes.plane_spacing_mm));
  }
  return true;
}

void CheckPlanes(const LightFieldPlanes& planes) {
  std::string why;
  if (!ArePlanesPossible(planes, &why)) throw Error("light-field planes: " + why);
}

double SquaredSlope(const LightFieldPlanes& planes, const Ray& ray) {
  const double u_slope = (ray.u_mm - ray.s_mm) / planes.plane_spacing_mm;
  const double v_slope = (ray.v_mm - ray.t_mm) / planes.plane_spacing_mm;
  return u_slope * u_slope + v_slope * v_slope;
}

// Weight of one sample of an axis, not normalised: exp(-(4 a/n)^2/2), so that n samples cover +-2
// standard deviations.
double GaussianWeight(double offset, int count) {
  const double deviations = 4 * offset / count;
  return std::exp(-deviations * deviations / 2);
}

bool IsInsideDisc(double u_offset, int u_count, double v_offset, int v_count) {
  const double a = u_offset / (u_count / 2.0);
  const double b = v_offset / (v_count / 2.0);
  return a * a + b * b <= 1;
}

// da = kappa r/sqrt(sum_k w_k a_k^2), mm; see ApertureSamples.
double StepMm(double sigma_mm, double second_moment) {
  return second_moment > 0 ? sigma_mm / std::sqrt(second_moment) : 0.0;
}

}  // namespace

// [S17]: P = [zl (D - f2) - f1 D]/(d0 f2). [S18]: Q = [(zl + d0)(D - f2) - f1 D]/(d0 f2). In terms
// of c(z): P = -zl c(zl)/d0, Q = -(zl + d0) c(zl + d0)/d0; hence Q = 0 if ST is the plane of focus.
// The products are computed as a whole, because c is infinite at zl = 0, where P is finite.
ProjectionCoefficients ProjectionOf(const ThickLens& lens, double image_distance_mm,
                                    const LightFieldPlanes& planes) {
  CheckPlanes(planes);
  const double extension_mm =
      image_distance_mm - lens.lens_thickness_mm - lens.rear_focal_length_mm;  // D - f2
  const double scale_mm = DefocusScaleMm(lens, image_distance_mm);             // f1 D/f2
  const double st_depth_mm = planes.uv_depth_mm + planes.plane_spacing_mm;
  const double slope = extension_mm / lens.rear_focal_length_mm;
  return {(planes.uv_depth_mm * slope - scale_mm) / planes.plane_spacing_mm,
          (st_depth_mm * slope - scale_mm) / planes.plane_spacing_mm};
}

Eigen::Vector2d LandingPointMm(const ThickLens& lens, double image_distance_mm,
                               const LightFieldPlanes& planes, const Ray& ray) {
  const ProjectionCoefficients k = ProjectionOf(lens, image_distance_mm, planes);
  return {k.p * ray.s_mm - k.q * ray.u_mm, k.p * ray.t_mm - k.q * ray.v_mm};
}

// [S14] gives the crossing x_f with the plane of focus. Similar triangles at the nodal points then
// give i_x = -(D - f2 + f1)/(zf - f1 + f2) x_f [S15].
Eigen::Vector2d LandingPointByNodalPointsMm(const ThickLens& lens, double image_distance_mm,
                                            const LightFieldPlanes& planes, const Ray& ray) {
  const double focus_depth_mm = FocusDepthMm(lens, image_distance_mm);
  if (std::isinf(focus_depth_mm)) {
    throw Error(
        fmt::format("image_distance_mm is {}: the lens is focused at infinity, where equation (15) "
                    "has no crossing with the plane of focus; use equation (16)",
                    image_distance_mm));
  }
  const double sensor_to_nodal_mm = image_distance_mm - RearNodalDistanceMm(lens);
  const double object_to_nodal_mm = focus_depth_mm - FrontNodalDepthMm(lens);
  return -sensor_to_nodal_mm / object_to_nodal_mm * PositionAtDepthMm(planes, ray, focus_depth_mm);
}

// [S10]: a_u = [(zl + d0) u - zl s]/d0 is the ray's position at depth 0.
Eigen::Vector2d ApertureCrossingMm(const LightFieldPlanes& planes, const Ray& ray) {
  return PositionAtDepthMm(planes, ray, 0);
}

// The position is finite at z = zl and z = zl + d0, because nothing is divided by the depth or by
// its distance from a plane.
Eigen::Vector2d PositionAtDepthMm(const LightFieldPlanes& planes, const Ray& ray, double depth_mm) {
  CheckPlanes(planes);
  if (!std::isfinite(depth_mm)) {
    throw Error(fmt::format(
        "depth_mm is {}: it must be finite, because a ray has no position at infinity", depth_mm));
  }
  const double st_share = (depth_mm - planes.uv_depth_mm) / planes.plane_spacing_mm;
  const double uv_share =
      (planes.uv_depth_mm + planes.plane_spacing_mm - depth_mm) / planes.plane_spacing_mm;
  return {st_share * ray.s_mm + uv_share * ray.u_mm, st_share * ray.t_mm + uv_share * ray.v_mm};
}

Eigen::Vector2d ImagePositionPx(const Sensor& sensor, const Eigen::Vector2d& landing_mm) {
  return sensor.principal_point_px - landing_mm / sensor.pixel_pitch_mm;
}

// [S8] is zl/sqrt((a_u - u)^2 + (a_v - v)^2 + zl^2), which is 0/0 at zl = 0. zl cancels, because
// a_u - u = zl (u - s)/d0 by [S10].
double CosAlpha(const LightFieldPlanes& planes, const Ray& ray) {
  CheckPlanes(planes);
  return 1 / std::sqrt(1 + SquaredSlope(planes, ray));
}

// [S9]: d1/sqrt((i_x - a_u)^2 + (i_y - a_v)^2 + d1^2). Erratum, kept: the ray that meets Ap at
// (a_u, a_v) leaves the REAR principal plane at that height, D = d1 - rho in front of the sensor.
// The formula is exact at rho = 0.
double CosBeta(const ThickLens& lens, double image_distance_mm, const LightFieldPlanes& planes,
               const Ray& ray) {
  const Eigen::Vector2d slope =
      (LandingPointMm(lens, image_distance_mm, planes, ray) - ApertureCrossingMm(planes, ray)) /
      image_distance_mm;
  return 1 / std::sqrt(1 + slope.squaredNorm());
}

double RelativeIrradiance(const ThickLens& lens, double image_distance_mm,
                          const LightFieldPlanes& planes, const Ray& ray) {
  const double cos_beta = CosBeta(lens, image_distance_mm, planes, ray);
  return CosAlpha(planes, ray) * cos_beta * cos_beta * cos_beta;
}

double ApertureTransmission(Psf psf, double blur_ratio, double aperture_radius_mm,
                            const Eigen::Vector2d& crossing_mm) {
  const double sigma_mm = blur_ratio * aperture_radius_mm;
  if (!(sigma_mm >= 0) || !std::isfinite(sigma_mm)) {
    throw Error(
        fmt::format("blur_ratio is {} and aperture_radius_mm is {}: both must be finite and >= 0",
                    blur_ratio, aperture_radius_mm));
  }
  const double distance_mm = crossing_mm.norm();
  if (psf == Psf::kDisc) return distance_mm <= 2 * sigma_mm ? 1.0 : 0.0;
  if (sigma_mm == 0) return distance_mm == 0 ? 1.0 : 0.0;  // the limit: a pinhole
  const double deviations = distance_mm / sigma_mm;
  return std::exp(-deviations * deviations / 2);
}

ApertureShape ApertureShapeFromName(const std::string& name) {
  if (name == "uniform") return ApertureShape::kUniform;
  if (name == "gaussian") return ApertureShape::kGaussian;
  if (name == "disc") return ApertureShape::kDisc;
  throw Error(
      fmt::format("aperture shape \"{}\" is unknown: it must be uniform, gaussian or disc", name));
}

std::string ApertureShapeName(ApertureShape shape) {
  switch (shape) {
    case ApertureShape::kUniform:
      return "uniform";
    case ApertureShape::kGaussian:
      return "gaussian";
    case ApertureShape::kDisc:
      break;
  }
  return "disc";
}

ApertureShape ApertureShapeOf(Psf psf) {
  return psf == Psf::kDisc ? ApertureShape::kDisc : ApertureShape::kGaussian;
}

double ApertureWeightAt(ApertureShape shape, int u_count, int v_count,
                        const Eigen::Vector2d& offset_steps) {
  const double a = offset_steps.x(), b = offset_steps.y();
  switch (shape) {
    case ApertureShape::kUniform:
      return std::abs(a) <= u_count / 2.0 && std::abs(b) <= v_count / 2.0 ? 1.0 : 0.0;
    case ApertureShape::kGaussian:
      return GaussianWeight(a, u_count) * GaussianWeight(b, v_count);
    case ApertureShape::kDisc:
      break;
  }
  return IsInsideDisc(a, u_count, b, v_count) ? 1.0 : 0.0;
}

Eigen::ArrayXXd ApertureWeights(ApertureShape shape, int u_count, int v_count) {
  if (u_count < 1 || v_count < 1) {
    throw Error(fmt::format("views are {}x{}: both counts must be >= 1", u_count, v_count));
  }
  Eigen::ArrayXXd weights(v_count, u_count);
  for (int j = 0; j < v_count; ++j) {
    for (int i = 0; i < u_count; ++i) {
      const double a = i - (u_count - 1) / 2.0;
      const double b = j - (v_count - 1) / 2.0;
      weights(j, i) = ApertureWeightAt(shape, u_count, v_count, {a, b});
    }
  }
  return weights / weights.sum();
}

ApertureSamples SampleAperture(const Eigen::ArrayXXd& weights, double blur_ratio,
                               double aperture_radius_mm) {
  if (!(blur_ratio >= 0) || !std::isfinite(blur_ratio)) {
    throw Error(fmt::format("blur_ratio is {}: it must be finite and >= 0", blur_ratio));
  }
  if (!(aperture_radius_mm >= 0) || !std::isfinite(aperture_radius_mm)) {
    throw Error(
        fmt::format("aperture_radius_mm is {}: it must be finite and >= 0", aperture_radius_mm));
  }
  if (weights.size() == 0 || !(weights >= 0).all() || !(std::abs(weights.sum() - 1) < 1e-9)) {
    throw Error(
        fmt::format("aperture weights: their sum is {}: each must be >= 0 and the sum must be 1",
                    weights.size() == 0 ? 0.0 : weights.sum()));
  }

  ApertureSamples samples;
  samples.u_count = static_cast<int>(weights.cols());
  samples.v_count = static_cast<int>(weights.rows());
  samples.weights = weights;
  double u_mean = 0, v_mean = 0;
  for (int j = 0; j < samples.v_count; ++j) {
    for (int i = 0; i < samples.u_count; ++i) {
      u_mean += weights(j, i) * samples.u_offset(i);
      v_mean += weights(j, i) * samples.v_offset(j);
    }
  }
  double u_moment = 0, v_moment = 0;
  for (int j = 0; j < samples.v_count; ++j) {
    for (int i = 0; i < samples.u_count; ++i) {
      const double a = samples.u_offset(i) - u_mean;
      const double b = samples.v_offset(j) - v_mean;
      u_moment += weights(j, i) * a * a;
      v_moment += weights(j, i) * b * b;
    }
  }
  const double sigma_mm = blur_ratio * aperture_radius_mm;
  samples.u_step_mm = StepMm(sigma_mm, u_moment);
  samples.v_step_mm = StepMm(sigma_mm, v_moment);
  return samples;
}

ApertureSamples SampleAperture(Psf psf, double blur_ratio, double aperture_radius_mm, int u_count,
                               int v_count) {
  return SampleAperture(ApertureWeights(ApertureShapeOf(psf), u_count, v_count), blur_ratio,
                        aperture_radius_mm);
}

bool LightFieldGrid::IsValid(std::string* why) const {
  const struct {
    const char* name;
    int value;
  } counts[] = {
      {"s_count", s_count}, {"t_count", t_count}, {"u_count", u_count}, {"v_count", v_count}};
  for (const auto& count : counts) {
    if (count.value < 1) {
      return Fail(why, fmt::format("{} is {}: it must be >= 1", count.name, count.value));
    }
  }
  if (!ArePlanesPossible(planes, why)) return false;
  const double st_depth_mm = planes.uv_depth_mm + planes.plane_spacing_mm;
  if (!(st_depth_mm > 0)) {
    return Fail(why, fmt::format("the ST plane lies at depth {} mm (uv_depth_mm {} plus "
                                 "plane_spacing_mm {}): it must be in front of the aperture, > 0",
                                 st_depth_mm, planes.uv_depth_mm, planes.plane_spacing_mm));
  }
  if (!(s_step_mm > 0) || !std::isfinite(s_step_mm)) {
    return Fail(why, fmt::format("s_step_mm is {}: it must be finite and > 0", s_step_mm));
  }
  if (!(t_step_mm > 0) || !std::isfinite(t_step_mm)) {
    return Fail(why, fmt::format("t_step_mm is {}: it must be finite and > 0", t_step_mm));
  }
  // A step of 0 is valid: one view, or an aperture without blur. A negative step is valid too: if
  // ST is nearer than UV (d0 < 0), u and the aperture position have opposite directions.
  if (!std::isfinite(u_step_mm)) {
    return Fail(why, fmt::format("u_step_mm is {}: it must be finite", u_step_mm));
  }
  if (!std::isfinite(v_step_mm)) {
    return Fail(why, fmt::format("v_step_mm is {}: it must be finite", v_step_mm));
  }
  if (!st_origin_index.allFinite()) {
    return Fail(why, fmt::format("st_origin_index is ({}, {}): it must be finite",
                                 st_origin_index.x(), st_origin_index.y()));
  }
  return true;
}

Ray LightFieldGrid::RayAt(int i, int j, int k, int l) const {
  return {(i - st_origin_index.x()) * s_step_mm, (j - st_origin_index.y()) * t_step_mm,
          (k - (u_count - 1) / 2.0) * u_step_mm, (l - (v_count - 1) / 2.0) * v_step_mm};
}

Eigen::Vector2d ApertureStepsMm(const LightFieldGrid& grid, const Camera& camera) {
  const double directions_per_aperture = 1 - grid.planes.uv_depth_mm / camera.focus_depth_mm();
  return Eigen::Vector2d(grid.u_step_mm, grid.v_step_mm) / directions_per_aperture;
}

LightFieldGrid DefaultGrid(const Camera& camera, int u_count, int v_count) {
  const double focus_depth_mm = FocusDepthMm(camera.lens, camera.image_distance_mm());
  if (std::isinf(focus_depth_mm)) {
    throw Error(
        fmt::format("camera '{}': it is focused at infinity, where the default grid would place "
                    "its ST plane; planes at finite depths must be given",
                    camera.name));
  }
  return GridOnPlanes(camera, {0, focus_depth_mm}, u_count, v_count);
}

LightFieldGrid GridOnPlanes(const Camera& camera, const LightFieldPlanes& planes, int u_count,
                            int v_count) {
  return GridOnPlanes(camera, planes,
                      SampleAperture(camera.psf, camera.blur_ratio(),
                                     camera.lens.aperture_radius_mm, u_count, v_count));
}

LightFieldGrid GridOnPlanes(const Camera& camera, const LightFieldPlanes& planes,
                            const ApertureSamples& samples) {
  CheckPlanes(planes);
  const double image_distance_mm = camera.image_distance_mm();
  const double focus_depth_mm = FocusDepthMm(camera.lens, image_distance_mm);
  if (!(planes.uv_depth_mm < focus_depth_mm)) {
    throw Error(fmt::format(
        "light-field planes: uv_depth_mm (zl) is {}: it must be below the focus depth {} mm, "
        "because there the rays no longer separate the pixels",
        planes.uv_depth_mm, focus_depth_mm));
  }
  const double st_depth_mm = planes.uv_depth_mm + planes.plane_spacing_mm;
  if (!(st_depth_mm > 0)) {
    throw Error(fmt::format(
        "light-field planes: the ST plane lies at depth {} mm (zl {} plus d0 {}): it must be > 0",
        st_depth_mm, planes.uv_depth_mm, planes.plane_spacing_mm));
  }

  const double p = ProjectionOf(camera.lens, image_distance_mm, planes).p;
  // A ray through the point on the axis in focus has s = -u (zl + d0 - zf)/(zf - zl). By [S10] it
  // crosses the aperture at a = u zf/(zf - zl). Derived here [D15]; zf may be infinite.
  const double uv_per_aperture = 1 - planes.uv_depth_mm / focus_depth_mm;

  LightFieldGrid grid;
  grid.s_count = camera.sensor.width_px;
  grid.t_count = camera.sensor.height_px;
  grid.u_count = samples.u_count;
  grid.v_count = samples.v_count;
  grid.planes = planes;
  grid.s_step_mm = grid.t_step_mm = camera.sensor.pixel_pitch_mm / std::abs(p);
  grid.u_step_mm = samples.u_step_mm * uv_per_aperture;
  grid.v_step_mm = samples.v_step_mm * uv_per_aperture;
  grid.st_origin_index = camera.sensor.principal_point_px;

  std::string why;
  if (!grid.IsValid(&why)) {
    throw Error(fmt::format("camera '{}': no light-field grid can be derived from it: {}",
                            camera.name, why));
  }
  return grid;
}

// The ray passes through the point while s (z - zl) + u (zl + d0 - z) is constant. The form with
// d0/(z - zl) gives a point at infinity the finite slope du/ds.
double SlopeOnGrid(const LightFieldGrid& grid, double depth_mm) {
  const double from_uv_mm = depth_mm - grid.planes.uv_depth_mm;
  if (!(depth_mm > 0) || from_uv_mm == 0) {
    throw Error(
        fmt::format("depth_mm is {}: it must be > 0 and differ from the depth of the UV plane, {} "
                    "mm, where the slope is infinite",
                    depth_mm, grid.planes.uv_depth_mm));
  }
  return (1 - grid.planes.plane_spacing_mm / from_uv_mm) * grid.u_step_mm / grid.s_step_mm;
}

double DisparityPx(const Camera& camera, double aperture_step_mm, double depth_mm) {
  return aperture_step_mm * DefocusPerAperture(camera.lens, camera.image_distance_mm(), depth_mm) /
         camera.sensor.pixel_pitch_mm;
}

}  // namespace thicklens::model
