#include "thicklens/model/light_field.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "support/test_cameras.h"
#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::thicklens::testing::ErrorOf;

constexpr int kS = 5, kT = 4, kU = 3, kV = 5;

// A value that encodes its position: channel, v, u, t, s as decimal digits.
float Digits(int channel, int l, int k, int t, int s) {
  return static_cast<float>(channel * 10000 + l * 1000 + k * 100 + t * 10 + s);
}

// Filled by the formula of the header alone.
LightField Numbered(int channels) {
  LightField light_field = MakeLightField(kS, kT, kU, kV, channels);
  for (int c = 0; c < channels; ++c) {
    for (int l = 0; l < kV; ++l) {
      for (int k = 0; k < kU; ++k) {
        for (int t = 0; t < kT; ++t) {
          for (int s = 0; s < kS; ++s) {
            const int index = ((((c * kV + l) * kU + k) * kT) + t) * kS + s;
            light_field.values[static_cast<std::size_t>(index)] = Digits(c, l, k, t, s);
          }
        }
      }
    }
  }
  return light_field;
}

Camera GammaCamera() {
  return thicklens::testing::SmallCamera(kS, kT, {2.25, 1.5}, TransferCurve::Gamma(2.2));
}

LightField WithCamera() {
  LightField light_field = Numbered(3);
  light_field.camera = GammaCamera();
  light_field.grid = DefaultGrid(*light_field.camera, kU, kV);
  light_field.weights = ApertureWeights(ApertureShape::kGaussian, kU, kV);
  light_field.landing_step_px = {0.25, -0.5};
  light_field.transfer = TransferCurve::Gamma(2.2);
  light_field.origin.method = "simulated";
  return light_field;
}

std::string WhyInvalid(const LightField& light_field) {
  std::string why = "(valid)";
  light_field.IsValid(&why);
  return why;
}

TEST(LightField, IsMadeEmptyWithUniformWeights) {
  const LightField light_field = MakeLightField(kS, kT, kU, kV, 3);
  EXPECT_EQ(light_field.values, std::vector<float>(kS * kT * kU * kV * 3, 0.0F));
  EXPECT_EQ(light_field.weights.rows(), kV);
  EXPECT_EQ(light_field.weights.cols(), kU);
  EXPECT_TRUE((light_field.weights == light_field.weights(0, 0)).all());
  EXPECT_NEAR(light_field.weights.sum(), 1, 1e-14);
  EXPECT_TRUE(light_field.IsPresent(kU - 1, kV - 1));
  EXPECT_TRUE(light_field.IsValid(nullptr));
  EXPECT_EQ(light_field.u_offset(0), -1);
  EXPECT_EQ(light_field.v_offset(4), 2);
}

TEST(LightField, AViewHasItsChannelsInterleaved) {
  const LinearImage image = ViewImage(Numbered(3), 1, 4);
  ASSERT_EQ(image.width_px, kS);
  ASSERT_EQ(image.height_px, kT);
  ASSERT_EQ(image.channels, 3);
  for (int t = 0; t < kT; ++t) {
    for (int s = 0; s < kS; ++s) {
      for (int c = 0; c < 3; ++c) EXPECT_EQ(image.at(s, t, c), Digits(c, 4, 1, t, s));
    }
  }
}

TEST(LightField, SettingEveryViewGivesTheSameLightField) {
  for (const int channels : {1, 2, 3, 5}) {
    const LightField from = Numbered(channels);
    LightField to = MakeLightField(kS, kT, kU, kV, channels);
    to.present.assign(kU * kV, false);
    for (int l = 0; l < kV; ++l) {
      for (int k = 0; k < kU; ++k) {
        EXPECT_FALSE(to.IsPresent(k, l));
        SetView(&to, k, l, ViewImage(from, k, l));
        EXPECT_TRUE(to.IsPresent(k, l));
      }
    }
    EXPECT_EQ(to.values, from.values);
  }
}

TEST(LightField, AViewOutsideOrOfAnotherSizeIsRefused) {
  LightField light_field = Numbered(3);
  EXPECT_THAT(ErrorOf([&] { ViewImage(light_field, 3, 0); }),
              AllOf(HasSubstr("(3, 0)"), HasSubstr("from 0 to 2"), HasSubstr("from 0 to 4")));
  EXPECT_THAT(ErrorOf([&] { ViewImage(light_field, 0, -1); }), HasSubstr("(0, -1)"));
  EXPECT_THAT(ErrorOf([&] { ViewImage(light_field, 0, 5); }), HasSubstr("(0, 5)"));
  LinearImage image = ViewImage(light_field, 0, 0);
  EXPECT_THAT(ErrorOf([&] { SetView(&light_field, -1, 0, image); }), HasSubstr("(-1, 0)"));
  image.width_px = 4;
  EXPECT_THAT(ErrorOf([&] { SetView(&light_field, 2, 1, image); }),
              AllOf(HasSubstr("view (2, 1)"), HasSubstr("4x4"), HasSubstr("5x4")));
  image = ViewImage(light_field, 0, 0);
  image.values.pop_back();
  EXPECT_THAT(ErrorOf([&] { SetView(&light_field, 2, 1, image); }), HasSubstr("view (2, 1)"));
}

