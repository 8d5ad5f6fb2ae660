#ifndef THICKLENS_KERNELS_SRC_FILTER_LOOPS_BODY_H_
#define THICKLENS_KERNELS_SRC_FILTER_LOOPS_BODY_H_

#include <cstddef>
#include <cstdint>

#include "filter_loops.h"

// The loops of filter_loops.h, for the processor that the including file is compiled for; each of
// these has its own copy (hence the namespace without a name).

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

// kVectors vectors of kChannels channels from pixel p on, all sums in registers.
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
  // Sums and a weight fit into 16 registers.
  constexpr int kMost = kChannels == 1 ? 8 : kChannels == 4 ? 2 : 4;
  int p = 0;
  for (; p + kMost * kLanes <= count; p += kMost * kLanes) {
    SumGroup<Real, kChannels, kMost>(terms, term_count, ahead, x_stride, p, y, y_stride);
  }
  // What is left is done by vectors that reach back to pixels that are done: the same numbers
  // again.
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
void InterleaveOf(const Real* x, std::ptrdiff_t x_stride, std::size_t count, Real* to) {
  for (std::size_t p = 0; p < count; ++p) {
    for (int c = 0; c < kMostChannels; ++c) {
      to[kMostChannels * p + static_cast<std::size_t>(c)] =
          c < kChannels ? x[c * x_stride + static_cast<std::ptrdiff_t>(p)] : Real{0};
    }
  }
}

template <typename Real>
void Interleave(const Real* x, std::ptrdiff_t x_stride, int channels, std::size_t count, Real* to) {
  switch (channels) {
    case 1:
      return InterleaveOf<Real, 1>(x, x_stride, count, to);
    case 2:
      return InterleaveOf<Real, 2>(x, x_stride, count, to);
    case 3:
      return InterleaveOf<Real, 3>(x, x_stride, count, to);
    default:
      return InterleaveOf<Real, 4>(x, x_stride, count, to);
  }
}

// Entries are added in four sums, so that one need not wait for the one before.
template <typename Real>
void SumRowEntries(const RowRange<Real>& rows, const Real* x, bool add, Real* y) {
  for (std::size_t r = rows.first; r < rows.last; ++r) {
    const std::int64_t end = rows.start[r + 1];
    Real sum[4] = {};
    std::int64_t e = rows.start[r];
    for (; e + 4 <= end; e += 4) {
      for (int i = 0; i < 4; ++i) sum[i] += rows.weight[e + i] * x[rows.index[e + i]];
    }
    for (; e < end; ++e) sum[0] += rows.weight[e] * x[rows.index[e]];
    const Real total = (sum[0] + sum[1]) + (sum[2] + sum[3]);
    Real* to = y + rows.pixel[r];
    *to = add ? *to + total : total;
  }
}

template <typename Real>
void SumRowEntriesOf4(const RowRange<Real>& rows, const Real* x, bool add, int channels, Real* y,
                      std::ptrdiff_t y_stride) {
  using Vector = typename VectorOf<Real, 4 * static_cast<int>(sizeof(Real))>::Type;
  for (std::size_t r = rows.first; r < rows.last; ++r) {
    const std::int64_t end = rows.start[r + 1];
    Vector sum[4] = {};
    std::int64_t e = rows.start[r];
    for (; e + 4 <= end; e += 4) {
#pragma GCC unroll 4
      for (int i = 0; i < 4; ++i) {
        Vector values;
        Load(x + 4 * static_cast<std::ptrdiff_t>(rows.index[e + i]), &values);
        sum[i] += rows.weight[e + i] * values;
      }
    }
    for (; e < end; ++e) {
      Vector values;
      Load(x + 4 * static_cast<std::ptrdiff_t>(rows.index[e]), &values);
      sum[0] += rows.weight[e] * values;
    }
    const Vector total = (sum[0] + sum[1]) + (sum[2] + sum[3]);
    for (int c = 0; c < channels; ++c) {
      Real* to = y + c * y_stride + rows.pixel[r];
      *to = add ? *to + total[c] : total[c];
    }
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
  return {SumTerms<Real>, Interleave<Real>, SumRowEntries<Real>, SumRowEntriesOf4<Real>,
          DotLoop<Real>};
}

}  // namespace
}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_SRC_FILTER_LOOPS_BODY_H_
