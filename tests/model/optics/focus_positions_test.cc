// The image distance of a camera whose lens or sensor moves.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "thicklens/base/error.h"
#include "thicklens/model/camera.h"

namespace thicklens::model {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

const FocusPositions kRing = {"mm", {{-1, 59}, {0, 60}, {2, 62.5}}};

TEST(FocusPositions, InterpolatesBetweenPositions) {
  EXPECT_DOUBLE_EQ(kRing.ImageDistanceMm(-1), 59);
  EXPECT_DOUBLE_EQ(kRing.ImageDistanceMm(-0.25), 59.75);
  EXPECT_DOUBLE_EQ(kRing.ImageDistanceMm(0), 60);
  EXPECT_DOUBLE_EQ(kRing.ImageDistanceMm(1), 61.25);
  EXPECT_DOUBLE_EQ(kRing.ImageDistanceMm(2), 62.5);
}

TEST(FocusPositions, KnowsNothingBeyondItsRange) {
  for (const double outside : {-1.01, 2.01, std::numeric_limits<double>::quiet_NaN()}) {
    try {
      kRing.ImageDistanceMm(outside);
      FAIL() << outside;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr("from -1 to 2 mm")));
    }
  }
}

TEST(FocusPositions, MustRiseAndBePossible) {
  std::string why;
  EXPECT_TRUE(kRing.IsValid(&why));
  EXPECT_FALSE((FocusPositions{"mm", {{0, 60}}}.IsValid(&why)));
  EXPECT_THAT(why, HasSubstr("at least 2"));
  EXPECT_FALSE((FocusPositions{"mm", {{0, 60}, {0, 61}}}.IsValid(&why)));
  EXPECT_THAT(why, HasSubstr("must rise"));
  EXPECT_FALSE((FocusPositions{"dpt", {{0, 60}, {1, -1}}}.IsValid(&why)));
  EXPECT_THAT(why, HasSubstr("position 1"));
  EXPECT_FALSE((FocusPositions{"inch", {{0, 60}, {1, 61}}}.IsValid(&why)));
  EXPECT_THAT(why, HasSubstr("inch"));
}

}  // namespace
}  // namespace thicklens::model
