#include "thicklens/kernels/product_row.h"

#include <algorithm>
#include <cmath>

#include "kernels/cpu/processor.h"
#include "thicklens/kernels/cell_disparity.h"

namespace thicklens::kernels {
namespace {

// The loop gets the processor's own vector instructions from the caller that it is inlined into; it
// has no branches, so that it can be vectorised. NaN fails every comparison, and a number is
// checked before it is clamped for an index.
inline __attribute__((always_inline)) void Check(const ProductRow& given,
                                                 std::int32_t* is_product) {
  const ProductRow row = given;
  const auto last_x = static_cast<float>(row.width_px - 1);
  const auto last_y = static_cast<float>(row.height_px - 1);
  // No two of the arrays overlap.
#pragma GCC ivdep
  for (std::int32_t x = row.first_x; x < row.last_x; ++x) {
    const float disparity = row.disparity[x];
    const float source_x = row.shift_x * disparity;
    const float source_y = row.shift_y * disparity;
    const float at_y = static_cast<float>(row.y) + row.down[x];
    const std::int32_t y0 = Cut(at_y, row.height_px - 1);
    const std::int32_t y1 =
        std::min(y0 + (at_y > static_cast<float>(y0) ? 1 : 0), row.height_px - 1);
    const float upper = row.across[y0 * row.width_px + x];
    const float lower = row.across[y1 * row.width_px + x];
    const float upper_x = static_cast<float>(x) + upper;
    const float lower_x = static_cast<float>(x) + lower;
    const std::int32_t cell = y0 * row.width_px + Cut(upper_x, row.width_px - 1);
    const float miss_y = std::abs(row.down[x] - source_y);
    const float miss_x = Most(std::abs(upper - source_x), std::abs(lower - source_x));
    const float past_y = Most(-at_y, at_y - last_y);
    const float past_x = Most(Most(-upper_x, upper_x - last_x), Most(-lower_x, lower_x - last_x));
    const float off_surface = Most(disparity - row.lowest[cell], row.highest[cell] - disparity);
    const float too_much =
        Most(Most(Most(miss_x, miss_y) - row.tolerance_px, off_surface - row.same_surface),
             Most(past_x, past_y));
    // The result of Most for NaN depends on the order of its arguments.
    const float number = (source_y + row.down[x]) + (upper + lower);
    is_product[x] &= Most(too_much, number - number) <= 0 ? 1 : 0;
  }
}

#if defined(__x86_64__)

__attribute__((target("avx2"))) void CheckAvx2(const ProductRow& row, std::int32_t* is_product) {
  Check(row, is_product);
}

#endif

}  // namespace

void CheckProducts(const ProductRow& row, std::int32_t* is_product) {
#if defined(__x86_64__)
  if (HasAvx2()) return CheckAvx2(row, is_product);
#endif
  Check(row, is_product);
}

}  // namespace thicklens::kernels
