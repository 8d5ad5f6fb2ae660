// Estimates that are kept as their scene, through the public interface.
#include "thicklens/scene_form.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "support/error_message.h"
#include "support/temporary_folder.h"
#include "thicklens/animation.h"
#include "thicklens/estimate.h"
#include "thicklens/render.h"
#include "tools/support/option_error.h"

namespace thicklens {
namespace {

using ::testing::HasSubstr;
using thicklens::testing::ErrorOf;
using thicklens::testing::FieldOfOptionError;
using thicklens::testing::TemporaryFolder;

constexpr int kWidthPx = 40, kHeightPx = 28;

Image Photo() {
  std::vector<std::uint16_t> values;
  for (int y = 0; y < kHeightPx; ++y) {
    for (int x = 0; x < kWidthPx; ++x) {
      for (int c = 0; c < 3; ++c) {
        values.push_back(static_cast<std::uint16_t>(
            std::lround(128 + 60 * std::sin(0.9 * x + c) + 40 * std::cos(0.7 * y + 0.3 * x))));
      }
    }
  }
  return Image::FromEncoded(kWidthPx, kHeightPx, ChannelOrder::kRgb, 8, std::move(values),
                            TransferCurve::Srgb());
}

DepthMap Disparity() {
  DepthMap map;
  map.width_px = kWidthPx;
  map.height_px = kHeightPx;
  for (int i = 0; i < kWidthPx * kHeightPx; ++i) {
    const int x = i % kWidthPx;
    map.values.push_back(x > 12 && x < 26 ? 0.9F : -0.4F);
  }
  map.meaning.kind = DepthKind::kDisparity;
  map.source = "strip";
  return map;
}

EstimateOptions OptionsOf(LightFieldForm form, AnySolver solver = SceneSolver()) {
  EstimateOptions options;
  options.views = ViewCounts{3, 3};
  options.solver = std::move(solver);
  options.form = form;
  return options;
}

LightFieldEstimate Estimated(const EstimateOptions& options) {
  return EstimateLightField(Photo(), Disparity(), {}, options);
}

TEST(SceneFormInterface, AnEstimateAsASceneIsTheEstimateAsViews) {
  const LightFieldEstimate views = Estimated(OptionsOf(LightFieldForm::kViews));
  const LightFieldEstimate scene = Estimated(OptionsOf(LightFieldForm::kScene));
  EXPECT_FALSE(views.scene);
  ASSERT_TRUE(scene.scene);
  EXPECT_TRUE(scene.light_field.values.empty());
  EXPECT_TRUE(scene.confidence.empty());
  EXPECT_EQ(ViewsOf(*scene.scene).values, views.light_field.values);
  EXPECT_EQ(estimator::RayConfidenceOf(*scene.scene, 1), views.confidence);
  EXPECT_EQ(scene.scene->frame.origin.effects, views.light_field.origin.effects);
  EXPECT_EQ(scene.summary.warnings, views.summary.warnings);
  EXPECT_EQ(scene.diagnostics.residual_rms, views.diagnostics.residual_rms);
  EXPECT_NEAR(scene.diagnostics.rays_filled_in, views.diagnostics.rays_filled_in, 1e-12);
  EXPECT_NEAR(scene.diagnostics.rays_visible, views.diagnostics.rays_visible, 1e-12);
}

TEST(SceneFormInterface, SolversThatFindViewsKeepThem) {
  EstimateOptions telea = OptionsOf(LightFieldForm::kScene);
  telea.hidden_rays = HiddenRays::kTelea;
  for (const EstimateOptions& options :
       {telea, OptionsOf(LightFieldForm::kScene, FunctionalSolver())}) {
    const LightFieldEstimate estimate = Estimated(options);
    EXPECT_FALSE(estimate.scene);
    EXPECT_FALSE(estimate.light_field.values.empty());
    EXPECT_FALSE(estimate.confidence.empty());
  }
}

TEST(SceneFormInterface, IsWrittenInEveryFormat) {
  const TemporaryFolder folder;
  const LightFieldEstimate views = Estimated(OptionsOf(LightFieldForm::kViews));
  const LightFieldEstimate scene = Estimated(OptionsOf(LightFieldForm::kScene));
  WriteLightField(folder / "views", views, LightFieldFormat::kTiff);
  WriteLightField(folder / "rendered", scene, LightFieldFormat::kTiff);
  WriteLightField(folder / "scene", scene, LightFieldFormat::kScene);
  EXPECT_EQ(ReadLightField(folder / "rendered").values, ReadLightField(folder / "views").values);
  EXPECT_EQ(ReadConfidence(folder / "rendered"), ReadConfidence(folder / "views"));
  EXPECT_FALSE(IsSceneForm(folder / "rendered"));
  EXPECT_TRUE(IsSceneForm(folder / "scene"));
  const SceneForm back = ReadSceneForm(folder / "scene");
  EXPECT_EQ(back.disparity.disparity, scene.scene->disparity.disparity);
  WriteSceneForm(folder / "again", back);
  EXPECT_EQ(ReadSceneForm(folder / "again").radiance.values, back.radiance.values);
  EXPECT_THAT(ErrorOf([&] { WriteLightField(folder / "no", views, LightFieldFormat::kScene); }),
              HasSubstr("LightFieldForm::kScene"));
  EXPECT_EQ(FieldOfOptionError([&] {
              WriteLightField(folder / "no", views.light_field, LightFieldFormat::kScene);
            }),
            "format");
  EXPECT_THAT(ErrorOf([&] { WriteSceneForm(static_cast<OutputFolder*>(nullptr), back); }),
              HasSubstr("null"));
}

TEST(SceneFormInterface, AViewIsNamedByItsColumnAndRow) {
  const LightFieldEstimate estimate = Estimated(OptionsOf(LightFieldForm::kScene));
  const SceneForm& scene = *estimate.scene;
  const LightField views = ViewsOf(scene);
  EXPECT_EQ(RenderView(scene, 2, 0).light().values, model::ViewImage(views, 2, 0).values);
  EXPECT_NE(RenderView(scene, 1.5, 0).light().values, model::ViewImage(views, 2, 0).values);
  EXPECT_THAT(ErrorOf([&] { RenderView(scene, 2.01, 0); }), HasSubstr("u is 2.01"));
  EXPECT_THAT(ErrorOf([&] { RenderView(scene, 0, -1); }), HasSubstr("v is -1"));
  EXPECT_THAT(ErrorOf([&] { RenderView(scene, std::nan(""), 0); }), HasSubstr("u is nan"));
}

TEST(SceneFormInterface, AFocusNeedsWhatAFocusOfViewsNeeds) {
  const SceneForm scene = *Estimated(OptionsOf(LightFieldForm::kScene)).scene;
  FocusOptions focus;
  focus.depth_mm = 500;
  EXPECT_THAT(ErrorOf([&] { Refocus(scene, focus); }), HasSubstr("has no camera"));
  focus = {};
  focus.disparity_px = 1000;
  EXPECT_THAT(ErrorOf([&] { Refocus(scene, focus); }), HasSubstr("within the 40 px"));
  focus.disparity_px = 0.5;
  RenderSummary summary;
  Refocus(scene, focus, {}, &summary);
  EXPECT_EQ(summary.disparity_px, Eigen::Vector2d(0.5, 0.5));
  EXPECT_EQ(summary.aperture_shape, "own");
  focus.aperture.radius = 0;  // a pinhole: the centre view, displaced by nothing
  EXPECT_EQ(Refocus(scene, focus).light().values, scene.radiance.values);
}

TEST(SceneFormInterface, OptionsOfAnimationsAreChecked) {
  const SceneForm scene = *Estimated(OptionsOf(LightFieldForm::kScene)).scene;
  const auto field_of = [&scene](auto change) {
    AnimationOptions options;
    change(&options);
    return FieldOfOptionError([&] { RenderAnimation(scene, options); });
  };
  EXPECT_EQ(field_of([](AnimationOptions* o) { o->frames = 1; }), "frames");
  EXPECT_EQ(field_of([](AnimationOptions* o) { o->seconds = std::nan(""); }), "seconds");
  EXPECT_EQ(field_of([](AnimationOptions* o) { o->seconds = 0.5; }), "frames");
  EXPECT_EQ(field_of([](AnimationOptions* o) { o->quality = 101; }), "quality");
  EXPECT_EQ(field_of([](AnimationOptions* o) { o->kind = static_cast<AnimationKind>(7); }), "kind");
  EXPECT_EQ(field_of([](AnimationOptions* o) { o->aperture.radius = 1; }), "aperture");
}

}  // namespace
}  // namespace thicklens
