// An iteration that diverged gives no answer.
#include "thicklens/base/residual_guard.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "thicklens/base/error.h"

namespace thicklens {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

TEST(ResidualGuard, RefusesWhatIsFarWorseThanNothing) {
  EXPECT_NO_THROW(RequireProgress("grid", 0, 3, ""));
  EXPECT_NO_THROW(RequireProgress("grid", 9.9, 3, ""));
  for (const double lost : {10.0, 11.0, HUGE_VAL, kNaN}) {
    EXPECT_THROW(RequireProgress("grid", lost, 3, ""), Error) << lost;
  }
  try {
    RequireProgress("grid", 11, 892, "allow more");
  } catch (const Error& error) {
    EXPECT_THAT(
        error.what(),
        ::testing::HasSubstr(
            "grid: the iterations diverged: after 892 of them the relative residual is 11"));
  }
}

TEST(ResidualGuard, NoNumberIsTheLargestResidual) {
  EXPECT_EQ(LargerResidual(1, 2), 2);
  EXPECT_EQ(LargerResidual(2, 1), 2);
  EXPECT_TRUE(std::isnan(LargerResidual(kNaN, 1)));
  EXPECT_TRUE(std::isnan(LargerResidual(1, kNaN)));
}

}  // namespace
}  // namespace thicklens
