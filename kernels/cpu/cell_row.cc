#include "thicklens/kernels/cell_row.h"

#include "kernels/cpu/processor.h"

namespace thicklens::kernels {
namespace {

// Limit of twice the area of a triangle; it is 1 if the surface is parallel to the image.
constexpr float kSmallPx2 = 0.05F;

inline __attribute__((always_inline)) float Floor(float x) {
  const auto toward_zero = static_cast<float>(static_cast<std::int32_t>(x));
  return toward_zero - (toward_zero > x ? 1.0F : 0.0F);
}

// The loops get the processor's own vector instructions from the caller that they are inlined into.
// Sums and products are rounded alike on all processors.

inline __attribute__((always_inline)) void PlaceAxis(const float* disparity, std::size_t count,
                                                     float shift, float limit_px,
                                                     float* __restrict offset,
                                                     float* __restrict first,
                                                     float* __restrict last) {
  for (std::size_t x = 0; x < count; ++x) {
    offset[x] = Most(-limit_px, Least(limit_px, -shift * disparity[x]));
    last[x] = Floor(offset[x] + kEdgeTolerancePx);
    first[x] = last[x] + (offset[x] - last[x] > kEdgeTolerancePx ? 1.0F : 0.0F);
  }
}

inline __attribute__((always_inline)) void Place(const float* disparity, float shift_x,
                                                 float shift_y, float limit_px, PixelRow* row) {
  const std::size_t count = row->offset_x.size();
  PlaceAxis(disparity, count, shift_x, limit_px, row->offset_x.data(), row->first_x.data(),
            row->last_x.data());
  PlaceAxis(disparity, count, shift_y, limit_px, row->offset_y.data(), row->first_y.data(),
            row->last_y.data());
}

// Twice the area of the triangle at the top right or bottom left of a cell, whichever is smaller.
inline __attribute__((always_inline)) float SmallerArea(const Corners& upper, const Corners& lower,
                                                        std::int32_t x) {
  const float top_x = 1 + (upper.offset_x[x + 1] - upper.offset_x[x]);
  const float top_y = upper.offset_y[x + 1] - upper.offset_y[x];
  const float right_x = lower.offset_x[x + 1] - upper.offset_x[x + 1];
  const float right_y = 1 + (lower.offset_y[x + 1] - upper.offset_y[x + 1]);
  const float bottom_x = 1 + (lower.offset_x[x + 1] - lower.offset_x[x]);
  const float bottom_y = lower.offset_y[x + 1] - lower.offset_y[x];
  const float left_x = lower.offset_x[x] - upper.offset_x[x];
  const float left_y = 1 + (lower.offset_y[x] - upper.offset_y[x]);
  return Least(top_x * right_y - right_x * top_y, bottom_x * left_y - left_x * bottom_y);
}

inline __attribute__((always_inline)) void Sample(const PixelRow& upper, const PixelRow& lower,
                                                  const ViewRow& view, CellRow* cells) {
  const Corners upper_corners = upper.corners();
  const Corners lower_corners = lower.corners();
  const Bounds upper_bounds = upper.bounds();
  const Bounds lower_bounds = lower.bounds();
  const ViewRow row = view;
  CellSamples* const samples = cells->samples.data();
  std::int32_t* const first = cells->first.data();
  std::int32_t* const last = cells->last.data();
  float* const first_disparity = cells->first_disparity.data();
  float* const last_disparity = cells->last_disparity.data();
  const auto top = static_cast<float>(-row.y);
  const auto bottom = static_cast<float>(row.height_px - 1 - row.y);
  // No two of the arrays overlap.
#pragma GCC ivdep
  for (std::int32_t x = 0; x < row.width_px - 1; ++x) {
    const Rectangle around = RectangleOf(upper_bounds, lower_bounds, row, x);
    const float longer = Most(around.right - around.left, around.below - around.above);
    const float shorter = Least(around.right - around.left, around.below - around.above);
    const auto if_two = longer + shorter == 1 ? CellSamples::kTwo : CellSamples::kSeveral;
    const auto if_regular = longer == 0 ? CellSamples::kOne : if_two;
    const auto if_any =
        SmallerArea(upper_corners, lower_corners, x) < kSmallPx2 ? CellSamples::kOdd : if_regular;
    samples[x] = shorter < 0 ? CellSamples::kNone : if_any;
    // The rows are clamped for cells without samples, whose indices are unused but must be numbers.
    const float first_row = Least(around.above, bottom);
    const float last_row = Most(around.below, top);
    first[x] = static_cast<std::int32_t>(first_row) * row.width_px +
               static_cast<std::int32_t>(around.left);
    last[x] = static_cast<std::int32_t>(last_row) * row.width_px +
              static_cast<std::int32_t>(around.right);
    first_disparity[x] = CellDisparity(upper_corners, lower_corners, x, around.left, around.above);
    last_disparity[x] = CellDisparity(upper_corners, lower_corners, x, around.right, around.below);
  }
}

#if defined(__x86_64__)

__attribute__((target("avx2"))) void PlaceAvx2(const float* disparity, float shift_x, float shift_y,
                                               float limit_px, PixelRow* row) {
  Place(disparity, shift_x, shift_y, limit_px, row);
}

__attribute__((target("avx2"))) void SampleAvx2(const PixelRow& upper, const PixelRow& lower,
                                                const ViewRow& view, CellRow* cells) {
  Sample(upper, lower, view, cells);
}

#endif

}  // namespace

PixelRow::PixelRow(std::size_t width_px)
    : offset_x(width_px),
      offset_y(width_px),
      first_x(width_px),
      last_x(width_px),
      first_y(width_px),
      last_y(width_px) {}

CellRow::CellRow(std::size_t width_px)
    : samples(width_px),
      first(width_px),
      last(width_px),
      first_disparity(width_px),
      last_disparity(width_px) {}

void PlacePixels(const float* disparity, float shift_x, float shift_y, float limit_px,
                 PixelRow* row) {
  row->disparity = disparity;
#if defined(__x86_64__)
  if (HasAvx2()) return PlaceAvx2(disparity, shift_x, shift_y, limit_px, row);
#endif
  Place(disparity, shift_x, shift_y, limit_px, row);
}

void SampleCells(const PixelRow& upper, const PixelRow& lower, const ViewRow& view,
                 CellRow* cells) {
#if defined(__x86_64__)
  if (HasAvx2()) return SampleAvx2(upper, lower, view, cells);
#endif
  Sample(upper, lower, view, cells);
}

}  // namespace thicklens::kernels
