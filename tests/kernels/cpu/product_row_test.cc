// Whole rows of rays are compared with a plain check of one ray at a time.
#include "thicklens/kernels/product_row.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

namespace thicklens::kernels {
namespace {

constexpr int kWidth = 61, kHeight = 23;

std::size_t At(int x, int y) { return static_cast<std::size_t>(y * kWidth + x); }

bool IsRight(const ProductRow& row, int x) {
  const float disparity = row.disparity[x], down = row.down[x];
  if (std::isnan(disparity) || std::isnan(down)) return false;
  if (std::abs(down - row.shift_y * disparity) > row.tolerance_px) return false;
  const float at_y = static_cast<float>(row.y) + down;
  const float above = std::floor(at_y), below = std::ceil(at_y);
  if (above < 0 || below > kHeight - 1) return false;
  for (const float at : {above, below}) {
    const float across = row.across[At(x, static_cast<int>(at))];
    if (std::isnan(across)) return false;
    if (std::abs(across - row.shift_x * disparity) > row.tolerance_px) return false;
    const float at_x = static_cast<float>(x) + across;
    if (std::floor(at_x) < 0 || std::ceil(at_x) > kWidth - 1) return false;
    const std::size_t cell = At(static_cast<int>(std::floor(at_x)), static_cast<int>(at));
    if (at == above && (disparity - row.lowest[cell] > row.same_surface ||
                        row.highest[cell] - disparity > row.same_surface)) {
      return false;
    }
  }
  return true;
}

TEST(ProductRow, IsThatOfEachRay) {
  std::mt19937 engine(6);
  std::uniform_real_distribution<float> uniform(-1, 1);
  std::vector<float> disparity(kWidth), down(kWidth), across(kWidth * kHeight);
  std::vector<float> lowest(across.size()), highest(across.size());
  int right = 0, wrong = 0;
  for (int run = 0; run < 400; ++run) {
    ProductRow row;
    row.y = run % kHeight;
    row.width_px = kWidth;
    row.height_px = kHeight;
    row.first_x = run % 3;
    row.last_x = kWidth - run % 5;
    row.shift_x = 3 * uniform(engine);
    row.shift_y = run % 9 == 0 ? 0 : 3 * uniform(engine);
    row.tolerance_px = 0.2F;
    row.same_surface = 0.3F;
    const auto some = [&](float value, float noise) {
      const float nan = std::numeric_limits<float>::quiet_NaN();
      return uniform(engine) > 0.98F ? nan : value + noise * uniform(engine);
    };
    const float mean = uniform(engine);
    for (float& value : disparity) value = some(mean, 0.01F);
    for (float& value : down) value = some(row.shift_y * mean, row.shift_y == 0 ? 0 : 0.18F);
    for (float& value : across) value = some(row.shift_x * mean, 0.18F);
    for (float& value : lowest) value = mean - 0.15F + 0.16F * uniform(engine);
    for (float& value : highest) value = mean + 0.15F + 0.16F * uniform(engine);
    row.disparity = disparity.data();
    row.down = down.data();
    row.across = across.data();
    row.lowest = lowest.data();
    row.highest = highest.data();
    std::vector<std::int32_t> is_product(kWidth, 1);
    is_product[7] = 0;
    CheckProducts(row, is_product.data());
    for (int x = 0; x < kWidth; ++x) {
      const bool is_looked_at = x >= row.first_x && x < row.last_x;
      const bool expected = x != 7 && (!is_looked_at || IsRight(row, x));
      ASSERT_EQ(is_product[static_cast<std::size_t>(x)], expected ? 1 : 0) << run << ", " << x;
      ++(expected ? right : wrong);
    }
  }
  EXPECT_GT(right, 3500);
  EXPECT_GT(wrong, 3500);
}

}  // namespace
}  // namespace thicklens::kernels
