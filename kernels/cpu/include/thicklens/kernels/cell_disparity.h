#ifndef THICKLENS_KERNELS_CELL_DISPARITY_H_
#define THICKLENS_KERNELS_CELL_DISPARITY_H_

#include <cstdint>
#include <limits>

namespace thicklens::kernels {

// Distance from a shape, px, within which a sample still belongs to it. It is larger than the
// rounding of float disparities, so that samples on the outer border are not lost.
constexpr float kEdgeTolerancePx = 1e-5F;

// A corner of a cell as seen from a sample.
struct Corner {
  float x, y;       // px
  float disparity;  // disparity of the corner's pixel
};

// These functions take and return values: unlike std::min, their loops become vector instructions.
inline __attribute__((always_inline)) float Least(float a, float b) { return a < b ? a : b; }
inline __attribute__((always_inline)) float Most(float a, float b) { return a > b ? a : b; }
// Clamps to a number from 0 to `last`, whatever x is.
inline __attribute__((always_inline)) std::int32_t Cut(float x, std::int32_t last) {
  return static_cast<std::int32_t>(Most(Least(x, static_cast<float>(last)), 0));
}

// Twice the signed area of p, q and the sample.
inline __attribute__((always_inline)) float Edge(const Corner& p, const Corner& q) {
  return p.x * q.y - q.x * p.y;
}

// Returns the disparity at the sample, interpolated linearly in one of the two triangles on both
// sides of the diagonal from the top left (00) to the bottom right corner, or -infinity if the
// sample is outside of them. Neither triangle may be flipped or degenerate.
inline __attribute__((always_inline)) float CellDisparity(const Corner& p00, const Corner& p10,
                                                          const Corner& p01, const Corner& p11) {
  const float beside_diagonal = Edge(p00, p11);
  const bool above = beside_diagonal <= 0;
  const Corner p{above ? p10.x : p01.x, above ? p10.y : p01.y,
                 above ? p10.disparity : p01.disparity};
  // Each weight is twice the area of the triangle that the sample spans with the opposite edge.
  const float edge_00 = Edge(p, p11);
  const float edge_11 = Edge(p00, p);
  const float share_00 = above ? edge_00 : -edge_00;
  const float share_11 = above ? edge_11 : -edge_11;
  const float share_p = above ? -beside_diagonal : beside_diagonal;
  // The clamped weights keep the disparity from being extrapolated.
  const float inside_00 = Most(share_00, 0);
  const float inside_11 = Most(share_11, 0);
  const float disparity = p00.disparity + (share_p * (p.disparity - p00.disparity) +
                                           inside_11 * (p11.disparity - p00.disparity)) /
                                              (inside_00 + share_p + inside_11);
  return Least(share_00, share_11) >= -kEdgeTolerancePx ? disparity
                                                        : -std::numeric_limits<float>::infinity();
}

// A row of pixels: their positions in the view, px from the pixel in the centre view, and their
// disparities.
struct Corners {
  const float* offset_x;   // to the right, px
  const float* offset_y;   // down, px
  const float* disparity;  // in the unit of the map
};

// Disparity of the cell between the pixels x and x + 1 of two rows, at the sample (dx, dy) from its
// top left pixel.
inline __attribute__((always_inline)) float CellDisparity(const Corners& upper,
                                                          const Corners& lower, std::int32_t x,
                                                          float dx, float dy) {
  const float dx_right = dx - 1;
  const float dy_lower = dy - 1;
  return CellDisparity(
      {upper.offset_x[x] - dx, upper.offset_y[x] - dy, upper.disparity[x]},
      {upper.offset_x[x + 1] - dx_right, upper.offset_y[x + 1] - dy, upper.disparity[x + 1]},
      {lower.offset_x[x] - dx, lower.offset_y[x] - dy_lower, lower.disparity[x]},
      {lower.offset_x[x + 1] - dx_right, lower.offset_y[x + 1] - dy_lower, lower.disparity[x + 1]});
}

// Bounds of a row of pixels, as whole numbers relative to the pixel: the first sample that is not
// left of (above) the pixel's position in the view, and the last one that is not right of (below)
// it, within the tolerance.
struct Bounds {
  const float* first_x;  // first sample across
  const float* last_x;   // last sample across
  const float* first_y;  // first sample down
  const float* last_y;   // last sample down
};

// A row of a view, and the size of the view.
struct ViewRow {
  int y;                    // index of the row
  int width_px, height_px;  // of the view
};

// Range of samples relative to the top left pixel of a cell, inclusive; empty if left > right or
// above > below.
struct Rectangle {
  float left, right, above, below;  // px from the pixel; right and below are included
};

// Returns the range around the cell between the pixels x and x + 1 of the row and the next row,
// clipped to the view.
inline __attribute__((always_inline)) Rectangle RectangleOf(const Bounds& upper,
                                                            const Bounds& lower, const ViewRow& row,
                                                            std::int32_t x) {
  return {Most(Least(Least(upper.first_x[x], lower.first_x[x]),
                     Least(upper.first_x[x + 1], lower.first_x[x + 1]) + 1),
               static_cast<float>(-x)),
          Least(Most(Most(upper.last_x[x], lower.last_x[x]),
                     Most(upper.last_x[x + 1], lower.last_x[x + 1]) + 1),
                static_cast<float>(row.width_px - 1 - x)),
          Most(Least(Least(upper.first_y[x], upper.first_y[x + 1]),
                     Least(lower.first_y[x], lower.first_y[x + 1]) + 1),
               static_cast<float>(-row.y)),
          Least(Most(Most(upper.last_y[x], upper.last_y[x + 1]),
                     Most(lower.last_y[x], lower.last_y[x + 1]) + 1),
                static_cast<float>(row.height_px - 1 - row.y))};
}

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_CELL_DISPARITY_H_
