// Tests the causes that are named for a map whose depths are impossible.
#include "tools/interface/depth_causes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

namespace thicklens {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

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

TEST(DepthCauses, NamesARelativeMapOfEachScale) {
  for (const float full_scale : {1.0F, 255.0F, 65535.0F}) {
    EXPECT_THAT(CauseOf(MapWith({0, 0.4F * full_scale, full_scale})),
                AllOf(HasSubstr("relative map"), HasSubstr("<depth.meaning.kind> inverse with "
                                                           "<depth.near_mm> and <depth.far_mm>")));
  }
  // A unit that is wrong by 1000, and a plane.
  EXPECT_THAT(CauseOf(MapWith({0.5F, 0.7F, 0.95F})), IsEmpty());
  EXPECT_THAT(CauseOf(MapWith({0.8F, 0.8F})), IsEmpty());
  EXPECT_THAT(CauseOf(MapWith({800, 1200, 2000})), IsEmpty());
}

TEST(DepthCauses, NamesAnotherSignAndItsRemedy) {
  EXPECT_THAT(CauseOf(MapWith({-500, -600, -700, 0, 1})),
              AllOf(HasSubstr("3 of its values are negative and 1 positive"),
                    HasSubstr("numpy.save('depth.npy', -depth)")));
}

TEST(DepthCauses, NamesCompressionBeforeARelativeMap) {
  DepthMap map = MapWith({0, 0, 1, 3, 60, 120, 255});
  map.is_lossy = true;
  EXPECT_THAT(CauseOf(map), AllOf(HasSubstr("compressed with losses"), HasSubstr("2 pixels have")));
  map.values = {50, 60, 120};
  EXPECT_THAT(CauseOf(map), IsEmpty());
}

TEST(DepthCauses, NamesValuesBeyondTheOneOfTheNearDepth) {
  DepthMeaning meaning{DepthKind::kInverse};
  meaning.inverse_scale_dpt = 1.53;  // per 1
  meaning.inverse_offset_dpt = 0.25;
  DepthMap map = MapWith({0, 100, 255}, meaning);
  EXPECT_THAT(CauseOf(map), IsEmpty());  // a scale of the user's own
  map.near_value = 1;
  EXPECT_THAT(CauseOf(map),
              AllOf(HasSubstr("go up to 255"), HasSubstr("1 is the value of the near depth"),
                    HasSubstr("<depth.meaning.inverse_scale_dpt> 0.006 and "
                              "<depth.meaning.inverse_offset_dpt> 0.25")));
  map.values = {0, 0.5F, 1};
  EXPECT_THAT(CauseOf(map), IsEmpty());
}

}  // namespace
}  // namespace thicklens
