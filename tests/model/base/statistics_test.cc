#include "thicklens/base/statistics.h"

#include <gtest/gtest.h>

namespace thicklens {
namespace {

TEST(Median, IsTheMiddleOne) {
  EXPECT_EQ(Median({5, -1, 3}), 3);
  EXPECT_EQ(Median({2}), 2);
}

TEST(Median, OfAnEvenNumberIsTheUpperOfTwo) { EXPECT_EQ(Median({4, 1, 3, 2}), 3); }

TEST(Median, OfNothingIsZero) { EXPECT_EQ(Median({}), 0); }

}  // namespace
}  // namespace thicklens
