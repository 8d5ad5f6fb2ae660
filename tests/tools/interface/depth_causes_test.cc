// Tests the causes that are named for a map whose depths are impossible.
#include "tools/interface/depth_causes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace thicklens {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

const DepthMeaning kMillimetres{DepthKind::kZ, LengthUnit::kMillimetre};

DepthMap MapWith(std::vector<float> values, const DepthMeaning& meaning = kMillimetres) {
  DepthMap map;
  map.width_px = static_cast<int>(values.size());
  map.height_px = 1;
  map.values = std::move(values);
  map.meaning = meaning;
  return map;
}

std::string CauseOf(const DepthMap& map) {
  RunControl control;
  control.option_name = [](const std::string& field) { return "<" + field + ">"; };
  return CauseInMap(map, RunScope(control));
}

// `count` values that go evenly from `first` to `last`.
std::vector<float> DepthRamp(float first, float last, int count) {
  std::vector<float> values;
  for (int i = 0; i < count; ++i)
    values.push_back(first +
                     (last - first) * static_cast<float>(i) / static_cast<float>(count - 1));
  return values;
}

std::vector<float> WithMark(std::vector<float> values, int count, float mark) {
  values.insert(values.end(), static_cast<std::size_t>(count), mark);
  return values;
}

TEST(DepthCauses, NamesARelativeMapOfEachScale) {
  for (const float full_scale : {1.0F, 255.0F, 65535.0F}) {
    EXPECT_THAT(CauseOf(MapWith({0, 0.05F * full_scale, 0.4F * full_scale, full_scale})),
                AllOf(HasSubstr("relative map"), HasSubstr("<depth.meaning.kind> inverse with "
                                                           "<depth.near_mm> and <depth.far_mm>")));
  }
  // A unit that is wrong by 1000, and a plane.
  EXPECT_THAT(CauseOf(MapWith({0.5F, 0.7F, 0.95F})), IsEmpty());
  EXPECT_THAT(CauseOf(MapWith({0.8F, 0.8F})), IsEmpty());
  EXPECT_THAT(CauseOf(MapWith({800, 1200, 2000})), IsEmpty());
}

// 0 and the largest of the type mean "no depth" and span nothing; neither does a mark that nobody
// stated.
TEST(DepthCauses, HolesAndMarksDoNotSpanARelativeMap) {
  DepthMap map = MapWith(WithMark(WithMark(DepthRamp(860, 3920, 50), 9, 0), 9, 65535));
  map.is_integer = true;
  map.largest_of_type = 65535;
  EXPECT_THAT(CauseOf(map), IsEmpty());
  map.largest_of_type.reset();
  EXPECT_THAT(CauseOf(map), IsEmpty());
  map.values = WithMark(DepthRamp(20, 120, 50), 18, 250);
  map.holes.hole_values = {250};
  EXPECT_THAT(CauseOf(map), IsEmpty());
}

// A flat nearest surface has the largest value of the type in many pixels, which are holes of a map
// in mm. The others go beyond half of it, as no such map does.
TEST(DepthCauses, TheLargestOfTheTypeMayBeTheNearestSurface) {
  DepthMap map = MapWith(WithMark(DepthRamp(100, 53807, 50), 9, 65535));
  map.is_integer = true;
  map.largest_of_type = 65535;
  EXPECT_THAT(CauseOf(map), HasSubstr("from 100 to 6.554e+04 span 0 to 65535, as those of a rel"));
  map.holes.hole_values = {65535};
  EXPECT_THAT(CauseOf(map), IsEmpty());
}

TEST(DepthCauses, NamesAnotherSignAndItsRemedy) {
  EXPECT_THAT(CauseOf(MapWith({-500, -600, -700, -800, 0, 1})),
              AllOf(HasSubstr("4 of its values are negative and 1 positive"),
                    HasSubstr("numpy.save('depth.npy', -depth)")));
  // A plane has one value, and there is no other depth beside it.
  EXPECT_THAT(CauseOf(MapWith({-500, -500, -500})), HasSubstr("-depth)"));
}

TEST(DepthCauses, NegativeMarksAreNoOtherSign) {
  for (const float mark : {-1.0F, -9999.0F}) {
    EXPECT_THAT(CauseOf(MapWith(WithMark(DepthRamp(800, 1040, 38), 62, mark))),
                AllOf(HasSubstr("62 of its values are negative and 38 positive"),
                      HasSubstr(mark == -1 ? "<depth.holes> -1" : "<depth.holes> -9999"),
                      Not(HasSubstr("-depth"))));
  }
  EXPECT_THAT(CauseOf(MapWith(WithMark(WithMark(DepthRamp(800, 1040, 38), 40, -1), 22, -2))),
              HasSubstr("<depth.holes> -1 <depth.holes> -2"));
}

