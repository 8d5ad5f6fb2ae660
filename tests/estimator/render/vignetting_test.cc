// Photographs of light fields whose UV plane is off the aperture. The rays of a view cross the
// aperture in different places, so the aperture weights each of them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "support/error_message.h"
#include "support/test_cameras.h"
#include "thicklens/estimator/render.h"
#include "thicklens/kernels/kernels.h"
#include "thicklens/model/effect_impact.h"
#include "thicklens/model/effect_selection.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::estimator {
namespace {

using ::testing::AllOf;
using testing::ErrorOf;
using ::testing::HasSubstr;
using thicklens::testing::CentredSensor;
using thicklens::testing::TestCameraFocusedAt;
using thicklens::testing::WideLens;
using thicklens::testing::WithMethod;

constexpr double kPi = 3.14159265358979323846;
constexpr double kFocusMm = 800, kRatio = 0.45, kRadiusMm = 6, kPitchMm = 0.008;

model::Camera BenchCamera(model::Psf psf) {
  model::Camera camera = TestCameraFocusedAt(
      kFocusMm, "simulated", WideLens(kRadiusMm),
      CentredSensor(96, 8, kPitchMm, model::TransferCurve::Linear()), {kRatio, 0});
  camera.psf = psf;
  return WithMethod(camera);
}

// An upright sine of that period, in px of the image, nearer than the plane of focus.
model::SceneSimulationOptions SineScene(model::Psf psf, double depth_mm, double period_px) {
  model::SceneSimulationOptions options;
  options.camera = BenchCamera(psf);
  model::SceneLayer wall;
  wall.plane.depth_mm = depth_mm;
  wall.texture.kind = model::TextureKind::kSine;
  wall.texture.feature_size_px = period_px;
  wall.texture.contrast = 0.8;
  options.layers = {wall};
  options.effects.base = model::EffectSelectionOptions::Base::kGiven;
  options.effects.given = {model::Effect::kDefocus, model::Effect::kApertureShape};
  options.sampling_error_grey_levels = 0;
  options.rays_per_pixel = 4000;
  options.u_count = options.v_count = 7;
  return options;
}

model::LinearImage PhotographOf(const model::LightField& field, const Vignetting* vignetting,
                                const model::Camera* falloff = nullptr) {
  const auto reference = kernels::NewReference<float>();
  model::LinearImage photograph =
      Photograph(field, field.weights, falloff, vignetting, reference.get(), 1);
  const model::LinearImage cpu = Photograph(field, field.weights, falloff, vignetting, nullptr, 1);
  for (std::size_t i = 0; i < photograph.values.size(); ++i) {
    EXPECT_NEAR(cpu.values[i], photograph.values[i], 2e-6) << i;
  }
  return photograph;
}

double RmsDifference(const model::LinearImage& a, const model::LinearImage& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    const double difference = static_cast<double>(a.values[i]) - static_cast<double>(b.values[i]);
    sum += difference * difference;
  }
  return std::sqrt(sum / static_cast<double>(a.values.size()));
}

// The samples end at two standard deviations of the aperture, so that a bundle that has wandered
// lacks some light on one side: most of the error goes, not all. A disc of seven samples is coarse,
// and as bright at its rim as in its middle.
TEST(Vignetting, MakesThePhotographThatOfTheScene) {
  for (const model::Psf psf : {model::Psf::kGaussian, model::Psf::kDisc}) {
    model::SceneSimulationOptions options = SineScene(psf, 600, 14);
    const model::LinearImage truth = model::SceneSimulator(options, {}).RenderNoiseless({1, {}});
    const auto photograph_error = [&](double uv_depth_mm, bool is_on) {
      options.uv_depth_mm = uv_depth_mm;
      const model::LightField field =
          model::SceneSimulator(options, {}).RenderLightField(7, 7, {1, {}});
      const Vignetting vignetting{ShapeOfWeights(field).value(), {}};
      return RmsDifference(PhotographOf(field, is_on ? &vignetting : nullptr), truth);
    };
    const double on_aperture = photograph_error(0, true);
    EXPECT_LT(on_aperture, 0.012);
    for (const double uv_depth_mm : {40.0, -45.0}) {
      const double with = photograph_error(uv_depth_mm, true);
      const double without = photograph_error(uv_depth_mm, false);
      EXPECT_GT(without, 0.04);
      EXPECT_LT(with, without / (psf == model::Psf::kGaussian ? 2.5 : 1.2)) << uv_depth_mm;
    }
  }
}

