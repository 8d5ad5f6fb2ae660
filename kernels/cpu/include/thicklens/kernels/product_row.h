#ifndef THICKLENS_KERNELS_PRODUCT_ROW_H_
#define THICKLENS_KERNELS_PRODUCT_ROW_H_

#include <cstdint>

#include "thicklens/base/export.h"

namespace thicklens::kernels {

// The rays of one view through one row of a photograph's pixels, and where the axes of a separable
// fan put these rays. No index of a pixel may exceed 2^31.
struct ProductRow {
  int y = 0, width_px = 0, height_px = 0;  // index of the row; size of the photograph, px
  int first_x = 0, last_x = 0;             // the pixels to check, last_x excluded
  // Disparities of the row's rays; NaN fails the check. The ray of a pixel comes from the point at
  // shift * disparity, px, from the pixel.
  const float* disparity = nullptr;
  float shift_x = 0, shift_y = 0;  // px per unit of disparity
  // Distance, px, to that point for the view's position on the axes: `down` for the row's pixels,
  // `across` for all pixels of the photograph. NaN where the axis cannot be used.
  const float* down = nullptr;
  const float* across = nullptr;  // of all pixels of the photograph
  float tolerance_px = 0;         // largest misplacement of a ray, px
  // Minimum and maximum disparity of the 2 x 2 pixels to the right of and below each pixel of the
  // photograph, and the allowed difference from the ray's disparity.
  const float* lowest = nullptr;
  const float* highest = nullptr;  // maximum disparity
  float same_surface = 0;          // allowed difference, in the unit of the disparity
};

// Sets is_product[x] to 0 where the separable fan misplaces the ray or reads beyond the photograph
// or off the ray's surface. The result is the same on every processor.
THICKLENS_EXPORT void CheckProducts(const ProductRow& row, std::int32_t* is_product);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_PRODUCT_ROW_H_
