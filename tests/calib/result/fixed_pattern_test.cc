#include "thicklens/calib/fixed_pattern.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace thicklens::calib {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(FixedPatternWords, NothingIsSaidWhereNothingWasRemoved) {
  FixedPattern pattern;
  EXPECT_FALSE(pattern.Removed());
  EXPECT_EQ(pattern.InWords(), "");
  pattern.measured = true;
  pattern.corner_stops = model::Estimate{-0.02, 0.03};
  EXPECT_FALSE(pattern.Removed());
  EXPECT_EQ(pattern.InWords(), "") << "a shading that was measured and left as it is";
}

TEST(FixedPatternWords, CountAndAreaAreTold) {
  FixedPattern pattern;
  pattern.corner_stops = model::Estimate{-1.97, 0.04};
  pattern.shading_removed = true;
  pattern.specks = 25;
  pattern.deepest_speck = 0.41;
  pattern.divided_share = 0.016;
  EXPECT_TRUE(pattern.Removed());
  EXPECT_THAT(pattern.InWords(),
              AllOf(HasSubstr("-1.97 +- 0.04 stops"), HasSubstr("25 specks"), HasSubstr("41 %"),
                    HasSubstr("cover 1.6 % of the region"), Not(HasSubstr("filled"))));
  pattern = {};
  pattern.defective_px = 1;
  pattern.filled_share = 0.0001;
  EXPECT_THAT(pattern.InWords(),
              AllOf(HasSubstr("1 defective pixel;"), HasSubstr("of which 0.01 % was filled")));
}

}  // namespace
}  // namespace thicklens::calib