// An independent sum over the samples, from [S10] and the displacement c(z) a of points out of
// focus.
TEST(Vignetting, IsTheSumOverTheRaysOfEachPixel) {
  const double depth_mm = 600, period_px = 14;
  model::SceneSimulationOptions options = SineScene(model::Psf::kGaussian, depth_mm, period_px);
  options.uv_depth_mm = 60;
  const model::LightField field =
      model::SceneSimulator(options, {}).RenderLightField(7, 7, {1, {}});
  const Vignetting vignetting{model::ApertureShape::kGaussian, {}};
  const model::LinearImage found = PhotographOf(field, &vignetting);
  const double scale_px = options.camera.focal_scale_px();
  double moment = 0, sum_of_weights = 0;
  for (int k = -3; k <= 3; ++k) {
    const double weight = std::exp(-std::pow(4.0 * k / 7, 2) / 2);
    moment += weight * k * k;
    sum_of_weights += weight;
  }
  const double step_mm = kRatio * kRadiusMm / std::sqrt(moment / sum_of_weights);
  for (int x = 0; x < 96; x += 5) {
    const double s_mm = (x - 47.5) * kFocusMm / scale_px;
    const double wander_mm = -60 * s_mm / (kFocusMm - 60);
    double light = 0, weights = 0;
    for (int k = -3; k <= 3; ++k) {
      const double a_mm = k * step_mm + wander_mm;
      const double weight = std::exp(-std::pow(4 * a_mm / step_mm / 7, 2) / 2);
      // The ray is at x + c a in the image of the middle of the aperture.
      const double at_px = x - 47.5 + scale_px * a_mm * (1 / depth_mm - 1 / kFocusMm);
      weights += weight;
      light += weight * 0.5 * (1 + 0.8 * std::cos(2 * kPi * at_px / period_px));
    }
    EXPECT_NEAR(found.at(x, 4, 1), light / weights, 1e-4) << x;
  }
}

// Down the image, too, and with other counts there.
TEST(Vignetting, IsTheSameAlongBothAxes) {
  model::SceneSimulationOptions options = SineScene(model::Psf::kGaussian, 600, 14);
  options.uv_depth_mm = 60;
  const Vignetting vignetting{model::ApertureShape::kGaussian, {}};
  const auto photograph = [&](int u_count, int v_count) {
    return PhotographOf(
        model::SceneSimulator(options, {}).RenderLightField(u_count, v_count, {1, {}}),
        &vignetting);
  };
  const model::LinearImage across = photograph(8, 3);
  std::swap(options.camera.sensor.width_px, options.camera.sensor.height_px);
  options.camera.sensor.principal_point_px.reverseInPlace();
  options.layers[0].texture.angle_deg = 90;
  const model::LinearImage down = photograph(3, 8);
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 96; ++x) {
      EXPECT_NEAR(across.at(x, y, 0), down.at(y, x, 0), 1e-5);
    }
  }
}

// Along an axis with one view there is no bundle that could wander; views may be absent.
TEST(Vignetting, TakesFewViewsAsTheyAre) {
  model::SceneSimulationOptions options = SineScene(model::Psf::kDisc, 600, 14);
  options.uv_depth_mm = 60;
  const model::SceneSimulator simulator(options, {});
  const model::LightField one = simulator.RenderLightField(1, 1, {1, {}});
  const Vignetting small{model::ApertureShape::kDisc, 0.1};
  EXPECT_EQ(PhotographOf(one, &small).values, model::ViewImage(one, 0, 0).values);

  model::LightField field = simulator.RenderLightField(5, 1, {1, {}});
  const Vignetting vignetting{model::ApertureShape::kGaussian, {}};
  field.present.assign(5, true);
  field.present[0] = field.present[4] = false;
  const model::LinearImage found = PhotographOf(field, &vignetting);
  const double wander = -60 / (kFocusMm - 60) * field.grid->s_step_mm /
                        model::ApertureStepsMm(*field.grid, *field.camera).x();
  for (int x = 0; x < 96; x += 7) {
    double light = 0, weights = 0;
    for (int k = 1; k <= 3; ++k) {
      const double steps = k - 2 + wander * (x - 47.5);
      const double weight = std::exp(-std::pow(4 * steps / 5, 2) / 2);
      light += weight * static_cast<double>(model::ViewImage(field, k, 0).at(x, 3, 0));
      weights += weight;
    }
    EXPECT_NEAR(found.at(x, 3, 0), light / weights, 1e-5);
  }
}

