#include "tools/interface/prepare_aperture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "thicklens/io/aperture_statement.h"
#include "thicklens/model/measured_aperture.h"

namespace thicklens {
namespace {

constexpr int kDefaultViewCount = 7;
constexpr char kMeasured[] = "measured";
constexpr double kRoundedWeight = 1e-6;  // weights of files are rounded

struct ShapeAndSource {
  model::ApertureShape shape = model::ApertureShape::kUniform;
  std::string from;
};

// Returns the shape for an aperture whose weights no light field states.
ShapeAndSource ShapeFor(const EstimateOptions& options, const Camera* camera) {
  if (options.aperture.shape) return {*options.aperture.shape, "option"};
  if (options.effects.LeavesOut(Effect::kApertureShape)) {
    return {model::ApertureShape::kGaussian, "assumed"};
  }
  if (camera != nullptr) return {model::ApertureShapeOf(camera->psf), "camera"};
  return {model::ApertureShape::kUniform, "assumed"};
}

// Whether the camera's measured PSF gives the weights of views that no light field places.
bool UsesMeasuredPsf(const EstimateOptions& options, const Camera* camera) {
  return camera != nullptr && camera->measured_psf != nullptr && !options.aperture.shape &&
         options.aperture.views_of == nullptr && !options.effects.LeavesOut(Effect::kApertureShape);
}

void WarnOfCameraPsf(const ApertureViews& views, const Camera& camera, RunScope* run) {
  const model::ApertureShape of_camera = model::ApertureShapeOf(camera.psf);
  if (((io::OwnWeightsOfPresentViews(views.description) -
        io::ShapeOfPresentViews(of_camera, views.description))
           .abs() <= kRoundedWeight)
          .all()) {
    return;
  }
  run->Warn(fmt::format(
      "{} states its aperture as {}, {} as {} (psf): the one of the light field is used",
      views.source, io::OwnApertureInWords(views.description),
      camera.source.empty() ? fmt::format("camera '{}'", camera.name) : camera.source,
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
    if (UsesMeasuredPsf(options, camera)) {
      aperture.measured = model::SampleAperture(*camera->measured_psf, camera->blur_ratio(),
                                                camera->lens.aperture_radius_mm, views.u, views.v);
      aperture.weights = aperture.measured->weights;
      aperture.shape = kMeasured;
      return aperture;
    }
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
          "{}: neither the light field nor a camera states the aperture of the photograph, so a "
          "uniform one is assumed; {} states another",
          views.source, run->Option("aperture.shape")));
    }
    aperture.weights = io::ShapeOfPresentViews(unstated.shape, light_field);
    return aperture;
  }
  if (aperture.from == "option") {
    io::RequireStatedAperture(views.source, light_field, unstated.shape,
                              fmt::format("{} {}", run->Option("aperture.shape"), aperture.shape));
  } else {
    aperture.from = "light-field";
    aperture.shape = io::OwnApertureInWords(light_field);
    if (camera != nullptr) WarnOfCameraPsf(views, *camera, run);
  }
  aperture.weights = io::OwnWeightsOfPresentViews(light_field);
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
        "{}: its views are {:.4g} mm apart on the aperture along {}, but {:.4g} mm in the "
        "estimate, so that camera {} and the weights give the calibrated blur: the views are seen "
        "from other places",
        options.aperture.views_of->source, there[axis], axis == 0 ? "u" : "v", here[axis],
        camera.source.empty() ? fmt::format("'{}'", camera.name) : camera.source));
    return;
  }
}

}  // namespace thicklens
