#include "thicklens/render.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <string>

#include "support/error_message.h"
#include "support/test_cameras.h"
#include "tools/support/option_error.h"

namespace thicklens {
namespace {

using ::testing::AllOf;
using testing::CentredSensor;
using testing::ErrorOf;
using testing::FieldOfOptionError;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using testing::TestCameraFocusedAt;

constexpr int kRenderWidthPx = 60, kRenderHeightPx = 40;

LightField UniformField(const std::optional<Camera>& camera) {
  LightField field = model::MakeLightField(kRenderWidthPx, kRenderHeightPx, 3, 3, 1);
  std::fill(field.values.begin(), field.values.end(), 0.5F);
  if (camera) {
    field.camera = camera;
    field.grid = model::DefaultGrid(*camera, 3, 3);
  }
  return field;
}

// Thick, with a wide field where the pixels are large.
Camera CameraOfPitch(double pixel_pitch_mm, double aperture_radius_mm = 4) {
  return TestCameraFocusedAt(800, "", {12.5, 14, 6, aperture_radius_mm},
                             CentredSensor(kRenderWidthPx, kRenderHeightPx, pixel_pitch_mm));
}

RenderSummary RenderSummaryOf(const LightField& field, const PhotographOptions& options = {}) {
  RenderSummary summary;
  RenderPhotograph(field, options, {}, &summary);
  return summary;
}

TEST(RenderInterfaceTest, APhotographTakesTheEffectsThatMatter) {
  const EffectSet kept = {Effect::kDefocus, Effect::kApertureShape};
  const RenderSummary relative = RenderSummaryOf(UniformField({}));
  EXPECT_EQ(relative.effects.on, kept);
  EXPECT_TRUE(relative.effects.findings.empty());
  const RenderSummary wide = RenderSummaryOf(UniformField(CameraOfPitch(0.2)));
  EXPECT_EQ(wide.effects.on, kept.With({Effect::kThickness, Effect::kFalloff}));
  for (const model::LargestEffectImpact& finding : wide.effects.findings) {
    EXPECT_FALSE(kept.Has(finding.effect)) << model::EffectName(finding.effect);
  }
  EXPECT_EQ(RenderSummaryOf(UniformField(CameraOfPitch(0.001, 0.05))).effects.on, kept);
  LightField off_aperture = UniformField(CameraOfPitch(0.01));
  off_aperture.grid = model::GridOnPlanes(*off_aperture.camera, {20, 780}, 3, 3);
  EXPECT_TRUE(RenderSummaryOf(off_aperture).effects.on.Has(Effect::kVignetting));
  off_aperture.grid = model::GridOnPlanes(*off_aperture.camera, {1e-4, 800 - 1e-4}, 3, 3);
  EXPECT_FALSE(RenderSummaryOf(off_aperture).effects.on.Has(Effect::kVignetting));
}

TEST(RenderInterfaceTest, EffectsThatTheModelLacksAreRefused) {
  const LightField field = UniformField(CameraOfPitch(0.001, 0.05));
  PhotographOptions vignetting;
  vignetting.effects.base = EffectSelection::Base::kGiven;
  vignetting.effects.given = {Effect::kVignetting};
  EXPECT_EQ(FieldOfOptionError([&] { RenderSummaryOf(field, vignetting); }), "effects.given");
  PhotographOptions noise;
  noise.effects.without = {Effect::kReadNoise};
  EXPECT_EQ(FieldOfOptionError([&] { RenderSummaryOf(field, noise); }), "effects.without");
  EXPECT_THAT(ErrorOf([&] { RenderSummaryOf(field, noise); }), HasSubstr("read-noise"));
  PhotographOptions tolerance;
  tolerance.effects.tolerance = model::EffectTolerance{};
  EXPECT_EQ(FieldOfOptionError([&] { RenderSummaryOf(UniformField({}), tolerance); }),
            "effects.tolerance");
}

TEST(RenderInterfaceTest, TheApertureIsThatOfTheOptionsOrTheEffects) {
  const LightField field = UniformField({});
  EXPECT_EQ(RenderSummaryOf(field).aperture_shape, "own");
  EXPECT_EQ(RenderSummaryOf(field).aperture_from, "light-field");
  PhotographOptions options;
  options.aperture.shape = model::ApertureShape::kDisc;
  EXPECT_EQ(RenderSummaryOf(field, options).aperture_shape, "disc");
  EXPECT_EQ(RenderSummaryOf(field, options).aperture_from, "option");
  options = {};
  options.effects.base = EffectSelection::Base::kGiven;
  const RenderSummary none = RenderSummaryOf(field, options);
  EXPECT_TRUE(none.effects.on.empty());
  EXPECT_EQ(none.aperture_shape, "pinhole");
  options.effects.given = {Effect::kDefocus};
  EXPECT_EQ(RenderSummaryOf(field, options).aperture_shape, "gaussian");
}

// A program names its own options in the messages.
TEST(RenderInterfaceTest, AFocusInMillimetresNeedsACamera) {
  LightField field = UniformField({});
  field.source = "fields/window";
  FocusOptions focus;
  focus.depth_mm = 800;
  RunControl run;
  run.option_name = [](const std::string& path) { return "--" + path; };
  EXPECT_THAT(ErrorOf([&] { Refocus(field, focus, run); }),
              AllOf(StartsWith("--depth_mm 800 mm: fields/window has no camera"),
                    HasSubstr("give --disparity_px")));
}

TEST(RenderInterfaceTest, ALightFieldThatIsNotValidIsNamed) {
  LightField field = UniformField({});
  field.values.clear();
  field.source = "fields/window";
  FocusOptions focus;
  focus.disparity_px = 1;
  EXPECT_THAT(ErrorOf([&] { Refocus(field, focus); }), StartsWith("fields/window: values: 0 "));
  EXPECT_THAT(ErrorOf([&] { RenderPhotograph(field); }), StartsWith("fields/window: values: 0 "));
}

TEST(RenderInterfaceTest, ImagesOfManyPixelsAreRefused) {
  const LightField field = UniformField({});
  EXPECT_EQ(RenderMosaic(field, 10).width_px(), 3 * kRenderWidthPx + 2 * 10);
  for (const int gap_px : {49941, 2000000000, std::numeric_limits<int>::max()}) {
    EXPECT_THAT(ErrorOf([&] { RenderMosaic(field, gap_px); }),
                HasSubstr("it must be from 0 to 49910 for 3x3 views of 60x40 px"));
  }
  EXPECT_EQ(RenderEpipolarRow(field, 0, 0, 33333).height_px(), 99999);
  EXPECT_EQ(RenderEpipolarColumn(field, 0, 0, 33333).width_px(), 99999);
  for (const int repeat_px : {33334, 2000000000, std::numeric_limits<int>::max()}) {
    EXPECT_THAT(ErrorOf([&] { RenderEpipolarRow(field, 0, 0, repeat_px); }),
                HasSubstr("it must be from 1 to 33333 for 3 views"));
    EXPECT_THAT(ErrorOf([&] { RenderEpipolarColumn(field, 0, 0, repeat_px); }),
                HasSubstr("it must be from 1 to 33333 for 3 views"));
  }
  const LightField wide = model::MakeLightField(60000, 1, 2, 1, 1);
  EXPECT_THAT(ErrorOf([&] { RenderMosaic(wide, 0); }), HasSubstr("2 views of 60000 px"));
}

TEST(RenderInterfaceTest, AFocusThatShiftsViewsByMoreThanTheirSizeIsRefused) {
  FocusOptions focus;
  focus.disparity_px = kRenderWidthPx;
  EXPECT_EQ(Refocus(UniformField({}), focus).width_px(), kRenderWidthPx);
  for (const double disparity_px : {60.001, -61.0, 1e300}) {
    focus.disparity_px = disparity_px;
    EXPECT_THAT(ErrorOf([&] { Refocus(UniformField({}), focus); }),
                AllOf(StartsWith("disparity_px "), HasSubstr("within the 60 px")));
  }
  focus.disparity_px.reset();
  focus.depth_mm = 1e-300;
  EXPECT_THAT(ErrorOf([&] { Refocus(UniformField(CameraOfPitch(0.01)), focus); }),
              AllOf(StartsWith("depth_mm 1e-300 mm: "), HasSubstr("within the 60 px")));
}

}  // namespace
}  // namespace thicklens
