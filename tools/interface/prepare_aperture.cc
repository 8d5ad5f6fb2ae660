#include "tools/interface/prepare_aperture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "thicklens/estimator/aperture_weights.h"

namespace thicklens {
namespace {

constexpr int kDefaultViewCount = 7;
constexpr double kRoundedWeight = 1e-6;  // weights of files are rounded

struct ShapeAndSource {
  model::ApertureShape shape = model::ApertureShape::kUniform;
  std::string from;
};

// Of an aperture of which no light field states the weights.
ShapeAndSource ShapeFor(const EstimateOptions& options, const Camera* camera) {
  if (options.aperture.shape) return {*options.aperture.shape, "option"};
  if (options.effects.LeavesOut(Effect::kApertureShape)) {
    return {model::ApertureShape::kGaussian, "assumed"};
  }
  if (camera != nullptr) return {model::ApertureShapeOf(camera->psf), "camera"};
  return {model::ApertureShape::kUniform, "assumed"};
}

Eigen::ArrayXXd SharesOfPresent(Eigen::ArrayXXd weights, const LightField& light_field) {
  for (int l = 0; l < light_field.v_count; ++l) {
    for (int k = 0; k < light_field.u_count; ++k) {
      if (!light_field.IsPresent(k, l)) weights(l, k) = 0;
    }
  }
  return weights / weights.sum();
}

Eigen::ArrayXXd ShapeOfPresentViews(model::ApertureShape shape, const LightField& light_field) {
  return SharesOfPresent(model::ApertureWeights(shape, light_field.u_count, light_field.v_count),
                         light_field);
}

std::string ShapeInWords(const LightField& light_field) {
  const std::optional<model::ApertureShape> shape = estimator::ShapeOfWeights(light_field);
  return shape ? model::ApertureShapeName(*shape) : "weights of no known shape";
}

void RequireStatedShape(const ApertureViews& views, model::ApertureShape shape) {
  const Eigen::ArrayXXd stated = SharesOfPresent(views.description.weights, views.description);
  const Eigen::ArrayXXd wanted = ShapeOfPresentViews(shape, views.description);
  Eigen::Index l = 0, k = 0;
  if ((stated - wanted).abs().maxCoeff(&l, &k) <= kRoundedWeight) return;
  throw OptionError(
      "aperture.shape",
      fmt::format("aperture.shape: {} states its aperture as {} (view ({}, {}) has a share of "
                  "{:.6g}), and {} gives that view {:.6g}: they must be equal; without a shape the "
                  "stated weights are used",
                  views.source, ShapeInWords(views.description), k, l, stated(l, k),
                  model::ApertureShapeName(shape), wanted(l, k)));
}

void WarnOfCameraPsf(const ApertureViews& views, const Camera& camera, RunScope* run) {
  const model::ApertureShape of_camera = model::ApertureShapeOf(camera.psf);
  if (((SharesOfPresent(views.description.weights, views.description) -
        ShapeOfPresentViews(of_camera, views.description))
           .abs() <= kRoundedWeight)
          .all()) {
    return;
  }
  run->Warn(fmt::format(
      "{} states its aperture as {}, camera '{}' as {} (psf): that of the light field is used",
      views.source, ShapeInWords(views.description), camera.name,
      model::ApertureShapeName(of_camera)));
}

}  // namespace

PreparedAperture PrepareAperture(const EstimateOptions& options, const Camera* camera,
                                 RunScope* run) {
  PreparedAperture aperture;
  const ShapeAndSource unstated = ShapeFor(options, camera);
  aperture.shape = model::ApertureShapeName(unstated.shape);
  aperture.from = unstated.from;
  if (options.aperture.views_of == nullptr) {
    const ViewCounts views =
        options.views.value_or(ViewCounts{kDefaultViewCount, kDefaultViewCount});
    aperture.weights = model::ApertureWeights(unstated.shape, views.u, views.v);
    return aperture;
  }
  ApertureViews views = *options.aperture.views_of;
  if (options.views) {
    views.description = model::InnerViews(views.description, options.views->u, options.views->v);
  }
  const LightField& light_field = views.description;
  if (light_field.grid) {
    aperture.step_mm = model::ApertureStepsMm(*light_field.grid, *light_field.camera).cwiseAbs();
  }
  if (!views.weights_stated) {
    if (aperture.from == "assumed") {
      run->Warn(fmt::format(
          "{}: nothing states through which aperture the photograph was taken, and a uniform one "
          "is assumed; aperture.shape states another",
          views.source));
    }
    aperture.weights = ShapeOfPresentViews(unstated.shape, light_field);
    return aperture;
  }
  if (aperture.from == "option") {
    RequireStatedShape(views, unstated.shape);
  } else {
    aperture.from = "light-field";
    aperture.shape = ShapeInWords(light_field);
    if (camera != nullptr) WarnOfCameraPsf(views, *camera, run);
  }
  aperture.weights = SharesOfPresent(light_field.weights, light_field);
  return aperture;
}

void WarnOfOtherSteps(const EstimateOptions& options, const PreparedAperture& aperture,
                      const model::LightFieldGrid& grid, const Camera& camera, RunScope* run) {
  if (!aperture.step_mm) return;
  constexpr double kTolerance = 0.05;  // as for views that are compared
  const Eigen::Vector2d here = model::ApertureStepsMm(grid, camera).cwiseAbs();
  const Eigen::Vector2d& there = *aperture.step_mm;
  for (const int axis : {0, 1}) {
    if (!(here[axis] > 0) || !(there[axis] > 0)) continue;
    if (std::abs(here[axis] - there[axis]) <= kTolerance * std::max(here[axis], there[axis])) {
      continue;
    }
    run->Warn(fmt::format(
        "{}: its views are {:.4g} mm apart on the aperture along {}, those of the estimate {:.4g} "
        "mm, so that camera '{}' and the weights give the calibrated blur: the views are seen from "
        "other places",
        options.aperture.views_of->source, there[axis], axis == 0 ? "u" : "v", here[axis],
        camera.name));
    return;
  }
}

}  // namespace thicklens
