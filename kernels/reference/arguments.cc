#include "kernels/reference/arguments.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "thicklens/base/error.h"

namespace thicklens::kernels {
namespace {

// Sums of several such numbers still fit into an int.
constexpr int kLargest = std::numeric_limits<int>::max() / 8;

void CheckRange(const std::string& what, std::int64_t value, std::int64_t low, std::int64_t high) {
  if (value < low || value > high) {
    throw Error(fmt::format("{} is {}: it must be {} to {}", what, value, low, high));
  }
}

void CheckShifts(const char* what, const std::vector<int>& shifts, int count) {
  CheckSize(fmt::format("block: {}", what), shifts.size(), static_cast<std::size_t>(count));
  for (const int shift : shifts)
    CheckRange(fmt::format("block: {}", what), shift, -kLargest, kLargest);
}

void CheckFractions(const char* what, const std::vector<double>& fractions, int count) {
  CheckSize(fmt::format("block: {}", what), fractions.size(), static_cast<std::size_t>(count));
  for (const double fraction : fractions) {
    // The limit is slightly above one half, for callers that subtract a rounded number.
    if (!(std::abs(fraction) <= 0.5 + 1e-6)) {
      throw Error(fmt::format("block: {} is {}: it must be -1/2 to 1/2", what, fraction));
    }
  }
}

}  // namespace

void CheckBlock(const BlockGeometry& block) {
  CheckRange("block: first_x", block.first_x, -kLargest, kLargest);
  CheckRange("block: first_y", block.first_y, -kLargest, kLargest);
  CheckRange("block: width_px", block.width_px, 0, kLargest);
  CheckRange("block: height_px", block.height_px, 0, kLargest);
  CheckRange("block: s_count", block.s_count, 0, kLargest);
  CheckRange("block: t_count", block.t_count, 0, kLargest);
  CheckRange("block: u_count", block.u_count, 0, 1 << 14);
  CheckRange("block: v_count", block.v_count, 0, 1 << 14);
  CheckRange("block: number of pixels", std::int64_t{block.width_px} * block.height_px, 0,
             kLargest);
  CheckShifts("s_shift", block.s_shift, block.u_count);
  CheckShifts("t_shift", block.t_shift, block.v_count);
  CheckFractions("s_fraction", block.s_fraction, block.u_count);
  CheckFractions("t_fraction", block.t_fraction, block.v_count);
  CheckSize("block: view_weight", block.view_weight.size(),
            static_cast<std::size_t>(block.views()));
  for (const double weight : block.view_weight) {
    if (!(weight >= 0) || !std::isfinite(weight)) {
      throw Error(fmt::format("block: view_weight is {}: it must be finite and >= 0", weight));
    }
  }
}

void CheckRayNumbers(const BlockGeometry& block, int rows_per_ray) {
  CheckBlock(block);
  CheckRange("block: number of rays", std::int64_t{block.pixels()} * block.views(), 0,
             std::numeric_limits<std::int32_t>::max() / rows_per_ray);
}

void CheckSize(const std::string& what, std::size_t size, std::size_t right) {
  if (size != right) {
    throw Error(fmt::format("{} has {} elements: it must have {}", what, size, right));
  }
}

void CheckSlopes(const BlockGeometry& block, int rows_per_ray, std::size_t slopes_u,
                 std::size_t slopes_v) {
  CheckRayNumbers(block, rows_per_ray);
  CheckSize("slope_u", slopes_u, static_cast<std::size_t>(block.rays()));
  CheckSize("slope_v", slopes_v, static_cast<std::size_t>(block.rays()));
}

void CheckRays(const BlockGeometry& block, Splat splat, const std::vector<std::int32_t>& rays) {
  CheckSize(
      "list of rays", rays.size(),
      static_cast<std::size_t>(RaySlots(block, splat)) * static_cast<std::size_t>(block.pixels()));
  for (const std::int32_t ray : rays) {
    if (ray < -1 || ray >= block.rays()) {
      throw Error(fmt::format("list of rays: {} is not a ray of the block: it must be -1 to {}",
                              ray, block.rays() - 1));
    }
  }
}

template <typename Real>
void CheckCsr(const CsrMatrix<Real>& a) {
  if (a.rows == 0 && a.row_start.empty()) {
    CheckSize("empty sparse matrix: column", a.column.size(), 0);
  } else {
    CheckSize("sparse matrix: row_start", a.row_start.size(), static_cast<std::size_t>(a.rows) + 1);
    CheckSize("sparse matrix: column", a.column.size(), static_cast<std::size_t>(a.entries()));
  }
  CheckSize("sparse matrix: value", a.value.size(), a.column.size());
}
template void CheckCsr(const CsrMatrix<float>&);
template void CheckCsr(const CsrMatrix<double>&);

void CheckPattern(const CsrPattern& pattern, int rows) {
  if (pattern.rows != rows || pattern.columns != rows) {
    throw Error(fmt::format("pattern of a normal product has {} x {} entries: it must have {} x {}",
                            pattern.rows, pattern.columns, rows, rows));
  }
  if (rows == 0 && pattern.row_start.empty()) return;
  CheckSize("pattern: row_start", pattern.row_start.size(), static_cast<std::size_t>(rows) + 1);
  CheckSize("pattern: column", pattern.column.size(), static_cast<std::size_t>(pattern.entries()));
}

void CheckWhole(const WholeShape& whole) {
  CheckRange("s_count", whole.s_count, 0, kLargest);
  CheckRange("t_count", whole.t_count, 0, kLargest);
  CheckRange("u_count", whole.u_count, 0, 1 << 14);
  CheckRange("v_count", whole.v_count, 0, 1 << 14);
  CheckRange("number of channels", whole.channels, 0, 1 << 14);
  CheckRange("number of samples of a view", std::int64_t{whole.s_count} * whole.t_count, 0,
             kLargest);
}

void CheckAddition(const WholeShape& whole, const BlockGeometry& block, int channel,
                   std::size_t rays) {
  CheckRayNumbers(block, 1);
  if (block.s_count != whole.s_count || block.t_count != whole.t_count ||
      block.u_count != whole.u_count || block.v_count != whole.v_count) {
    throw Error(
        fmt::format("a block of a light field of {} x {} x {} x {} is added to a light field of {} "
                    "x {} x {} x {}: these sizes must be equal",
                    block.s_count, block.t_count, block.u_count, block.v_count, whole.s_count,
                    whole.t_count, whole.u_count, whole.v_count));
  }
  if (channel < 0 || channel >= whole.channels) {
    throw Error(fmt::format("a block is added to channel {}: it must be 0 to {}", channel,
                            whole.channels - 1));
  }
  CheckSize("block's rays", rays, static_cast<std::size_t>(block.rays()));
}

}  // namespace thicklens::kernels
