#ifndef THICKLENS_ESTIMATOR_CPU_PRODUCT_ROW_H_
#define THICKLENS_ESTIMATOR_CPU_PRODUCT_ROW_H_

#include <cstdint>

namespace thicklens::estimator {

// The rays of one view through one row of a photograph's pixels, and what the axes of a fan that is
// a product have in their place. No index of a pixel may exceed 2^31.
struct ProductRow {
  int y = 0, width_px = 0, height_px = 0;
  int first_x = 0, last_x = 0;  // what is looked at: up to before last_x
  // Of the row's rays: NaN fails; the way to the source is shift * disparity, px.
  const float* disparity = nullptr;
  float shift_x = 0, shift_y = 0;
  // Px to the source at the view's position on the axes, NaN where the axis cannot be used: of the
  // row's pixels, and of all of the picture's.
  const float* down = nullptr;
  const float* across = nullptr;
  float tolerance_px = 0;
  // The disparities of the 2 x 2 pixels from each of the picture's to the right and down, and by
  // how much they may differ from the ray's.
  const float* lowest = nullptr;
  const float* highest = nullptr;
  float same_surface = 0;
};

// Sets is_product[x] to 0 where the product misplaces the ray or reads past the picture or off the
// ray's surface. The same on every processor.
void CheckProducts(const ProductRow& row, std::int32_t* is_product);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_CPU_PRODUCT_ROW_H_
