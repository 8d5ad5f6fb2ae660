#include "thicklens/compare.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>

#include "support/error_message.h"

namespace thicklens {
namespace {

using testing::ErrorOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

constexpr int kViewPx = 12;

// Views of one grey, which is brighter from view to view.
LightField SteppedField(int count, const std::string& source) {
  LightField field = model::MakeLightField(kViewPx, kViewPx, count, count, 1);
  for (std::size_t i = 0; i < field.values.size(); ++i) {
    field.values[i] = 0.25F + 0.01F * static_cast<float>(i / field.view_size());
  }
  field.source = source;
  return field;
}

TEST(CompareInterfaceTest, TheInnerViewsOfTheLargerLightFieldAreCompared) {
  std::string reported;
  RunControl run;
  run.notice = [&](const Notice& notice) { reported += notice.text; };
  const LightFieldScores scores =
      CompareLightFields(SteppedField(5, ""), SteppedField(3, ""), {}, run);
  EXPECT_EQ(scores.u_count, 3);
  EXPECT_EQ(scores.v_count, 3);
  EXPECT_EQ(scores.width_px, kViewPx);
  EXPECT_EQ(scores.height_px, kViewPx);
  EXPECT_EQ(scores.views.size(), 9U);
  EXPECT_EQ(reported, "reference: the inner 3x3 of its 5x5 views are compared");
  ASSERT_EQ(scores.notices.size(), 1U);
  EXPECT_EQ(scores.notices[0].text, reported);
}

TEST(CompareInterfaceTest, EqualCountsAreComparedWithoutANotice) {
  const LightFieldScores scores = CompareLightFields(SteppedField(3, ""), SteppedField(3, ""));
  EXPECT_THAT(scores.notices, IsEmpty());
  EXPECT_NEAR(scores.mean.ssim, 1, 1e-12);
}

TEST(CompareInterfaceTest, TheBaselineFitsTheViewsAndIsNamed) {
  CompareOptions options;
  options.baseline =
      Baseline{Image::FromEncoded(2, 2, ChannelOrder::kGrey, 8, {1, 2, 3, 4}, {}, "photo.png"),
               DepthMap{2, 2, {0, 0, 0, 0}, false, {DepthKind::kDisparity}, "map.pfm"}};
  EXPECT_THAT(
      ErrorOf([&] { CompareLightFields(SteppedField(3, ""), SteppedField(3, ""), options); }),
      StartsWith("photo.png: it is 2x2 px, the views are 12x12 px"));
  const Image image = Image::FromEncoded(1, 1, ChannelOrder::kGrey, 8, {1});
  EXPECT_THAT(ErrorOf([&] { CompareImages(image, image, options); }), HasSubstr("baseline"));
}

TEST(CompareInterfaceTest, RenderedImagesAreComparedOnceEncoded) {
  const LightField field = SteppedField(3, "");
  const Image view = ViewOf(field, 1, 1);
  const Image next = ViewOf(field, 2, 1);
  const std::string refusal =
      "view (1, 1): encoded values are expected, found linear light, which Image::Encoded converts";
  EXPECT_EQ(ErrorOf([&] { CompareImages(view, next.Encoded(8)); }), refusal);
  EXPECT_EQ(ErrorOf([&] { CompareImages(next.Encoded(8), view); }), refusal);
  EXPECT_NEAR(CompareImages(view.Encoded(8), view.Encoded(8)).ssim, 1, 1e-12);
  EXPECT_LT(CompareImages(view.Encoded(16), next.Encoded(16)).psnr_db, 50);
}

TEST(CompareInterfaceTest, BothLightFieldsMustBeValid) {
  LightField empty = SteppedField(3, "");
  empty.values.clear();
  EXPECT_THAT(ErrorOf([&] { CompareLightFields(SteppedField(3, ""), empty); }),
              StartsWith("other: values: 0 values"));
  EXPECT_THAT(ErrorOf([&] { CompareLightFields(empty, SteppedField(3, "")); }),
              StartsWith("reference: values: 0 values"));
  empty.source = "fields/window";
  EXPECT_THAT(ErrorOf([&] { CompareLightFields(SteppedField(3, ""), empty); }),
              StartsWith("fields/window: values: 0 values"));
}

}  // namespace
}  // namespace thicklens