// The captured aperture keeps the captured weights.
TEST(Vignetting, OfTheWholeApertureIsThatOfNone) {
  for (const model::Psf psf : {model::Psf::kGaussian, model::Psf::kDisc}) {
    model::SceneSimulationOptions options = SineScene(psf, 600, 14);
    options.uv_depth_mm = 60;
    const model::LightField field =
        model::SceneSimulator(options, {}).RenderLightField(4, 4, {1, {}});
    const model::ApertureShape shape = ShapeOfWeights(field).value();
    EXPECT_EQ(shape, model::ApertureShapeOf(psf));
    const Vignetting whole{shape, kRadiusMm}, none{shape, {}};
    EXPECT_EQ(PhotographOf(field, &whole).values, PhotographOf(field, &none).values);
  }
}

// If UV is on the aperture there is no vignetting, and it costs no time.
TEST(Vignetting, IsNothingOnTheAperture) {
  const model::SceneSimulationOptions options = SineScene(model::Psf::kGaussian, 600, 14);
  const model::LightField field =
      model::SceneSimulator(options, {}).RenderLightField(5, 5, {1, {}});
  EXPECT_FALSE(IsOffAperture(field));
  const Vignetting vignetting{model::ApertureShape::kGaussian, {}};
  EXPECT_EQ(PhotographOf(field, &vignetting).values, PhotographOf(field, nullptr).values);
}

// The result is compared with a sum over every ray of a uniform field.
TEST(Vignetting, WeightsEachRayByItsFallOff) {
  model::Camera camera = BenchCamera(model::Psf::kDisc);
  camera.sensor.pixel_pitch_mm = 0.1;
  model::LightField field = model::MakeLightField(96, 8, 9, 9, 1);
  std::fill(field.values.begin(), field.values.end(), 1.0F);
  field.weights = model::ApertureWeights(model::ApertureShape::kDisc, 9, 9);
  field.camera = camera;
  const double uv_depth_mm = 5;
  field.grid = model::GridOnPlanes(camera, {uv_depth_mm, kFocusMm - uv_depth_mm}, 9, 9);
  const Vignetting vignetting{model::ApertureShape::kDisc, {}};
  const model::LinearImage found = PhotographOf(field, &vignetting, &camera);
  const double edge_mm = 4.5 * model::ApertureStepsMm(*field.grid, camera).x();
  const auto irradiance = [&](int i, int j) {
    double sum = 0, count = 0;
    for (int l = 0; l < 9; ++l) {
      for (int k = 0; k < 9; ++k) {
        model::Ray ray = field.grid->RayAt(i, j, k, l);
        const model::Ray on_axis{0, 0, ray.u_mm, ray.v_mm};
        if (model::ApertureCrossingMm(field.grid->planes, ray).norm() > edge_mm) continue;
        const auto of = [&](const model::Ray& which) {
          return model::RelativeIrradiance(camera.lens, camera.image_distance_mm(),
                                           field.grid->planes, which);
        };
        sum += of(ray) / of(on_axis);
        ++count;
      }
    }
    return sum / count;
  };
  for (const int x : {0, 20, 47, 80, 95}) {
    EXPECT_NEAR(found.at(x, 2, 0), irradiance(x, 2), 1e-5) << x;
  }
  EXPECT_LT(found.at(0, 2, 0), 0.9F);
}

