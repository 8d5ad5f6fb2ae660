#ifndef THICKLENS_KERNELS_CPU_PATCH_LOOPS_BODY_H_
#define THICKLENS_KERNELS_CPU_PATCH_LOOPS_BODY_H_

#include <cstddef>

#include "kernels/cpu/patch_loops.h"

// The loop of patch_loops.h, for the processor for which the including file is compiled. Each
// including file has its own copy (hence the unnamed namespace). The lanes of a vector are adjacent
// patches.

namespace thicklens::kernels {
namespace {

#if defined(__AVX__)
constexpr int kPatchVectorBytes = 32;
#else
constexpr int kPatchVectorBytes = 16;
#endif

template <typename Real>
struct PatchVectorOf {
  typedef Real Type __attribute__((vector_size(kPatchVectorBytes)));
  static constexpr int kLanes = kPatchVectorBytes / static_cast<int>(sizeof(Real));
};

template <typename Vector, typename Real>
inline __attribute__((always_inline)) void LoadLanes(const Real* from, Vector* to) {
  __builtin_memcpy(to, from, sizeof(Vector));
}
template <typename Vector, typename Real>
inline __attribute__((always_inline)) void StoreLanes(const Vector& from, Real* to) {
  __builtin_memcpy(to, &from, sizeof(Vector));
}
template <typename Vector, typename Real>
inline __attribute__((always_inline)) void AddLanes(const Vector& what, Real* to) {
  Vector sum;
  LoadLanes(to, &sum);
  sum += what;
  StoreLanes(sum, to);
}

// Values of cos(m pi/16)/2; for m = 4 it is sqrt(1/8), which is also the value of a constant.
template <typename Real>
struct Cosines {
  static constexpr Real k1 = static_cast<Real>(0.49039264020161522456);
  static constexpr Real k2 = static_cast<Real>(0.46193976625564337806);
  static constexpr Real k3 = static_cast<Real>(0.41573480615127261854);
  static constexpr Real k4 = static_cast<Real>(0.35355339059327376220);
  static constexpr Real k5 = static_cast<Real>(0.27778511650980111237);
  static constexpr Real k6 = static_cast<Real>(0.19134171618254488586);
  static constexpr Real k7 = static_cast<Real>(0.09754516100806413392);
};

// Computes in place v_k = c_k sum_j cos((2 j + 1) k pi/16) v_j, where c_0 = sqrt(1/8) and the other
// c_k are 1/2. Even and odd k need only sums and differences of v_j and v_(7 - j).
template <typename Real, typename Vector>
inline __attribute__((always_inline)) void Dct(Vector* v) {
  using C = Cosines<Real>;
  const Vector s0 = v[0] + v[7], s1 = v[1] + v[6], s2 = v[2] + v[5], s3 = v[3] + v[4];
  const Vector d0 = v[0] - v[7], d1 = v[1] - v[6], d2 = v[2] - v[5], d3 = v[3] - v[4];
  const Vector p = s0 + s3, q = s1 + s2, r = s0 - s3, t = s1 - s2;
  v[0] = C::k4 * (p + q);
  v[4] = C::k4 * (p - q);
  v[2] = C::k2 * r + C::k6 * t;
  v[6] = C::k6 * r - C::k2 * t;
  v[1] = C::k1 * d0 + C::k3 * d1 + C::k5 * d2 + C::k7 * d3;
  v[3] = C::k3 * d0 - C::k7 * d1 - C::k1 * d2 - C::k5 * d3;
  v[5] = C::k5 * d0 - C::k1 * d1 + C::k7 * d2 + C::k3 * d3;
  v[7] = C::k7 * d0 - C::k5 * d1 + C::k3 * d2 - C::k1 * d3;
}

// Computes the transpose of Dct, which is its inverse.
template <typename Real, typename Vector>
inline __attribute__((always_inline)) void InverseDct(Vector* v) {
  using C = Cosines<Real>;
  const Vector p = C::k4 * (v[0] + v[4]), q = C::k4 * (v[0] - v[4]);
  const Vector r = C::k2 * v[2] + C::k6 * v[6], t = C::k6 * v[2] - C::k2 * v[6];
  const Vector s0 = p + r, s3 = p - r, s1 = q + t, s2 = q - t;
  const Vector d0 = C::k1 * v[1] + C::k3 * v[3] + C::k5 * v[5] + C::k7 * v[7];
  const Vector d1 = C::k3 * v[1] - C::k7 * v[3] - C::k1 * v[5] - C::k5 * v[7];
  const Vector d2 = C::k5 * v[1] - C::k1 * v[3] + C::k7 * v[5] + C::k3 * v[7];
  const Vector d3 = C::k7 * v[1] - C::k5 * v[3] + C::k3 * v[5] - C::k1 * v[7];
  v[0] = s0 + d0;
  v[7] = s0 - d0;
  v[1] = s1 + d1;
  v[6] = s1 - d1;
  v[2] = s2 + d2;
  v[5] = s2 - d2;
  v[3] = s3 + d3;
  v[4] = s3 - d3;
}

// The contributions of the patches of a chunk to the pixel i px to the right of their first column,
// as transforms down: part[k][i][patch]; and their weights. The last patches of the previous chunk
// precede the first patch.
template <typename Real>
struct PatchParts {
  Real part[kPatchPx][kPatchPx][kPatchPx + kPatchChunkPx] = {};
  Real weight[kPatchPx + kPatchChunkPx] = {};
};

// Filters the patches at x and to the right of it, as many as a vector has lanes, to parts from
// `at` on.
template <typename Real>
inline __attribute__((always_inline)) void FilterGroup(const PatchRow<Real>& row, int x, int at,
                                                       PatchParts<Real>* parts) {
  using Vector = typename PatchVectorOf<Real>::Type;
  const Vector zero = {};
  const Vector one = zero + 1;
  Vector c[kPatchPx][kPatchPx];
  Vector kept = zero;
  for (int k = 0; k < kPatchPx; ++k) {
    const Real* columns = row.columns + k * row.stride + x;
#pragma GCC unroll 8
    for (int i = 0; i < kPatchPx; ++i) LoadLanes(columns + i, &c[k][i]);
    Dct<Real>(c[k]);
    const Vector mean = c[k][0];
#pragma GCC unroll 8
    for (int i = 0; i < kPatchPx; ++i) {
      const auto keep = (c[k][i] > row.threshold) | (c[k][i] < -row.threshold);
      c[k][i] = keep ? c[k][i] : zero;
      kept += keep ? one : zero;
    }
    if (k == 0) {
      kept += c[0][0] != zero ? zero : one;
      c[0][0] = mean;
    }
  }
  Vector weight = 1 / kept;
  for (int lane = 0; lane < PatchVectorOf<Real>::kLanes; ++lane) {
    if (x + lane >= row.patches) weight[lane] = 0;
  }
  StoreLanes(weight, parts->weight + at);
  for (int k = 0; k < kPatchPx; ++k) {
#pragma GCC unroll 8
    for (int i = 0; i < kPatchPx; ++i) c[k][i] *= weight;
    InverseDct<Real>(c[k]);
#pragma GCC unroll 8
    for (int i = 0; i < kPatchPx; ++i) StoreLanes(c[k][i], parts->part[k][i] + at);
  }
}

// Sums up the pixels at x and to the right of it, from parts at `at` and to the left of it.
template <typename Real>
inline __attribute__((always_inline)) void AddPixels(const PatchParts<Real>& parts, int at, int x,
                                                     const PatchRow<Real>& row) {
  using Vector = typename PatchVectorOf<Real>::Type;
  Vector v[kPatchPx];
  Vector part;
  for (int k = 0; k < kPatchPx; ++k) {
    v[k] = Vector{};
#pragma GCC unroll 8
    for (int i = 0; i < kPatchPx; ++i) {
      LoadLanes(parts.part[k][i] + at - i, &part);
      v[k] += part;
    }
  }
  InverseDct<Real>(v);
  Vector weight = {};
#pragma GCC unroll 8
  for (int i = 0; i < kPatchPx; ++i) {
    LoadLanes(parts.weight + at - i, &part);
    weight += part;
  }
#pragma GCC unroll 8
  for (int j = 0; j < kPatchPx; ++j) {
    AddLanes(v[j], row.sum + j * row.stride + x);
    AddLanes(weight, row.weight + j * row.stride + x);
  }
}

template <typename Real>
void FilterRow(const PatchRow<Real>& row) {
  using Vector = typename PatchVectorOf<Real>::Type;
  constexpr int kLanes = PatchVectorOf<Real>::kLanes;
  for (std::ptrdiff_t x = 0; x < row.stride; x += kLanes) {
    Vector v[kPatchPx];
#pragma GCC unroll 8
    for (int j = 0; j < kPatchPx; ++j) LoadLanes(row.from + j * row.stride + x, &v[j]);
    Dct<Real>(v);
#pragma GCC unroll 8
    for (int j = 0; j < kPatchPx; ++j) StoreLanes(v[j], row.columns + j * row.stride + x);
  }
  PatchParts<Real> parts;
  const int width_px = row.patches + kPatchPx - 1;
  for (int x0 = 0; x0 < width_px; x0 += kPatchChunkPx) {
    for (int i = 0; i < kPatchChunkPx; i += kLanes) FilterGroup(row, x0 + i, kPatchPx + i, &parts);
    for (int i = 0; i < kPatchChunkPx; i += kLanes) AddPixels(parts, kPatchPx + i, x0 + i, row);
    for (auto& of_row : parts.part) {
      for (Real* part : of_row) {
        __builtin_memcpy(part, part + kPatchChunkPx, kPatchPx * sizeof(Real));
      }
    }
    __builtin_memcpy(parts.weight, parts.weight + kPatchChunkPx, kPatchPx * sizeof(Real));
  }
}

}  // namespace
}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_CPU_PATCH_LOOPS_BODY_H_
