#ifndef THICKLENS_KERNELS_PHOTOGRAPH_LOOPS_H_
#define THICKLENS_KERNELS_PHOTOGRAPH_LOOPS_H_

#include <array>
#include <cstddef>
#include <vector>

#include "thicklens/base/export.h"

namespace thicklens::kernels {

// The innermost loops of H on the grid, between a row of the samples of views and rows of the
// photograph.

// One ray for each of several neighbouring pixels: pixel x gets weight * irradiance * ray of the
// sample x + `sample_of_first` of the row.
template <typename Real>
struct PixelTap {
  Real weight = 0;  // weight of the ray
  // start of the view's rays, after those of the first view in its row of views
  std::size_t view_start = 0;
  std::ptrdiff_t sample_of_first = 0;  // sample of the row for pixel 0
  const float* irradiance = nullptr;   // of the view's samples; null, then for all taps: 1
};

// A row of the photograph that gets `share` of a row of rays.
template <typename Real>
struct SharedRow {
  Real* pixels = nullptr;  // null: there is none
  Real share = 0;          // share of the row
};

// Adds to each row pixels[x] += share * (sum over the taps) for begin <= x < end. `rays` are the
// rays of a row of views; `row_start` is the first sample of the row in each view.
template <typename Real>
THICKLENS_EXPORT void AddTaps(const std::vector<PixelTap<Real>>& taps, const Real* rays,
                              std::size_t row_start, std::size_t begin, std::size_t end,
                              const std::array<SharedRow<Real>, 2>& rows);

// A pixel that a ray lands on; for neighbouring rays, the pixel of the first ray.
template <typename Real>
struct RayPixel {
  Real weight = 0;              // weight of the pixel
  const Real* pixel = nullptr;  // pixel of ray 0
};

// Adds rays[i] += irradiance[i] * (sum over the pixels, one to four, of weight * pixel[i]) for i <
// count. `irradiance` may be null and is then 1.
template <typename Real>
THICKLENS_EXPORT void AddPixels(const std::vector<RayPixel<Real>>& pixels, const float* irradiance,
                                std::size_t count, Real* rays);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_PHOTOGRAPH_LOOPS_H_
