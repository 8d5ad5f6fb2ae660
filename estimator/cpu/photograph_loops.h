#ifndef THICKLENS_ESTIMATOR_CPU_PHOTOGRAPH_LOOPS_H_
#define THICKLENS_ESTIMATOR_CPU_PHOTOGRAPH_LOOPS_H_

#include <array>
#include <cstddef>
#include <vector>

namespace thicklens::estimator {

// The innermost loops of H on the grid, between a row of the samples of views and rows of the
// photograph.

// One ray of neighbouring pixels: pixel x gets weight * irradiance * ray of the sample
// x + `sample_of_first` of the row.
template <typename Real>
struct PixelTap {
  Real weight = 0;
  std::size_t view_start = 0;  // of the view's rays after those of the first in its row of views
  std::ptrdiff_t sample_of_first = 0;
  const float* irradiance = nullptr;  // of the view's samples; null, then of all taps: 1
};

// A row of the photograph that gets `share` of a row of rays.
template <typename Real>
struct PixelRow {
  Real* pixels = nullptr;  // null: there is none
  Real share = 0;
};

// pixels[x] += share * (sum over the taps), begin <= x < end, of each row. `rays`: those of a row
// of views; `row_start`: the first sample of the row in each of them.
template <typename Real>
void AddTaps(const std::vector<PixelTap<Real>>& taps, const Real* rays, std::size_t row_start,
             std::size_t begin, std::size_t end, const std::array<PixelRow<Real>, 2>& rows);

// A pixel that a ray lands on; of neighbouring rays, of the first.
template <typename Real>
struct RayPixel {
  Real weight = 0;
  const Real* pixel = nullptr;
};

// rays[i] += irradiance[i] * (sum over the pixels, one to four, of weight * pixel[i]), i < count;
// irradiance may be null: 1.
template <typename Real>
void AddPixels(const std::vector<RayPixel<Real>>& pixels, const float* irradiance,
               std::size_t count, Real* rays);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_CPU_PHOTOGRAPH_LOOPS_H_
