// --effects and --without of render: the effects that are on were requested or matter.
#include "tools/options/light_field_effects.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>

#include "support/test_cameras.h"
#include "thicklens/estimator/block_solver.h"
#include "thicklens/estimator/render.h"
#include "thicklens/kernels/kernels.h"
#include "thicklens/model/thick_lens.h"
#include "tools/options/option_values.h"

namespace thicklens::tools {
namespace {

using model::Effect;
using model::EffectSet;
using ::testing::HasSubstr;
using thicklens::testing::CentredSensor;
using thicklens::testing::TestCameraFocusedAt;

constexpr int kSensorWidthPx = 60, kSensorHeightPx = 40;

// Thick, with a wide field where the pixels are large.
model::Camera ThickCamera(double pixel_pitch_mm, double aperture_radius_mm = 4) {
  return TestCameraFocusedAt(800, "", {12.5, 14, 6, aperture_radius_mm},
                             CentredSensor(kSensorWidthPx, kSensorHeightPx, pixel_pitch_mm));
}

std::string UsageErrorOf(const std::function<void()>& work) {
  try {
    work();
  } catch (const UsageError& error) {
    return error.what();
  }
  return "";
}

// A uniform field, photographed by a camera and by its thin reference: the mean over the views of
// cos cos^3, each over that of its own ray on the axis, added up.
TEST(LightFieldEffectsTest, TheThinLensEquivalentHasAFallOffOfItsOwn) {
  const model::Camera thick = ThickCamera(0.2), thin = model::ThinLensEquivalent(thick);
  EXPECT_NEAR(thin.focus_depth_mm(), 800, 1e-9);
  EXPECT_NEAR(thin.focal_scale_px(), thick.focal_scale_px(), 1e-9);
  EXPECT_EQ(thin.lens.lens_thickness_mm, 0);
  const model::LightFieldGrid grid = model::DefaultGrid(thick, 5, 5);
  model::LightField field = model::MakeLightField(kSensorWidthPx, kSensorHeightPx, 5, 5, 1);
  std::fill(field.values.begin(), field.values.end(), 0.5F);
  field.weights = model::ApertureWeights(model::ApertureShape::kGaussian, 5, 5);
  field.grid = grid;
  field.camera = thick;
  const auto kernels = kernels::NewReference<float>();
  std::vector<double> corner;
  for (const model::Camera* camera : {&thick, &thin}) {
    const model::LinearImage image =
        estimator::Photograph(field, field.weights, camera, nullptr, kernels.get(), 1);
    const double distance_mm = camera->image_distance_mm();
    const double scale_mm = thick.focal_scale_px() * 0.2;
    const auto light = [&](double x_mm, double y_mm) {
      double sum = 0;
      for (int l = 0; l < 5; ++l) {
        for (int k = 0; k < 5; ++k) {
          const double u_mm = (k - 2) * grid.u_step_mm, v_mm = (l - 2) * grid.v_step_mm;
          // The irradiance of the point of the plane of focus that lands there, seen from (u, v).
          const auto irradiance = [&](double at_x_mm, double at_y_mm) {
            const double front =
                std::hypot(at_x_mm * 800 / scale_mm - u_mm, at_y_mm * 800 / scale_mm - v_mm) / 800;
            const double behind = std::hypot(at_x_mm + u_mm, at_y_mm + v_mm) / distance_mm;
            return std::cos(std::atan(front)) * std::pow(std::cos(std::atan(behind)), 3);
          };
          sum += field.weights(l, k) * irradiance(x_mm, y_mm) / irradiance(0, 0);
        }
      }
      return sum;
    };
    const double expected = 0.5 * light(-29.5 * 0.2, -19.5 * 0.2);
    EXPECT_NEAR(static_cast<double>(image.at(0, 0, 0)), expected, 1e-5);
    corner.push_back(expected);
  }
  EXPECT_GT(std::abs(corner[0] - corner[1]), 0.01);
}

TEST(LightFieldEffectsTest, APhotographTakesWhatMatters) {
  model::LightField field = model::MakeLightField(kSensorWidthPx, kSensorHeightPx, 3, 3, 1);
  const EffectSet kept = {Effect::kDefocus, Effect::kApertureShape};
  EXPECT_EQ(DecidePhotographEffects(EffectOptions(), field).on, kept);
  field.camera = ThickCamera(0.2);
  EXPECT_EQ(DecidePhotographEffects(EffectOptions(), field).on,
            kept.With({Effect::kThickness, Effect::kFalloff}));
  field.camera = ThickCamera(0.001, 0.05);
  EXPECT_EQ(DecidePhotographEffects(EffectOptions(), field).on, kept);
  EffectOptions vignetting;
  vignetting.effects = "vignetting";
  field.grid = model::DefaultGrid(*field.camera, 3, 3);
  EXPECT_THAT(UsageErrorOf([&] { DecidePhotographEffects(vignetting, field); }),
              HasSubstr("vignetting"));
  field.camera = ThickCamera(0.01);
  field.grid = model::GridOnPlanes(*field.camera, {20, 780}, 3, 3);
  EXPECT_TRUE(DecidePhotographEffects(EffectOptions(), field).on.Has(Effect::kVignetting));
  field.grid = model::GridOnPlanes(*field.camera, {1e-4, 800 - 1e-4}, 3, 3);
  EXPECT_FALSE(DecidePhotographEffects(EffectOptions(), field).on.Has(Effect::kVignetting));
  EffectOptions none;
  none.effects = "none";
  EXPECT_TRUE(DecidePhotographEffects(none, field).on.empty());
  EffectOptions noise;
  noise.without = "read-noise";
  EXPECT_THAT(UsageErrorOf([&] { DecidePhotographEffects(noise, field); }),
              HasSubstr("read-noise"));
}

}  // namespace
}  // namespace thicklens::tools