TEST(InnerViews, AreThoseInTheMiddle) {
  const LightField all = WithCamera();
  const LightField inner = InnerViews(all, 1, 3);
  EXPECT_EQ(WhyInvalid(inner), "(valid)");
  ASSERT_EQ(inner.u_count, 1);
  ASSERT_EQ(inner.v_count, 3);
  for (int l = 0; l < 3; ++l)
    EXPECT_EQ(ViewImage(inner, 0, l).values, ViewImage(all, 1, l + 1).values);
  // The ratios of the weights stay the same, and so do the positions of the views.
  EXPECT_NEAR(inner.weights(0, 0) / inner.weights(1, 0), all.weights(1, 1) / all.weights(2, 1),
              1e-14);
  EXPECT_NEAR(inner.weights.sum(), 1, 1e-14);
  EXPECT_EQ(inner.grid->RayAt(3, 2, 0, 0).v_mm, all.grid->RayAt(3, 2, 1, 1).v_mm);
  EXPECT_EQ(inner.landing_step_px, all.landing_step_px);
  EXPECT_EQ(inner.transfer, all.transfer);
  EXPECT_EQ(inner.origin.method, "simulated");
  EXPECT_EQ(InnerViews(all, kU, kV).values, all.values);
}

TEST(InnerViews, KeepTheMiddleOrAreRefused) {
  const LightField all = Numbered(1);
  EXPECT_THAT(ErrorOf([&] { InnerViews(all, 2, 3); }), AllOf(HasSubstr("u"), HasSubstr("odd")));
  EXPECT_THAT(ErrorOf([&] { InnerViews(all, 1, 4); }), HasSubstr("of 5"));
  EXPECT_THAT(ErrorOf([&] { InnerViews(all, 5, 5); }), HasSubstr("from 1 to 3"));
  EXPECT_THAT(ErrorOf([&] { InnerViews(all, 1, 0); }), HasSubstr("from 1 to 5"));
  EXPECT_THAT(ErrorOf([&] { InnerViews(all, -1, 1); }), HasSubstr("from 1 to 3"));
  const LightField even = MakeLightField(2, 2, 4, 4, 1);
  EXPECT_EQ(InnerViews(even, 2, 4).u_count, 2);
  EXPECT_THAT(ErrorOf([&] { InnerViews(even, 3, 4); }), HasSubstr("even"));
}

TEST(InnerViews, KnowWhichAreMissing) {
  LightField all = Numbered(1);
  all.present.assign(kU * kV, true);
  all.present[2 * kU + 1] = false;  // (1, 2), the centre
  all.present[0] = false;
  const LightField inner = InnerViews(all, 1, 3);
  EXPECT_THAT(inner.present, ElementsAre(true, false, true));
  all.weights.setZero();
  all.weights(0, 0) = 1;
  EXPECT_THAT(ErrorOf([&] { InnerViews(all, 1, 1); }), HasSubstr("the weight 0"));
}

TEST(CropViews, CutsEveryViewAndMovesTheAxis) {
  const LightField all = WithCamera();
  const PixelRect rect{2, 1, 3, 2};
  const LightField cropped = CropViews(all, rect);
  EXPECT_EQ(WhyInvalid(cropped), "(valid)");
  for (int l = 0; l < kV; ++l) {
    for (int k = 0; k < kU; ++k) {
      const LinearImage view = ViewImage(cropped, k, l);
      for (int t = 0; t < 2; ++t) {
        for (int s = 0; s < 3; ++s) {
          for (int c = 0; c < 3; ++c) EXPECT_EQ(view.at(s, t, c), Digits(c, l, k, t + 1, s + 2));
        }
      }
    }
  }
  EXPECT_EQ(cropped.camera->sensor.principal_point_px, Eigen::Vector2d(0.25, 0.5));
  // A sample keeps its place in the scene.
  EXPECT_DOUBLE_EQ(cropped.grid->RayAt(0, 0, 0, 0).s_mm, all.grid->RayAt(2, 1, 0, 0).s_mm);
  EXPECT_DOUBLE_EQ(cropped.grid->RayAt(0, 0, 0, 0).t_mm, all.grid->RayAt(2, 1, 0, 0).t_mm);
  EXPECT_TRUE((cropped.weights == all.weights).all());
  EXPECT_EQ(CropViews(all, {0, 0, kS, kT}).values, all.values);
}

