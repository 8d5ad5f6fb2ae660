// Which effects of a photograph an estimate takes into account.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "support/test_cameras.h"
#include "thicklens/estimator/render.h"
#include "thicklens/kernels/kernels.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/thick_lens.h"
#include "tools/interface/problem.h"

namespace thicklens {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using thicklens::testing::CentredSensor;
using thicklens::testing::TestCameraFocusedAt;

constexpr int kSensorWidthPx = 60, kSensorHeightPx = 40;
const EstimateOptions kDefault;

// Thick, with a wide field where the pixels are large.
model::Camera ThickCamera(double pixel_pitch_mm, double aperture_radius_mm = 4) {
  return TestCameraFocusedAt(800, "", {12.5, 14, 6, aperture_radius_mm},
                             CentredSensor(kSensorWidthPx, kSensorHeightPx, pixel_pitch_mm));
}

EffectSet Decided(const EstimateOptions& options, const std::optional<model::Camera>& camera) {
  return SelectEffects(options, camera, model::DepthStatistics{100, 0, 500, 800, 2000}).on;
}
EstimateOptions Without(const std::string& names) {
  EstimateOptions options;
  options.effects.without = model::EffectSetFromNames(names);
  return options;
}
std::string OptionErrorOf(const std::function<void()>& work) {
  try {
    work();
  } catch (const OptionError& error) {
    return error.what();
  }
  return "";
}

TEST(EstimateEffects, AnEstimateTakesWhatMatters) {
  const EffectSet kept = {Effect::kDefocus, Effect::kOcclusion};
  EXPECT_EQ(Decided(kDefault, ThickCamera(0.2)), kept.With({Effect::kFalloff, Effect::kThickness}));
  EXPECT_EQ(Decided(kDefault, ThickCamera(0.001, 0.05)), kept);
  // A small field: the effect of a wide aperture on the blur there is included in the calibrated
  // blur ratio.
  EXPECT_EQ(Decided(kDefault, ThickCamera(0.001)), kept);
  EXPECT_EQ(Decided(Without("thickness"), ThickCamera(0.2)), kept.With({Effect::kFalloff}));
  EstimateOptions options;
  options.effects.base = EffectSelection::Base::kAll;
  EXPECT_EQ(Decided(options, ThickCamera(0.001, 0.05)),
            kept.With({Effect::kFalloff, Effect::kThickness, Effect::kApertureShape}));
  options.effects.base = EffectSelection::Base::kGiven;
  options.effects.given = {Effect::kDefocus, Effect::kOcclusion};
  EXPECT_EQ(Decided(options, ThickCamera(0.2)), kept);
  options = kDefault;
  options.effects.tolerance = model::EffectToleranceFromText("30gl");
  EXPECT_EQ(Decided(options, ThickCamera(0.05, 1)), kept);
  model::Camera disc = ThickCamera(0.001, 0.05);
  disc.psf = model::Psf::kDisc;
  EXPECT_EQ(Decided(kDefault, disc), kept.With({Effect::kApertureShape}));
}

TEST(EstimateEffects, WithoutACameraNothingIsKnownOfTheirImpact) {
  EXPECT_EQ(Decided(kDefault, std::nullopt),
            (EffectSet{Effect::kDefocus, Effect::kApertureShape, Effect::kOcclusion}));
  EXPECT_TRUE(SelectEffects(kDefault, std::nullopt, std::nullopt).findings.empty());
  EstimateOptions functional;
  functional.solver = FunctionalSolver();
  EXPECT_EQ(Decided(functional, std::nullopt),
            (EffectSet{Effect::kDefocus, Effect::kApertureShape}));
  EstimateOptions tolerance;
  tolerance.effects.tolerance = model::EffectToleranceFromText("1gl");
  EXPECT_THAT(OptionErrorOf([&] { Decided(tolerance, std::nullopt); }),
              StartsWith("effects.tolerance: "));
  EXPECT_THAT(OptionErrorOf([] { Decided(Without("falloff"), std::nullopt); }),
              AllOf(StartsWith("effects"), HasSubstr("falloff")));
}

// The effects that auto leaves out also meet the tolerance as reported. The report leaves each out
// alone, while auto leaves them out one after the other, which changes the bounds a little.
TEST(EstimateEffects, OmittedEffectsStayWithinTheReportedTolerance) {
  int left_out = 0;
  for (const double pitch_mm : {0.001, 0.003, 0.01, 0.03, 0.1}) {
    for (const double radius_mm : {0.02, 0.2, 1.0, 4.0}) {
      const model::EffectSelection decision = SelectEffects(
          kDefault, ThickCamera(pitch_mm, radius_mm), model::DepthStatistics{9, 0, 500, 800, 2000});
      for (const model::LargestEffectImpact& finding : decision.findings) {
        if (decision.on.Has(finding.effect)) continue;
        EXPECT_LE(finding.impact.grey_levels, 0.6)
            << model::EffectName(finding.effect) << " " << pitch_mm << " " << radius_mm;
        if (finding.effect == Effect::kFalloff) ++left_out;
      }
    }
  }
  EXPECT_GT(left_out, 0);
}

TEST(EstimateEffects, AnEstimateRefusesToLeaveOutWhatItIsAbout) {
  EXPECT_THAT(OptionErrorOf([] { Decided(Without("defocus"), ThickCamera(0.2)); }),
              AllOf(StartsWith("effects: defocus"), HasSubstr("DIBR")));
  EXPECT_THAT(OptionErrorOf([] { Decided(Without("occlusion"), std::nullopt); }),
              HasSubstr("occlusion cannot be left out"));
  EXPECT_THAT(OptionErrorOf([] { Decided(Without("shot-noise"), ThickCamera(0.2)); }),
              AllOf(StartsWith("effects"), HasSubstr("shot-noise")));
  EstimateOptions options;
  options.effects.base = EffectSelection::Base::kGiven;
  options.effects.given = {Effect::kFalloff};
  EXPECT_THAT(OptionErrorOf([&] { Decided(options, ThickCamera(0.2)); }), HasSubstr("defocus"));
}

// A uniform field, photographed by a camera and by its thin reference: the mean over the views of
// cos cos^3, each over that of its own ray on the axis, added up.
TEST(EstimateEffects, TheThinLensEquivalentHasAFallOffOfItsOwn) {
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

}  // namespace
}  // namespace thicklens
