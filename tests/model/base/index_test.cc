#include "thicklens/base/index.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>

namespace thicklens {
namespace {

TEST(Index, ProductsOfSizesDoNotOverflow) {
  const int width_px = 70000, height_px = 70000;
  EXPECT_EQ(Index(width_px) * Index(height_px), std::size_t{4900000000});
}

TEST(Index, KeepsPositionsBeyondTheRangeOfInt) {
  EXPECT_EQ(Index(std::int64_t{1} << 40), std::size_t{1} << 40);
}

}  // namespace
}  // namespace thicklens