// A ramp from 0 as JPEG has small values beside zeros, as holes have them.
TEST(DepthCauses, NamesARelativeMapBeforeCompression) {
  DepthMap map = MapWith({0, 0, 1, 3, 60, 120, 255});
  map.is_lossy = true;
  const std::string both = CauseOf(map);
  EXPECT_THAT(both, AllOf(HasSubstr("relative map"), HasSubstr("compressed with losses"),
                          HasSubstr("1 pixels beside a 0 have")));
  EXPECT_LT(both.find("relative map"), both.find("compressed with losses"));
}

TEST(DepthCauses, NamesCompressionOnlyBesideZeros) {
  DepthMap map = MapWith({0, 0, 2, 60, 100, 120});
  map.is_lossy = true;
  EXPECT_THAT(CauseOf(map),
              AllOf(StartsWith("the file is compressed with losses"), HasSubstr("does not help")));
  map.values = {0, 0, 60, 2, 100, 120};
  EXPECT_THAT(CauseOf(map), IsEmpty());
  map.values = {50, 60, 120, 130, 140, 150};
  EXPECT_THAT(CauseOf(map), IsEmpty());
}

TEST(DepthCauses, CompressionIsNamedBeforeTheUnit) {
  DepthMap map = MapWith({0, 2, 100});
  map.source = "d.jpg";
  EXPECT_EQ(WithCause(map, "d.jpg: too near; check the unit", "a cause"),
            "d.jpg: too near; check the unit; a cause");
  map.is_lossy = true;
  EXPECT_EQ(WithCause(map, "d.jpg: too near; check the unit", "a cause"),
            "d.jpg: a cause; too near; check the unit");
  EXPECT_EQ(WithCause(map, "too near", "a cause"), "too near; a cause");
}

TEST(DepthCauses, NamesValuesBeyondTheOneOfTheNearDepth) {
  DepthMeaning meaning{DepthKind::kInverse};
  meaning.inverse_scale_dpt = 1.53;  // per 1
  meaning.inverse_offset_dpt = 0.25;
  DepthMap map = MapWith({0, 100, 255}, meaning);
  EXPECT_THAT(CauseOf(map), IsEmpty());  // a scale of the user's own
  map.near_value = 1;
  EXPECT_THAT(CauseOf(map),
              AllOf(HasSubstr("go from 0 to 255"), HasSubstr("1 is the value of the near depth"),
                    HasSubstr("divide the values by 255"),
                    HasSubstr("<depth.meaning.inverse_scale_dpt> 0.006 and "
                              "<depth.meaning.inverse_offset_dpt> 0.25")));
  map.values = {0, 0.5F, 1};
  EXPECT_THAT(CauseOf(map), IsEmpty());
}

// The numbers of a network have no full scale: far is 0.25, near 1.78 dpt, so that the line is
// 1.53/3000 per unit, and 0.25 + 200 x 0.00051 = 0.352 at 0.
TEST(DepthCauses, ValuesWithoutAFullScaleAreScaledByTheirOwnRange) {
  DepthMeaning meaning{DepthKind::kInverse};
  meaning.inverse_scale_dpt = 1.53;
  meaning.inverse_offset_dpt = 0.25;
  DepthMap map = MapWith({-200, 0.5F, 1200, 2800}, meaning);
  map.near_value = 1;
  EXPECT_THAT(
      CauseOf(map),
      AllOf(HasSubstr("by (v - -200)/(2800 - -200)"), HasSubstr("inverse_scale_dpt> 0.00051"),
            HasSubstr("inverse_offset_dpt> 0.352"), Not(HasSubstr("divide"))));
  // Below 0 is beyond the far depth.
  map.values = {-0.5F, 0.1F, 0.3F, 0.5F};
  EXPECT_THAT(CauseOf(map), HasSubstr("go from -0.5 to 0.5"));
}

TEST(DepthCauses, AMarkIsNoFullScale) {
  DepthMap map =
      MapWith(WithMark(DepthRamp(0, 1, 50), 10, 9999), DepthMeaning{DepthKind::kInverse});
  map.near_value = 1;
  EXPECT_THAT(CauseOf(map),
              AllOf(HasSubstr("9999 (10 pixels; <depth.holes> 9999)"), Not(HasSubstr("divide"))));
  map.holes.hole_values = {9999};
  EXPECT_THAT(CauseOf(map), IsEmpty());
  map.holes.hole_values = {};
  map.values = WithMark(DepthRamp(0, 255, 50), 10, 9999);
  EXPECT_THAT(CauseOf(map), HasSubstr("divide the values by 255"));
}

}  // namespace
}  // namespace thicklens