TEST(CropImage, CutsImagesAndDepthAlike) {
  const PixelRect rect{1, 2, 2, 1};
  const LinearImage light{4, 3, 2, {0,  1,  2,  3,  4,  5,  6,  7,  8,  9,  10, 11,
                                    12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23}};
  EXPECT_THAT(CropImage(light, rect).values, ElementsAre(18, 19, 20, 21));
  EncodedImage stored{4, 3, 1, 16, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11}};
  EXPECT_THAT(CropImage(stored, rect).values, ElementsAre(9, 10));
  EXPECT_EQ(CropImage(stored, rect).bits, 16);
  const RawDepthMap map{4, 3, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11}, true};
  EXPECT_THAT(CropDepth(map, rect).values, ElementsAre(9, 10));
  EXPECT_TRUE(CropDepth(map, rect).integer);
}

TEST(CropImage, ARectangleThatLeavesTheImageIsRefused) {
  const RawDepthMap map{4, 3, std::vector<float>(12), false};
  constexpr int kHuge = std::numeric_limits<int>::max();
  for (const PixelRect& rect :
       {PixelRect{-1, 0, 2, 2}, PixelRect{0, -1, 2, 2}, PixelRect{0, 0, 5, 1},
        PixelRect{0, 0, 1, 4}, PixelRect{3, 0, 2, 1}, PixelRect{0, 2, 1, 2}, PixelRect{0, 0, 0, 1},
        PixelRect{0, 0, 1, 0}, PixelRect{4, 0, 1, 1}, PixelRect{1, 1, kHuge, kHuge}}) {
    EXPECT_THAT(ErrorOf([&] { CropDepth(map, rect); }),
                HasSubstr("is not inside the depth map of 4x3"));
  }
  EXPECT_THAT(ErrorOf([&] {
                CropViews(Numbered(1), {1, 0, 5, 1});
              }),
              AllOf(HasSubstr("1,0,5,1"), HasSubstr("5x4"),
                    HasSubstr("x must be from 0 to 0 and y from 0 to 3")));
  EXPECT_THAT(ErrorOf([&] { CropCamera(GammaCamera(), {0, 1, 5, 4}); }), HasSubstr("sensor"));
}

// Each field spoilt on its own.
TEST(LightField, SaysWhatDoesNotFit) {
  const LightField good = WithCamera();
  ASSERT_EQ(WhyInvalid(good), "(valid)");
  const auto with = [&](auto spoil) {
    LightField light_field = good;
    spoil(&light_field);
    return WhyInvalid(light_field);
  };
  EXPECT_THAT(with([](LightField* l) { l->s_count = 0; }), HasSubstr("s_count is 0"));
  EXPECT_THAT(with([](LightField* l) { l->v_count = -1; }), HasSubstr("v_count is -1"));
  EXPECT_THAT(with([](LightField* l) { l->channels = 0; }), HasSubstr("channels is 0"));
  EXPECT_THAT(with([](LightField* l) { l->values.pop_back(); }),
              AllOf(HasSubstr("values: 899"), HasSubstr("900")));
  EXPECT_THAT(with([](LightField* l) { l->weights = Eigen::ArrayXXd::Ones(kU, kV) / 15; }),
              HasSubstr("weights: 3 rows of 5"));
  EXPECT_THAT(with([](LightField* l) { l->weights *= 1.001; }), HasSubstr("sum is 1.001"));
  EXPECT_THAT(with([](LightField* l) {
                l->weights(4, 2) += 2 * l->weights(3, 1);
                l->weights(3, 1) *= -1;
              }),
              HasSubstr("view (1, 3)"));
  EXPECT_THAT(with([](LightField* l) { l->weights(0, 0) = std::nan(""); }),
              HasSubstr("view (0, 0)"));
  EXPECT_THAT(with([](LightField* l) { l->present.assign(14, true); }), HasSubstr("14 entries"));
  EXPECT_THAT(with([](LightField* l) { l->present.assign(15, false); }), HasSubstr("no view"));
  EXPECT_THAT(with([](LightField* l) { l->landing_step_px.x() = std::nan(""); }),
              HasSubstr("landing_step_px"));
  EXPECT_THAT(with([](LightField* l) { l->camera.reset(); }), HasSubstr("without a camera"));
  EXPECT_THAT(with([](LightField* l) { l->grid.reset(); }), HasSubstr("without a grid"));
  EXPECT_THAT(with([](LightField* l) { l->grid->u_count = 5; }), HasSubstr("5x5 views"));
  EXPECT_THAT(with([](LightField* l) { l->grid->s_step_mm = 0; }), HasSubstr("grid: s_step_mm"));
  EXPECT_THAT(with([](LightField* l) { l->camera->sensor.height_px = 9; }), HasSubstr("5x9"));
  EXPECT_THAT(ErrorOf([] { MakeLightField(2, 2, 0, 1, 3); }), HasSubstr("u_count is 0"));
  EXPECT_THAT(ErrorOf([] { MakeLightField(2, 2, 1, 1, 0); }), HasSubstr("channels is 0"));
}

}  // namespace
}  // namespace thicklens::model
