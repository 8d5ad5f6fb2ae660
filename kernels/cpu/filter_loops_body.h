#ifndef THICKLENS_KERNELS_CPU_FILTER_LOOPS_BODY_H_
#define THICKLENS_KERNELS_CPU_FILTER_LOOPS_BODY_H_

#include <cstddef>
#include <cstdint>

#include "kernels/cpu/filter_loops.h"
#include "thicklens/kernels/image_filter.h"

// The loops of filter_loops.h, for the processor for which the including file is compiled. Each
// including file has its own copy (hence the unnamed namespace).

namespace thicklens::kernels {
namespace {

#if defined(__AVX__)
constexpr int kVectorBytes = 32;
#else
constexpr int kVectorBytes = 16;
#endif

template <typename Real, int kBytes>
struct VectorOf {
  typedef Real Type __attribute__((vector_size(kBytes)));
};

template <typename Vector, typename Real>
inline __attribute__((always_inline)) void Load(const Real* from, Vector* to) {
  __builtin_memcpy(to, from, sizeof(Vector));
}
template <typename Vector, typename Real>
inline __attribute__((always_inline)) void Store(const Vector& from, Real* to) {
  __builtin_memcpy(to, &from, sizeof(Vector));
}

// Computes kVectors vectors of kChannels channels from pixel p on, with all sums in registers.
template <typename Real, int kChannels, int kVectors>
inline __attribute__((always_inline)) void SumGroup(const FilterTerm<Real>* terms, int term_count,
                                                    std::ptrdiff_t ahead, std::ptrdiff_t x_stride,
                                                    int p, Real* y, std::ptrdiff_t y_stride) {
  using Vector = typename VectorOf<Real, kVectorBytes>::Type;
  constexpr int kLanes = kVectorBytes / static_cast<int>(sizeof(Real));
  constexpr int kVectorsOfALine = 64 / kVectorBytes;
  Vector sum[kChannels][kVectors] = {};
  for (int k = 0; k < term_count; ++k) {
    const Real* weight_at = terms[k].weight + p;
    const Real* x_at = terms[k].x + p;
#pragma GCC unroll 4
    for (int v = 0; v < kVectors; v += kVectorsOfALine) {
      __builtin_prefetch(weight_at + ahead + v * kLanes);
    }
#pragma GCC unroll 8
    for (int v = 0; v < kVectors; ++v) {
      Vector weight;
      Load(weight_at + v * kLanes, &weight);
#pragma GCC unroll 4
      for (int c = 0; c < kChannels; ++c) {
        Vector x;
        Load(x_at + c * x_stride + v * kLanes, &x);
        sum[c][v] += weight * x;
      }
    }
  }
#pragma GCC unroll 4
  for (int c = 0; c < kChannels; ++c) {
#pragma GCC unroll 8
    for (int v = 0; v < kVectors; ++v) Store(sum[c][v], y + c * y_stride + p + v * kLanes);
  }
}

template <typename Real, int kChannels>
void SumTermsOf(const FilterTerm<Real>* terms, int term_count, std::ptrdiff_t ahead,
                std::ptrdiff_t x_stride, int count, Real* y, std::ptrdiff_t y_stride) {
  constexpr int kLanes = kVectorBytes / static_cast<int>(sizeof(Real));
  // The sums and a weight fit into 16 registers.
  constexpr int kMax = kChannels == 1 ? 8 : kChannels == 4 ? 2 : 4;
  int p = 0;
  for (; p + kMax * kLanes <= count; p += kMax * kLanes) {
    SumGroup<Real, kChannels, kMax>(terms, term_count, ahead, x_stride, p, y, y_stride);
  }
  // The remaining pixels are computed by vectors that overlap finished pixels; these get the same
  // numbers again.
  while (p < count) {
    const int left = count - p;
    if (left > kLanes && count >= 2 * kLanes) {
      const int from = left < 2 * kLanes ? count - 2 * kLanes : p;
      SumGroup<Real, kChannels, 2>(terms, term_count, ahead, x_stride, from, y, y_stride);
      p = from + 2 * kLanes;
    } else if (count >= kLanes) {
      const int from = left < kLanes ? count - kLanes : p;
      SumGroup<Real, kChannels, 1>(terms, term_count, ahead, x_stride, from, y, y_stride);
      p = from + kLanes;
    } else {
      for (int c = 0; c < kChannels; ++c) {
        Real sum = 0;
        for (int k = 0; k < term_count; ++k) {
          sum += terms[k].weight[p] * terms[k].x[c * x_stride + p];
        }
        y[c * y_stride + p] = sum;
      }
      ++p;
    }
  }
}

template <typename Real>
void SumTerms(const FilterTerm<Real>* terms, int term_count, std::ptrdiff_t ahead,
              std::ptrdiff_t x_stride, int channels, int count, Real* y, std::ptrdiff_t y_stride) {
  switch (channels) {
    case 1:
      return SumTermsOf<Real, 1>(terms, term_count, ahead, x_stride, count, y, y_stride);
    case 2:
      return SumTermsOf<Real, 2>(terms, term_count, ahead, x_stride, count, y, y_stride);
    case 3:
      return SumTermsOf<Real, 3>(terms, term_count, ahead, x_stride, count, y, y_stride);
    default:
      return SumTermsOf<Real, 4>(terms, term_count, ahead, x_stride, count, y, y_stride);
  }
}

template <typename Real, int kChannels>
void SumRunsOf(const RunRange<Real>& rows, const Real* x, std::ptrdiff_t x_stride, Real* y,
               std::ptrdiff_t y_stride) {
  using Vector = typename VectorOf<Real, kVectorBytes>::Type;
  constexpr int kLanes = kVectorBytes / static_cast<int>(sizeof(Real));
  for (std::size_t r = rows.first; r < rows.last; ++r) {
    Vector sum[kChannels] = {};
    const Real* weight = rows.weight + rows.run[r] * kPixelsOfRun;
    for (std::int64_t n = rows.run[r]; n < rows.run[r + 1]; ++n) {
      const Real* from = x + rows.index[n];
#pragma GCC unroll 4
      for (int i = 0; i < kPixelsOfRun; i += kLanes, weight += kLanes, from += kLanes) {
        Vector w;
        Load(weight, &w);
#pragma GCC unroll 4
        for (int c = 0; c < kChannels; ++c) {
          Vector values;
          Load(from + c * x_stride, &values);
          sum[c] += w * values;
        }
      }
    }
    for (int c = 0; c < kChannels; ++c) {
      Real total = 0;
      for (int lane = 0; lane < kLanes; ++lane) total += sum[c][lane];
      y[c * y_stride + rows.pixel[r]] = total;
    }
  }
}

template <typename Real, int kChannels>
inline __attribute__((always_inline)) void SpreadRow(const RunRange<Real>& rows, std::size_t r,
                                                     const Real* y, std::ptrdiff_t y_stride,
                                                     Real* x, std::ptrdiff_t x_stride) {
  using Vector = typename VectorOf<Real, kVectorBytes>::Type;
  constexpr int kLanes = kVectorBytes / static_cast<int>(sizeof(Real));
  Real value[kChannels];
  for (int c = 0; c < kChannels; ++c) value[c] = y[c * y_stride + rows.pixel[r]];
  const Real* weight = rows.weight + rows.run[r] * kPixelsOfRun;
  for (std::int64_t n = rows.run[r]; n < rows.run[r + 1]; ++n) {
    Real* to = x + rows.index[n];
#pragma GCC unroll 4
    for (int i = 0; i < kPixelsOfRun; i += kLanes, weight += kLanes, to += kLanes) {
      // Planes may be a multiple of 4096 bytes apart. A processor then mistakes a read for the
      // previous write, so that everything is read first.
      Vector w, sum[kChannels];
      Load(weight, &w);
#pragma GCC unroll 4
      for (int c = 0; c < kChannels; ++c) Load(to + c * x_stride, &sum[c]);
#pragma GCC unroll 4
      for (int c = 0; c < kChannels; ++c) {
        sum[c] += w * value[c];
        Store(sum[c], to + c * x_stride);
      }
    }
  }
}

// Neighbouring rows reach almost the same pixels. A vector that was just written would be read
// again in two parts, for which the processor waits. The loop therefore alternates between rows
// that are a quarter of all rows apart.
template <typename Real, int kChannels>
void SpreadRunsOf(const RunRange<Real>& rows, const Real* y, std::ptrdiff_t y_stride, Real* x,
                  std::ptrdiff_t x_stride) {
  constexpr std::size_t kTurns = 4;
  const std::size_t apart = (rows.last - rows.first + kTurns - 1) / kTurns;
  for (std::size_t i = 0; i < apart; ++i) {
    for (std::size_t r = rows.first + i; r < rows.last; r += apart) {
      SpreadRow<Real, kChannels>(rows, r, y, y_stride, x, x_stride);
    }
  }
}

template <typename Real>
void SumRuns(const RunRange<Real>& rows, const Real* x, std::ptrdiff_t x_stride, int channels,
             Real* y, std::ptrdiff_t y_stride) {
  switch (channels) {
    case 1:
      return SumRunsOf<Real, 1>(rows, x, x_stride, y, y_stride);
    case 2:
      return SumRunsOf<Real, 2>(rows, x, x_stride, y, y_stride);
    case 3:
      return SumRunsOf<Real, 3>(rows, x, x_stride, y, y_stride);
    default:
      return SumRunsOf<Real, 4>(rows, x, x_stride, y, y_stride);
  }
}

template <typename Real>
void SpreadRuns(const RunRange<Real>& rows, const Real* y, std::ptrdiff_t y_stride, int channels,
                Real* x, std::ptrdiff_t x_stride) {
  switch (channels) {
    case 1:
      return SpreadRunsOf<Real, 1>(rows, y, y_stride, x, x_stride);
    case 2:
      return SpreadRunsOf<Real, 2>(rows, y, y_stride, x, x_stride);
    case 3:
      return SpreadRunsOf<Real, 3>(rows, y, y_stride, x, x_stride);
    default:
      return SpreadRunsOf<Real, 4>(rows, y, y_stride, x, x_stride);
  }
}

template <typename Real, bool kWeighted>
double DotOf(const Real* x, const Real* y, const Real* w, std::size_t count) {
  constexpr int kLanes = kVectorBytes / static_cast<int>(sizeof(double));
  using Numbers = typename VectorOf<Real, kLanes* static_cast<int>(sizeof(Real))>::Type;
  using Doubles = typename VectorOf<double, kVectorBytes>::Type;
  constexpr std::size_t kStep = 4 * kLanes;
  Doubles sum[4] = {};
  std::size_t i = 0;
  for (; i + kStep <= count; i += kStep) {
#pragma GCC unroll 4
    for (int j = 0; j < 4; ++j) {
      Numbers a, b;
      Load(x + i + j * kLanes, &a);
      Load(y + i + j * kLanes, &b);
      Doubles a_wide = __builtin_convertvector(a, Doubles);
      if (kWeighted) {
        Load(w + i + j * kLanes, &a);
        a_wide *= __builtin_convertvector(a, Doubles);
      }
      sum[j] += a_wide * __builtin_convertvector(b, Doubles);
    }
  }
  const Doubles vector_sum = (sum[0] + sum[1]) + (sum[2] + sum[3]);
  double total = 0;
  for (int lane = 0; lane < kLanes; ++lane) total += vector_sum[lane];
  for (; i < count; ++i) {
    const double weight = kWeighted ? static_cast<double>(w[i]) : 1.0;
    total += static_cast<double>(x[i]) * weight * static_cast<double>(y[i]);
  }
  return total;
}

template <typename Real>
double DotLoop(const Real* x, const Real* y, const Real* w, std::size_t count) {
  return w != nullptr ? DotOf<Real, true>(x, y, w, count) : DotOf<Real, false>(x, y, w, count);
}

template <typename Real>
FilterLoops<Real> LoopsOfThisFile() {
  return {SumTerms<Real>, SumRuns<Real>, SpreadRuns<Real>, DotLoop<Real>};
}

}  // namespace
}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_CPU_FILTER_LOOPS_BODY_H_