// `explain` and auto use this bound: an edge between black and white, out of focus, at any place.
TEST(Vignetting, ChangesNoMoreThanItsBound) {
  const model::Effect kVignetting = model::Effect::kVignetting;
  const model::EffectSet of_model = {model::Effect::kDefocus, model::Effect::kApertureShape,
                                     kVignetting};
  double tightest = 1e9;
  for (const double uv_depth_mm : {10.0, 40.0, -80.0}) {
    model::SceneSimulationOptions options = SineScene(model::Psf::kGaussian, 450, 400);
    options.layers[0].texture.kind = model::TextureKind::kEdge;
    options.layers[0].texture.contrast = 1;
    options.layers[0].texture.feature_size_px = 0;
    options.uv_depth_mm = uv_depth_mm;
    model::EffectConditions conditions;
    conditions.camera = options.camera;
    conditions.planes = {uv_depth_mm, kFocusMm - uv_depth_mm};
    const model::EffectSelection decision = model::SelectEffects(
        {}, conditions, model::PlacesBetween(options.camera, 450, kFocusMm, false), of_model);
    const auto finding = std::find_if(
        decision.findings.begin(), decision.findings.end(),
        [&](const model::LargestEffectImpact& each) { return each.effect == kVignetting; });
    ASSERT_NE(finding, decision.findings.end());
    double largest = 0;
    // The edge, in the middle of what is visible
    for (const double beside_px : {10.0, 25.0, 40.0}) {
      options.camera.sensor.principal_point_px.x() = 47.5 - beside_px;
      const model::LightField field =
          model::SceneSimulator(options, {}).RenderLightField(7, 7, {1, {}});
      const Vignetting vignetting{model::ApertureShape::kGaussian, {}};
      const model::LinearImage with = PhotographOf(field, &vignetting);
      const model::LinearImage without = PhotographOf(field, nullptr);
      for (std::size_t i = 0; i < with.values.size(); ++i) {
        largest = std::max(largest, 255 * std::abs(static_cast<double>(with.values[i]) -
                                                   static_cast<double>(without.values[i])));
      }
    }
    EXPECT_LT(largest, finding->impact.grey_levels) << uv_depth_mm;
    EXPECT_GT(largest, 0);
    tightest = std::min(tightest, finding->impact.grey_levels / largest);
  }
  EXPECT_LT(tightest, 5);
}

TEST(Vignetting, RefusesAPixelThatNoRayReaches) {
  model::SceneSimulationOptions options = SineScene(model::Psf::kDisc, 600, 14);
  options.uv_depth_mm = 150;
  const model::LightField field =
      model::SceneSimulator(options, {}).RenderLightField(3, 3, {1, {}});
  const Vignetting small{model::ApertureShape::kDisc, 0.5};
  EXPECT_THAT(ErrorOf([&] { PhotographOf(field, &small); }),
              AllOf(HasSubstr("vignetting"), HasSubstr("pixel (0, 0)"), HasSubstr("150 mm")));
}

TEST(Vignetting, KnowsTheShapeOfWeights) {
  model::LightField field = model::MakeLightField(4, 3, 5, 7, 1);
  for (const model::ApertureShape shape :
       {model::ApertureShape::kUniform, model::ApertureShape::kGaussian,
        model::ApertureShape::kDisc}) {
    field.weights = model::ApertureWeights(shape, 5, 7);
    EXPECT_EQ(ShapeOfWeights(field), shape);
    for (int l = 0; l < 7; ++l) {
      for (int k = 0; k < 5; ++k) {
        EXPECT_NEAR(model::ApertureWeightAt(shape, 5, 7, {k - 2, l - 3}) * field.weights(3, 2),
                    field.weights(l, k), 1e-15);
      }
    }
  }
  field.weights(0, 0) += 0.01;
  EXPECT_EQ(ShapeOfWeights(field), std::nullopt);
  field.present.assign(35, true);
  field.present[0] = false;
  EXPECT_EQ(ShapeOfWeights(field), model::ApertureShape::kDisc);

  // Two samples a side are alike in every shape.
  model::LightField few = model::MakeLightField(4, 3, 2, 2, 1);
  few.weights = model::ApertureWeights(model::ApertureShape::kGaussian, 2, 2);
  EXPECT_EQ(ShapeOfWeights(few), model::ApertureShape::kUniform);
  few.camera = BenchCamera(model::Psf::kGaussian);
  EXPECT_EQ(ShapeOfWeights(few), model::ApertureShape::kGaussian);
}

}  // namespace
}  // namespace thicklens::estimator
