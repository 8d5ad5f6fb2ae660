#include "thicklens/base/validity.h"

#include <gtest/gtest.h>

#include <string>

namespace thicklens {
namespace {

TEST(Fail, StoresTheReasonAndIsFalse) {
  std::string why = "nothing";
  EXPECT_FALSE(Fail(&why, "width_px must be > 0"));
  EXPECT_EQ(why, "width_px must be > 0");
}

TEST(Fail, NeedsNoPlaceForTheReason) { EXPECT_FALSE(Fail(nullptr, "width_px must be > 0")); }

}  // namespace
}  // namespace thicklens
