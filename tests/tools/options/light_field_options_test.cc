#include "tools/options/light_field_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>

#include "thicklens/base/error.h"
#include "tools/options/option_values.h"

namespace thicklens::tools {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

// Returns the message of a UsageError; another Error, or none, fails the test.
template <typename Call>
std::string UsageErrorOf(const Call& call) {
  try {
    call();
  } catch (const UsageError& error) {
    return error.what();
  } catch (const Error& error) {
    ADD_FAILURE() << "no usage error: " << error.what();
    return "";
  }
  return "(no error)";
}

DepthOptions KindAndUnit(const std::string& kind, const std::string& unit) {
  DepthOptions options;
  options.kind = kind;
  options.unit = unit;
  return options;
}

TEST(ViewsOption, IsTwoCounts) {
  EXPECT_EQ(ViewCounts({""}), std::make_pair(0, 0));
  EXPECT_EQ(ViewCounts({"7x3"}), std::make_pair(7, 3));
  for (const char* text : {"7", "7x", "x7", "7x0", "0x7", "7x7x7", "7,7", "-1x3", "2.5x3", "axb"})
    EXPECT_THAT(UsageErrorOf([&] { ViewCounts({text}); }), StartsWith("--views: ")) << text;
}

TEST(CropOption, IsARectangle) {
  EXPECT_FALSE(CropRect({""}));
  const auto rect = CropRect({"1,2,30,40"});
  ASSERT_TRUE(rect);
  EXPECT_EQ(rect->x, 1);
  EXPECT_EQ(rect->y, 2);
  EXPECT_EQ(rect->width, 30);
  EXPECT_EQ(rect->height, 40);
  for (const char* text : {"1,2,3", "1,2,3,0", "1,2,0,3", "1,2,3,4,5", "-1,2,3,4", "1,2,3,4.5"})
    EXPECT_THAT(UsageErrorOf([&] { CropRect({text}); }), StartsWith("--crop: ")) << text;
}

TEST(ReadingOptions, AreHandedToTheInterface) {
  ReadingOptions options;
  EXPECT_FALSE(LightFieldReadOptionsOf(options).inner_views);
  options.grid = 9;
  options.sparse = true;
  options.views.text = "3x5";
  options.crop.text = "0,1,2,3";
  const LightFieldReadOptions reading = LightFieldReadOptionsOf(options);
  EXPECT_EQ(reading.hci_grid, 9);
  EXPECT_TRUE(reading.allow_missing_views);
  ASSERT_TRUE(reading.inner_views);
  EXPECT_EQ(reading.inner_views->u, 3);
  EXPECT_EQ(reading.inner_views->v, 5);
  ASSERT_TRUE(reading.crop);
  EXPECT_EQ(reading.crop->height, 3);
}

TEST(ReadingOptions, MessagesNameTheOptionAsItIsTyped) {
  ReadingOptions options;
  options.layout = "foo";
  EXPECT_THAT(UsageErrorOf([&] { LightFieldReadOptionsOf(options); }), StartsWith("--layout: "));
  for (const char* wrong : {"foo", "tiles:3", "tiles:axb"}) {
    options.layout = wrong;
    EXPECT_THAT(UsageErrorOf([&] { LightFieldReadOptionsOf(options, "--other-"); }),
                StartsWith("--other-layout: "));
  }
  options.layout = "";
  options.view_order = "back";
  EXPECT_THAT(UsageErrorOf([&] { LightFieldReadOptionsOf(options, "--other-"); }),
              StartsWith("--other-view-order: "));
}

TEST(DepthOptions, KindAndUnitAreNotGuessed) {
  const auto message = [](const DepthOptions& options) {
    return UsageErrorOf([&] { ConventionOf(options); });
  };
  EXPECT_THAT(message({}),
              AllOf(HasSubstr("--depth-kind"), HasSubstr("z, range, disparity or inverse")));
  EXPECT_THAT(message(KindAndUnit("z", "")), AllOf(HasSubstr("--depth-unit"), HasSubstr("mm")));
  EXPECT_THAT(message(KindAndUnit("range", "")), HasSubstr("--depth-unit"));
  EXPECT_THAT(message(KindAndUnit("disparity", "mm")), HasSubstr("--depth-unit mm"));
  DepthOptions options = KindAndUnit("z", "mm");
  options.disparity_scale = 2;
  EXPECT_THAT(message(options), HasSubstr("--disparity-scale"));
  options = KindAndUnit("disparity", "");
  options.disparity_scale = 0;
  EXPECT_THAT(message(options), HasSubstr("--disparity-scale"));
  EXPECT_EQ(ConventionOf(KindAndUnit("range", "tum5000")).unit_mm, 0.2);
  EXPECT_EQ(ConventionOf(KindAndUnit("range", "m")).kind, model::DepthKind::kRange);
}

TEST(DepthOptions, OfAnotherKindAreRefused) {
  const auto message = [](const DepthOptions& options) {
    return UsageErrorOf([&] { ConventionOf(options); });
  };
  DepthOptions options = KindAndUnit("z", "mm");
  options.near = 1;
  EXPECT_THAT(message(options), HasSubstr("--depth-kind inverse"));
  options = KindAndUnit("z", "mm");
  options.zero_is = "value";
  EXPECT_THAT(message(options), HasSubstr("--zero-is"));
  options = KindAndUnit("disparity", "");
  options.largest_is = "hole";
  EXPECT_THAT(message(options), HasSubstr("--largest-is"));
  options = KindAndUnit("inverse", "mm");
  EXPECT_THAT(message(options), HasSubstr("--depth-unit mm"));
  options.near = 400;
  EXPECT_THAT(message(options), HasSubstr("belong together"));
  options.far = 400;
  EXPECT_THAT(message(options), HasSubstr("two different depths"));
  options.far = 2500;
  options.unit.clear();
  EXPECT_THAT(message(options), HasSubstr("need --depth-unit"));
  options.unit = "m";
  options.inverse_scale_dpt = 2;
  EXPECT_THAT(message(options), HasSubstr("cannot be given as well"));
}

TEST(DepthOptions, NearAndFarAreHandedOnInMm) {
  DepthOptions options = KindAndUnit("inverse", "m");
  options.near = 0.4;
  options.far = 2.5;
  options.hole_values = {-1};
  options.zero_is = "value";
  options.pfm_scale = "ignore";
  options.flip = "rows";
  const DepthReadOptions reading = DepthReadOptionsOf(options);
  ASSERT_TRUE(reading.near_mm);
  EXPECT_NEAR(*reading.near_mm, 400, 1e-9);
  EXPECT_NEAR(*reading.far_mm, 2500, 1e-9);
  EXPECT_TRUE(reading.holes.zero_is_value);
  EXPECT_THAT(reading.holes.hole_values, ::testing::ElementsAre(-1));
  EXPECT_EQ(reading.flip, model::DepthFlip::kRows);
  EXPECT_EQ(reading.pfm_scale, PfmScale::kIgnored);
  EXPECT_EQ(DepthMeaningOf(options).kind, DepthKind::kInverse);
  EXPECT_EQ(DepthMeaningOf(options).unit, LengthUnit::kNone);
}

TEST(DepthOptions, ARelativeMapStatesNoScale) {
  DepthOptions options = KindAndUnit("relative", "");
  DepthMeaning meaning = DepthMeaningOf(options);
  EXPECT_EQ(meaning.kind, DepthKind::kDisparity);
  EXPECT_TRUE(meaning.is_relative);
  EXPECT_EQ(meaning.disparity_scale, 1);
  EXPECT_TRUE(meaning.IsValid(nullptr));
  // Networks leave no holes.
  EXPECT_TRUE(DepthReadOptionsOf(options).holes.zero_is_value);
  options.near_is = "small";
  options.zero_is = "hole";
  EXPECT_EQ(DepthMeaningOf(options).disparity_scale, -1);
  EXPECT_FALSE(DepthReadOptionsOf(options).holes.zero_is_value);
  options.disparity_scale = 0.1;
  EXPECT_THAT(UsageErrorOf([&] { DepthMeaningOf(options); }), HasSubstr("the kind is disparity"));
  options = KindAndUnit("disparity", "");
  options.near_is = "small";
  EXPECT_THAT(UsageErrorOf([&] { DepthMeaningOf(options); }), HasSubstr("--near-is"));
}

TEST(DepthOptions, AreHandedToTheInterface) {
  for (const char* unit : {"mm", "cm", "m", "tum5000"}) {
    const DepthMeaning meaning = DepthMeaningOf(KindAndUnit("range", unit));
    EXPECT_EQ(meaning.kind, DepthKind::kRange);
    EXPECT_EQ(LengthUnitName(meaning.unit), unit);
    EXPECT_TRUE(meaning.IsValid(nullptr));
  }
  DepthOptions options = KindAndUnit("disparity", "");
  options.disparity_scale = 2;
  options.disparity_offset_px = -0.5;
  const DepthMeaning disparity = DepthMeaningOf(options);
  EXPECT_EQ(disparity.unit, LengthUnit::kNone);
  EXPECT_EQ(disparity.disparity_scale, 2);
  EXPECT_EQ(disparity.disparity_offset_px, -0.5);
  EXPECT_TRUE(disparity.IsValid(nullptr));
}

}  // namespace
}  // namespace thicklens::tools
