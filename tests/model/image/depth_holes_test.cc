#include "thicklens/model/depth_holes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "support/error_message.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;
using thicklens::testing::ErrorOf;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinite = std::numeric_limits<float>::infinity();

RawDepthMap RowOf(std::vector<float> values, bool integer = false,
                  std::optional<double> largest = std::nullopt) {
  const int width = static_cast<int>(values.size());
  return {width, 1, std::move(values), integer, largest};
}

std::vector<bool> HolesIn(const RawDepthMap& map) {
  std::vector<bool> holes;
  for (const float value : map.values) holes.push_back(std::isnan(value));
  return holes;
}

TEST(DepthHoles, EveryReasonIsCountedOnce) {
  RawDepthMap map = RowOf({1, 0, kNan, kInfinite, -kInfinite, -1, 9999, 2});
  HoleRules rules;
  rules.hole_values = {9999};
  const DepthHoles holes = MarkHoles(DepthKind::kZ, rules, &map);
  EXPECT_EQ(holes.pixels, 8U);
  EXPECT_EQ(holes.zero, 1U);
  EXPECT_EQ(holes.not_a_number, 1U);
  EXPECT_EQ(holes.infinite, 2U);
  EXPECT_EQ(holes.negative, 1U);
  EXPECT_EQ(holes.listed, 1U);
  EXPECT_EQ(holes.largest, 0U);
  EXPECT_EQ(holes.total(), 6U);
  EXPECT_EQ(HolesIn(map), (std::vector<bool>{false, true, true, true, true, true, true, false}));
  EXPECT_THAT(holes.InWords(), HasSubstr("0: 12.5 %"));
  EXPECT_THAT(holes.InWords(), HasSubstr("infinite: 25.0 %"));
}

// A file of floats cannot hold 0.1 exactly.
TEST(DepthHoles, AHoleValueIsComparedAsTheFileHoldsIt) {
  RawDepthMap map = RowOf({0.1F, 0.2F});
  HoleRules rules;
  rules.hole_values = {0.1};
  EXPECT_EQ(MarkHoles(DepthKind::kDisparity, rules, &map).listed, 1U);
}

TEST(DepthHoles, NegativeDisparitiesAreValues) {
  for (const DepthKind kind : {DepthKind::kDisparity, DepthKind::kInverse}) {
    RawDepthMap map = RowOf({-1, 0, 1});
    EXPECT_EQ(MarkHoles(kind, {}, &map).total(), 0U);
  }
}

// The map of a camera that looks along -z is not a map of holes.
TEST(DepthHoles, AMapOfTheOtherSignIsLeftToItsReader) {
  RawDepthMap map = RowOf({-1, -2, -3, 4});
  EXPECT_EQ(MarkHoles(DepthKind::kZ, {}, &map).total(), 0U);
  EXPECT_EQ(map.values.front(), -1);
}

TEST(DepthHoles, TheLargestValueOfTheTypeIsAMarkIfNothingComesNearIt) {
  const auto marked = [](DepthKind kind, std::vector<float> values, double largest,
                         bool is_value = false) {
    RawDepthMap map = RowOf(std::move(values), true, largest);
    HoleRules rules;
    rules.largest_is_value = is_value;
    return MarkHoles(kind, rules, &map).largest;
  };
  EXPECT_EQ(marked(DepthKind::kZ, {800, 1690, 65535, 65535}, 65535), 2U);
  EXPECT_EQ(marked(DepthKind::kRange, {800, 4095}, 4095), 1U);
  EXPECT_EQ(marked(DepthKind::kZ, {800, 64000, 65535}, 65535), 0U);
  EXPECT_EQ(marked(DepthKind::kZ, {800, 1690, 65535}, 65535, true), 0U);
  // Relative maps are scaled to reach it, and so are maps of 8 bits.
  EXPECT_EQ(marked(DepthKind::kDisparity, {80, 65535}, 65535), 0U);
  EXPECT_EQ(marked(DepthKind::kInverse, {80, 65535}, 65535), 0U);
  EXPECT_EQ(marked(DepthKind::kZ, {80, 255}, 255), 0U);
}

