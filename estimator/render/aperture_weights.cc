#include "thicklens/estimator/aperture_weights.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "estimator/render/shown_views.h"
#include "thicklens/base/error.h"
#include "thicklens/model/light_field_description.h"

namespace thicklens::estimator {
namespace {

// Positions whose relative difference is smaller are equal except for rounding.
constexpr double kRounding = 1e-9;
// Tolerance of weights from files.
constexpr double kSameWeight = 1e-6;

// Position of a view on the aperture from the centre: mm with a camera, otherwise view steps.
Eigen::Vector2d AperturePosition(const model::LightField& light_field, int k, int l) {
  const double a = light_field.u_offset(k);
  const double b = light_field.v_offset(l);
  if (!light_field.camera) return {a, b};
  return model::ApertureStepsMm(*light_field.grid, *light_field.camera)
      .cwiseProduct(Eigen::Vector2d(a, b));
}

// Returns the share that an aperture of that radius leaves of a view's weight, which belongs to the
// captured aperture: T_R/T_r, where T is the transmission at the view's position. The captured
// aperture therefore gives the light field's own weights back, whatever its view steps are, also
// where the outermost views of a disc extend a little beyond it.
double ShareLeft(const model::LightField& light_field, double radius,
                 const Eigen::Vector2d& position) {
  // A view on the rim of a disc counts as inside.
  const Eigen::Vector2d inward = position * (1 - kRounding);
  if (!light_field.camera) return inward.norm() <= radius ? 1 : 0;
  const model::Camera& camera = *light_field.camera;
  if (radius >= camera.lens.aperture_radius_mm * (1 - kRounding)) return 1;
  if (camera.psf == model::Psf::kDisc) {
    return model::ApertureTransmission(camera.psf, camera.blur_ratio(), radius, inward);
  }
  // exp(-|a|^2/2 (1/(kappa R)^2 - 1/(kappa r)^2)).
  const double ratio = radius / camera.lens.aperture_radius_mm;
  const double deviations = position.norm() / (camera.blur_ratio() * radius);
  return radius > 0 ? std::exp(-deviations * deviations / 2 * (1 - ratio * ratio)) : 0.0;
}

// Returns equal weights for the present views nearest to the centre, and 0 for the others.
Eigen::ArrayXXd NearestViews(const model::LightField& light_field) {
  Eigen::ArrayXXd distance = Eigen::ArrayXXd::Constant(light_field.v_count, light_field.u_count,
                                                       std::numeric_limits<double>::infinity());
  for (int l = 0; l < light_field.v_count; ++l) {
    for (int k = 0; k < light_field.u_count; ++k) {
      if (light_field.IsPresent(k, l)) distance(l, k) = AperturePosition(light_field, k, l).norm();
    }
  }
  return (distance <= distance.minCoeff() * (1 + kRounding)).cast<double>();
}

}  // namespace

Eigen::ArrayXXd WeightsForRadius(const model::LightField& light_field, double radius) {
  std::string why;
  if (!model::IsValidDescription(light_field, &why)) throw Error("light field: " + why);
  if (!(radius >= 0) || !std::isfinite(radius)) {
    throw Error(fmt::format("aperture radius is {} {}: it must be finite and >= 0", radius,
                            light_field.camera ? "mm" : "view steps"));
  }
  if (light_field.camera &&
      radius > light_field.camera->lens.aperture_radius_mm * (1 + kRounding)) {
    throw Error(fmt::format(
        "aperture radius is {} mm: it must be at most that of the camera, {} mm; light from beyond "
        "it was never captured",
        radius, light_field.camera->lens.aperture_radius_mm));
  }
  Eigen::ArrayXXd weights = Eigen::ArrayXXd::Zero(light_field.v_count, light_field.u_count);
  for (int l = 0; l < light_field.v_count; ++l) {
    for (int k = 0; k < light_field.u_count; ++k) {
      if (!light_field.IsPresent(k, l)) continue;
      weights(l, k) = light_field.weights(l, k) *
                      ShareLeft(light_field, radius, AperturePosition(light_field, k, l));
    }
  }
  // A Gaussian so narrow that its tail underflows leaves no view either.
  if (!(weights.sum() > std::numeric_limits<double>::min())) weights = NearestViews(light_field);
  return weights / weights.sum();
}

bool IsOffAperture(const model::LightField& light_field) {
  return light_field.grid && light_field.grid->planes.uv_depth_mm != 0;
}

std::optional<model::ApertureShape> ShapeOfWeights(const model::LightField& light_field) {
  using model::ApertureShape;
  Eigen::ArrayXXd present = Eigen::ArrayXXd::Ones(light_field.v_count, light_field.u_count);
  for (int l = 0; l < light_field.v_count; ++l) {
    for (int k = 0; k < light_field.u_count; ++k) present(l, k) = light_field.IsPresent(k, l);
  }
  const auto shares = [&present](const Eigen::ArrayXXd& weights) -> Eigen::ArrayXXd {
    return weights * present / (weights * present).sum();
  };
  std::vector<ApertureShape> shapes = {ApertureShape::kUniform, ApertureShape::kGaussian,
                                       ApertureShape::kDisc};
  if (light_field.camera) {
    shapes.insert(shapes.begin(), model::ApertureShapeOf(light_field.camera->psf));
  }
  for (const ApertureShape shape : shapes) {
    const Eigen::ArrayXXd weights =
        model::ApertureWeights(shape, light_field.u_count, light_field.v_count);
    if (((shares(weights) - shares(light_field.weights)).abs() <= kSameWeight).all()) return shape;
  }
  return std::nullopt;
}

// Uses the rays with u = v = 0: with ST in the plane of focus, they are the middle of the rays that
// land at a pixel.
double MaxPupilShift(const model::LightField& light_field) {
  const model::LightFieldGrid& grid = *light_field.grid;
  const Eigen::Vector2d reach_mm =
      model::ApertureStepsMm(grid, *light_field.camera)
          .cwiseProduct(Eigen::Vector2d(grid.u_count, grid.v_count) / 2)
          .cwiseAbs();
  double largest = 0;
  for (const int i : {0, grid.s_count - 1}) {
    for (const int j : {0, grid.t_count - 1}) {
      model::Ray ray = grid.RayAt(i, j, 0, 0);
      ray.u_mm = ray.v_mm = 0;
      const Eigen::Vector2d crossing_mm = model::ApertureCrossingMm(grid.planes, ray).cwiseAbs();
      for (const int axis : {0, 1}) {
        if (reach_mm[axis] > 0) largest = std::max(largest, crossing_mm[axis] / reach_mm[axis]);
      }
    }
  }
  return largest;
}

std::vector<float> ApertureTransmissionMap(const model::LightField& light_field,
                                           const Vignetting& vignetting, int k, int l) {
  const model::LightFieldGrid& grid = *light_field.grid;
  const Eigen::Vector2d step_mm = model::ApertureStepsMm(grid, *light_field.camera);
  std::vector<float> passed;
  passed.reserve(light_field.view_size());
  for (int j = 0; j < grid.t_count; ++j) {
    for (int i = 0; i < grid.s_count; ++i) {
      Eigen::Vector2d crossing_mm = model::ApertureCrossingMm(grid.planes, grid.RayAt(i, j, k, l));
      Eigen::Vector2d steps(0, 0);
      for (const int axis : {0, 1}) {
        if (step_mm[axis] == 0) {
          crossing_mm[axis] = 0;
        } else {
          steps[axis] = crossing_mm[axis] / step_mm[axis];
        }
      }
      double share = model::ApertureWeightAt(vignetting.shape, grid.u_count, grid.v_count, steps);
      if (vignetting.radius_mm) {
        share *= ShareLeft(light_field, *vignetting.radius_mm, crossing_mm);
      }
      passed.push_back(static_cast<float>(share));
    }
  }
  return passed;
}

}  // namespace thicklens::estimator
