#ifndef THICKLENS_KERNELS_CPU_FILTER_LOOPS_H_
#define THICKLENS_KERNELS_CPU_FILTER_LOOPS_H_

#include <cstddef>
#include <cstdint>

namespace thicklens::kernels {

// The innermost loops of image_filter.h, compiled once for each kind of processor. Their
// arguments are raw memory, because a file that is compiled for one kind of processor must not
// instantiate a function that the linker could use in place of that of another file.

// Weights of consecutive pixels, and the numbers of the first channel to which they apply.
template <typename Real>
struct FilterTerm {
  const Real* weight = nullptr;
  const Real* x = nullptr;
};

// Rows [first, last) of a PixelBlockedCsr.
template <typename Real>
struct RunRange {
  const std::int32_t* pixel = nullptr;
  const std::int64_t* run = nullptr;    // first run of each row
  const std::int32_t* index = nullptr;  // first pixel of each run
  const Real* weight = nullptr;         // kPixelsOfRun weights per run
  std::size_t first = 0, last = 0;
};

constexpr int kMaxChannels = 4;  // maximum number that a loop processes together

template <typename Real>
struct FilterLoops {
  // Computes y[c y_stride + p] = sum_k weight_k[p] x_k[c x_stride + p], p < count, c < channels <=
  // 4; terms are added in their order. `ahead` is the distance behind each weight of the weights
  // that are needed soon (for prefetching).
  void (*sum_terms)(const FilterTerm<Real>* terms, int term_count, std::ptrdiff_t ahead,
                    std::ptrdiff_t x_stride, int channels, int count, Real* y,
                    std::ptrdiff_t y_stride);
  // Computes y(pixel) = sum weight x of each row, for up to 4 channels.
  void (*sum_runs)(const RunRange<Real>& rows, const Real* x, std::ptrdiff_t x_stride, int channels,
                   Real* y, std::ptrdiff_t y_stride);
  // Computes the transposed map: x += weight y(pixel).
  void (*spread_runs)(const RunRange<Real>& rows, const Real* y, std::ptrdiff_t y_stride,
                      int channels, Real* x, std::ptrdiff_t x_stride);
  // Returns the sum of x y w (w may be null: 1).
  double (*dot)(const Real* x, const Real* y, const Real* w, std::size_t count);
};

// The loops for every processor of the architecture.
template <typename Real>
FilterLoops<Real> PlainFilterLoops();
#if defined(__x86_64__)
// The loops with AVX2 and FMA.
template <typename Real>
FilterLoops<Real> Avx2FilterLoops();
#endif
// The fastest of these loops that this processor can run.
template <typename Real>
const FilterLoops<Real>& BestFilterLoops();

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_CPU_FILTER_LOOPS_H_