TEST(DepthHoles, ZeroOfAnIntegerDisparityIsAHoleUnlessItIsDeclaredAValue) {
  RawDepthMap map = RowOf({0, 5}, true, 255);
  EXPECT_EQ(MarkHoles(DepthKind::kDisparity, {}, &map).zero, 1U);
  RawDepthMap as_value = RowOf({0, 5}, true, 255);
  HoleRules rules;
  rules.zero_is_value = true;
  EXPECT_EQ(MarkHoles(DepthKind::kDisparity, rules, &as_value).zero, 0U);
  EXPECT_EQ(as_value.values.front(), 0);
  EXPECT_FALSE(as_value.integer);  // otherwise its user would take 0 for a hole
  EXPECT_THAT(ErrorOf([&] { MarkHoles(DepthKind::kZ, rules, &as_value); }),
              HasSubstr("zero_is_value"));
}

TEST(DepthHoles, AreasOfZerosDifferFromScatteredOnes) {
  constexpr int kSize = 20;
  RawDepthMap area{kSize, kSize, {}, true, 255};
  RawDepthMap scattered = area;
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      area.values.push_back(x < kSize / 2 ? 0.0F : 200.0F);
      scattered.values.push_back((x + 3 * y) % 4 == 0 ? 0.0F : 200.0F);
    }
  }
  EXPECT_TRUE(MarkHoles(DepthKind::kDisparity, {}, &area).zeros_form_areas);
  EXPECT_FALSE(MarkHoles(DepthKind::kDisparity, {}, &scattered).zeros_form_areas);
}

// A ramp of 90 depths in front of `count` pixels that have one value.
RawDepthMap RampAnd(float near, float far, std::vector<float> marks, bool integer = false,
                    std::optional<double> largest = std::nullopt, int count = 10) {
  std::vector<float> values;
  for (int i = 0; i < 90; ++i) values.push_back(near + (far - near) * static_cast<float>(i) / 89);
  for (const float mark : marks) values.insert(values.end(), static_cast<std::size_t>(count), mark);
  return RowOf(std::move(values), integer, largest);
}

std::vector<double> SuspectsIn(DepthKind kind, RawDepthMap map, const HoleRules& rules = {}) {
  std::vector<double> suspects;
  for (const SuspectedMark& mark : MarkHoles(kind, rules, &map).suspects) {
    EXPECT_EQ(mark.pixels, 10U);
    suspects.push_back(mark.value);
  }
  return suspects;
}

TEST(DepthHoles, AMarkThatNobodyStatedIsSuspected) {
  using ::testing::ElementsAre;
  constexpr auto kZ = DepthKind::kZ;
  EXPECT_THAT(SuspectsIn(kZ, RampAnd(500, 1200, {9999})), ElementsAre(9999));
  EXPECT_THAT(SuspectsIn(kZ, RampAnd(500, 1200, {10000}, true, 65535)), ElementsAre(10000));
  EXPECT_THAT(SuspectsIn(kZ, RampAnd(500, 1200, {1e10F})), ElementsAre(1e10F));
  EXPECT_THAT(SuspectsIn(kZ, RampAnd(500, 1200, {65535})), ElementsAre(65535));
  EXPECT_THAT(SuspectsIn(kZ, RampAnd(500, 1200, {65534}, true, 65535)), ElementsAre(65534));
  EXPECT_THAT(SuspectsIn(kZ, RampAnd(50, 120, {255}, true, 255)), ElementsAre(255));
  EXPECT_THAT(SuspectsIn(kZ, RampAnd(0.5, 1.2F, {777})), ElementsAre(777));
  EXPECT_THAT(SuspectsIn(kZ, RampAnd(500, 1200, {65534, 65535})), ElementsAre(65535, 65534));
  EXPECT_THAT(SuspectsIn(DepthKind::kDisparity, RampAnd(2000, 9000, {65535}, true, 65535)),
              ElementsAre(65535));
  EXPECT_THAT(SuspectsIn(DepthKind::kDisparity, RampAnd(-2, 9, {-9999})), ElementsAre(-9999));
  for (const float bits : {4095.0F, 8191.0F, 16383.0F, 32767.0F})
    EXPECT_THAT(SuspectsIn(kZ, RampAnd(500, 1200, {bits}, true, 65535)), ElementsAre(bits));
  for (const float unmatched : {-1.0F, -16.0F}) {
    EXPECT_THAT(SuspectsIn(DepthKind::kDisparity, RampAnd(2, 60, {unmatched})),
                ElementsAre(unmatched));
  }
}

