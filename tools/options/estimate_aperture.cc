#include "tools/options/estimate_aperture.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <tuple>

#include "thicklens/base/printable_text.h"
#include "thicklens/io/aperture_statement.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/model/light_field.h"
#include "tools/options/light_field_effects.h"
#include "tools/options/light_field_options.h"

namespace thicklens::tools {
namespace {

constexpr int kDefaultViewCount = 7;

struct ShapeAndSource {
  model::ApertureShape shape = model::ApertureShape::kUniform;
  std::string from;
};

// Returns the shape for an aperture whose weights no light field states.
ShapeAndSource ShapeFor(const EstimateOptions& options, const model::Camera* camera) {
  if (!options.aperture_shape.empty()) {
    return {model::ApertureShapeFromName(options.aperture_shape), "option"};
  }
  if (IsLeftOut(options.effects, model::Effect::kApertureShape)) {
    return {model::ApertureShape::kGaussian, "assumed"};
  }
  if (camera != nullptr) return {model::ApertureShapeOf(camera->psf), "camera"};
  return {model::ApertureShape::kUniform, "assumed"};
}

model::LightField ReadViewsOfAperture(const EstimateOptions& options) {
  io::LightFieldReading reading;
  reading.grid = options.grid;
  reading.sparse = options.sparse;
  std::tie(reading.u_count, reading.v_count) = ViewCounts(options.views);
  return io::ReadLightField(options.aperture_of, reading);
}

void ReportAssumedShape(const EstimateOptions& options) {
  spdlog::warn(
      "{}: neither the light field nor a camera states the aperture of the photograph, so a "
      "uniform one is assumed; --aperture-shape gaussian or disc states another",
      PrintableUtf8(options.aperture_of));
}

void WarnOfCameraPsf(const EstimateOptions& options, const model::LightField& light_field,
                     const model::Camera& camera) {
  const model::ApertureShape of_camera = model::ApertureShapeOf(camera.psf);
  constexpr double kSame = 1e-6;
  if (((io::OwnWeightsOfPresentViews(light_field) - io::ShapeOfPresentViews(of_camera, light_field))
           .abs() <= kSame)
          .all()) {
    return;
  }
  spdlog::warn("{} states its aperture as {}, {} as {} (psf): the one of the light field is used",
               PrintableUtf8(options.aperture_of), io::OwnApertureInWords(light_field),
               PrintableUtf8(options.camera_path), model::ApertureShapeName(of_camera));
}

}  // namespace

std::string EstimateAperture::InWords() const {
  std::string text = shape;
  if (from == "camera") text += " (from the camera)";
  if (from == "light-field") text += " (from the light field)";
  if (from == "assumed") text += " (assumed)";
  return views_of.empty() ? text : fmt::format("{}, views of {}", text, views_of);
}

nlohmann::json EstimateAperture::Json() const {
  return {{"shape", shape},
          {"from", from},
          {"views_of", views_of.empty() ? nlohmann::json() : nlohmann::json(views_of)}};
}

EstimateAperture ApertureFor(const EstimateOptions& options, const model::Camera* camera) {
  EstimateAperture aperture;
  const ShapeAndSource unstated = ShapeFor(options, camera);
  aperture.shape = model::ApertureShapeName(unstated.shape);
  aperture.from = unstated.from;
  if (options.aperture_of.empty()) {
    auto [u_count, v_count] = ViewCounts(options.views);
    if (u_count == 0) u_count = v_count = kDefaultViewCount;
    aperture.weights = model::ApertureWeights(unstated.shape, u_count, v_count);
    return aperture;
  }
  const model::LightField light_field = ReadViewsOfAperture(options);
  aperture.views_of = options.aperture_of;
  if (light_field.grid) {
    const model::LightFieldGrid& grid = *light_field.grid;
    aperture.step_mm = model::ApertureStepsMm(grid, *light_field.camera).cwiseAbs();
  }
  if (!io::StatesAperture(options.aperture_of)) {
    if (aperture.from == "assumed") ReportAssumedShape(options);
    aperture.weights = io::ShapeOfPresentViews(unstated.shape, light_field);
    return aperture;
  }
  if (aperture.from == "option") {
    io::RequireStatedAperture(options.aperture_of, light_field, unstated.shape,
                              "--aperture-shape " + options.aperture_shape);
  } else {
    aperture.from = "light-field";
    aperture.shape = io::OwnApertureInWords(light_field);
    if (camera != nullptr) WarnOfCameraPsf(options, light_field, *camera);
  }
  aperture.weights = io::OwnWeightsOfPresentViews(light_field);
  return aperture;
}

void WarnOfOtherSteps(const EstimateOptions& options, const EstimateAperture& aperture,
                      const model::LightFieldGrid& grid, const model::Camera& camera) {
  if (!aperture.step_mm) return;
  constexpr double kTolerance = 0.05;  // the same as for views that are compared
  const Eigen::Vector2d here = model::ApertureStepsMm(grid, camera).cwiseAbs();
  const Eigen::Vector2d& there = *aperture.step_mm;
  for (const int axis : {0, 1}) {
    if (!(here[axis] > 0) || !(there[axis] > 0)) continue;
    if (std::abs(here[axis] - there[axis]) <= kTolerance * std::max(here[axis], there[axis])) {
      continue;
    }
    spdlog::warn(
        "{}: its views are {:.4g} mm apart on the aperture along {}, but {:.4g} mm in the "
        "estimate, so that camera {} and the weights give the calibrated blur: the views are seen "
        "from other places",
        PrintableUtf8(options.aperture_of), there[axis], axis == 0 ? "u" : "v", here[axis],
        PrintableUtf8(options.camera_path));
    return;
  }
}

}  // namespace thicklens::tools
