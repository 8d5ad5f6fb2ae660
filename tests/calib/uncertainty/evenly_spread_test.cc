#include "calib/uncertainty/evenly_spread.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <vector>

namespace thicklens::calib {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;

TEST(EvenlySpread, TakesAllOfAFew) { EXPECT_THAT(EvenlySpread(3, 1, 3), ElementsAre(0, 1, 2)); }

TEST(EvenlySpread, TakesEverySoManiethOfMany) {
  EXPECT_THAT(EvenlySpread(7, 4, 3), ElementsAre(1, 4));
  EXPECT_THAT(EvenlySpread(7, 3, 4), ElementsAre(1, 3, 5));
  EXPECT_THAT(EvenlySpread(4, 3, 3), ElementsAre(1, 3));
}

TEST(EvenlySpread, NeverTakesMoreNorLeavesOutTheOneThatIsKept) {
  for (std::size_t count = 1; count < 40; ++count) {
    for (std::size_t kept = 0; kept < count; ++kept) {
      for (std::size_t most = 1; most < 12; ++most) {
        const std::vector<std::size_t> spread = EvenlySpread(count, kept, most);
        EXPECT_THAT(spread, Contains(kept));
        EXPECT_LE(spread.size(), most);
        // At least half of the requested number is returned: no step is wider than necessary.
        EXPECT_GE(2 * spread.size() + 1, std::min(count, most));
      }
    }
  }
}

}  // namespace
}  // namespace thicklens::calib