TEST(DepthHoles, AWallOrASkyIsNoSuspectedMark) {
  using ::testing::IsEmpty;
  constexpr auto kZ = DepthKind::kZ;
  EXPECT_THAT(SuspectsIn(kZ, RampAnd(500, 1200, {3000})), IsEmpty());
  EXPECT_THAT(SuspectsIn(kZ, RampAnd(500, 1200, {50000}, true, 65535)), IsEmpty());
  EXPECT_THAT(SuspectsIn(kZ, RampAnd(0.5, 12, {100})), IsEmpty());
  EXPECT_THAT(SuspectsIn(kZ, RampAnd(500, 9000, {9999})), IsEmpty());  // the ramp goes on
  // Other values are below 0, and a disparity of its own.
  EXPECT_THAT(SuspectsIn(DepthKind::kDisparity, RampAnd(-3, 9, {-1})), IsEmpty());
  EXPECT_THAT(SuspectsIn(DepthKind::kDisparity, RampAnd(2, 9, {-2})), IsEmpty());
  EXPECT_THAT(SuspectsIn(DepthKind::kDisparity, RampAnd(2, 2, {-1})), IsEmpty());
  // A wall behind what is nearer takes most of the image.
  EXPECT_THAT(SuspectsIn(DepthKind::kDisparity, RampAnd(2, 60, {-1}, false, {}, 100)), IsEmpty());
  // The near end of relative maps, and two planes.
  EXPECT_THAT(SuspectsIn(DepthKind::kInverse, RampAnd(20, 90, {255}, true, 255)), IsEmpty());
  EXPECT_THAT(SuspectsIn(DepthKind::kDisparity, RampAnd(0, 0, {5})), IsEmpty());
  EXPECT_THAT(SuspectsIn(DepthKind::kDisparity, RampAnd(0, 0, {65535})), IsEmpty());
  // A few pixels are noise, and a map of one value has no scale.
  RawDepthMap few = RampAnd(500, 1200, {9999}, false, std::nullopt, 3);
  EXPECT_THAT(MarkHoles(kZ, {}, &few).suspects, IsEmpty());
  RawDepthMap one = RowOf(std::vector<float>(100, 9999));
  EXPECT_THAT(MarkHoles(kZ, {}, &one).suspects, IsEmpty());
}

TEST(DepthHoles, AStatedMarkIsNoSuspect) {
  HoleRules rules;
  rules.hole_values = {9999};
  EXPECT_TRUE(SuspectsIn(DepthKind::kZ, RampAnd(500, 1200, {9999}), rules).empty());
  HoleRules value;
  value.largest_is_value = true;
  EXPECT_TRUE(SuspectsIn(DepthKind::kZ, RampAnd(50, 120, {255}, true, 255), value).empty());
}

TEST(DepthHoles, WrongRulesAndSizesAreRefused) {
  HoleRules rules;
  rules.hole_values = {std::nan("")};
  RawDepthMap map = RowOf({1, 2});
  EXPECT_THAT(ErrorOf([&] { MarkHoles(DepthKind::kZ, rules, &map); }), HasSubstr("hole_values"));
  map.values.pop_back();
  EXPECT_THAT(ErrorOf([&] { MarkHoles(DepthKind::kZ, {}, &map); }), HasSubstr("1 values for 2x1"));
}

}  // namespace
}  // namespace thicklens::model
