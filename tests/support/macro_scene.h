#ifndef THICKLENS_TESTS_SUPPORT_MACRO_SCENE_H_
#define THICKLENS_TESTS_SUPPORT_MACRO_SCENE_H_

#include <Eigen/Core>
#include <cmath>
#include <utility>
#include <vector>

#include "support/test_cameras.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::testing {

// A thick macro lens, focused at 300 mm, and scenes in front of it whose blur has a simple formula.
struct MacroScene {
  static constexpr double kFrontMm = 50, kRearMm = 52, kThicknessMm = 4, kRadiusMm = 9;
  static constexpr double kFocusMm = 300, kPitchMm = 0.0045, kRatio = 0.45;

  // K/p, by similar triangles.
  static double ScalePx() { return kFrontMm * kFocusMm / (kFocusMm - kFrontMm) / kPitchMm; }
  // Sigma of the defocus, px. It is positive for points nearer than the plane of focus.
  static double DefocusPx(double depth_mm) {
    return kRatio * kRadiusMm * ScalePx() * (1 / depth_mm - 1 / kFocusMm);
  }
  static double DepthOf(double defocus_px) {
    return 1 / (1 / kFocusMm + defocus_px / (kRatio * kRadiusMm * ScalePx()));
  }

  static model::Camera Camera(int width_px, int height_px, model::Psf psf, double floor_px = 0) {
    const Eigen::Vector2d axis_px((width_px - 1) / 2.0 + 0.3, (height_px - 1) / 2.0 - 0.4);
    model::Camera camera = TestCamera(
        "macro", {kFrontMm, kRearMm, kThicknessMm, kRadiusMm},
        TestSensor(width_px, height_px, kPitchMm, axis_px, model::TransferCurve::Linear()),
        {kThicknessMm + kRearMm * kFocusMm / (kFocusMm - kFrontMm), 0}, {kRatio, 0});
    camera.psf = psf;
    camera.calibration->blur_floor_px = model::Estimate{floor_px, 0};
    return WithMethod(camera, "simulated");
  }

  static model::SceneLayer Uniform(double depth_mm, double light) {
    model::SceneLayer layer;
    layer.plane.depth_mm = depth_mm;
    layer.texture.kind = model::TextureKind::kUniform;
    layer.texture.colour.setConstant(light);
    return layer;
  }

  // A layer whose sharp image is 0.5 + 0.4 cos(2 pi f . (x - principal point)), f =
  // direction/period.
  static model::SceneLayer Sine(double depth_mm, double period_px, double angle_deg) {
    model::SceneLayer layer = Uniform(depth_mm, 0.5);
    layer.texture.kind = model::TextureKind::kSine;
    layer.texture.contrast = 0.8;
    layer.texture.feature_size_px = period_px;
    layer.texture.angle_deg = angle_deg;
    return layer;
  }
  static Eigen::Vector2d Direction(double angle_deg) {
    const double angle_rad = angle_deg * std::acos(-1.0) / 180;
    return {std::cos(angle_rad), std::sin(angle_rad)};
  }

  // Options with `rays` rays for every pixel.
  static model::SceneSimulationOptions Options(const model::Camera& camera,
                                               std::vector<model::SceneLayer> layers,
                                               const model::EffectSet& effects, int rays) {
    model::SceneSimulationOptions options;
    options.camera = camera;
    options.layers = std::move(layers);
    options.effects.base = model::EffectSelectionOptions::Base::kGiven;
    options.effects.given = effects;
    options.sampling_error_grey_levels = 0;
    options.rays_per_pixel = rays;
    return options;
  }
};

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_SUPPORT_MACRO_SCENE_H_
