#ifndef THICKLENS_KERNELS_CPU_PATCH_LOOPS_H_
#define THICKLENS_KERNELS_CPU_PATCH_LOOPS_H_

#include <cstddef>

namespace thicklens::kernels {

// The innermost loop of patch_filter.h, compiled once for each kind of processor; see
// filter_loops.h for its restrictions.

constexpr int kPatchPx = 8;
constexpr int kPatchChunkPx = 64;  // pixels of a row that are processed at once

// All patches with the same first row. Rows are `stride` apart. The stride is a multiple of 16 and
// at least 16 more than the width rounded up to chunks; the numbers there beside the image are
// finite.
template <typename Real>
struct PatchRow {
  const Real* from = nullptr;  // 8 rows
  Real* columns = nullptr;     // memory for 8 rows
  std::ptrdiff_t stride = 0;
  int patches = 0;
  Real threshold = 0;
  // 8 rows each: the filtered patches times their weights are added to `sum`, the weights to
  // `weight`.
  Real* sum = nullptr;
  Real* weight = nullptr;
};

template <typename Real>
struct PatchLoops {
  void (*filter_row)(const PatchRow<Real>& row);
};

// The loop for every processor of the architecture.
template <typename Real>
PatchLoops<Real> PlainPatchLoops();
#if defined(__x86_64__)
// The loop with AVX2 and FMA.
template <typename Real>
PatchLoops<Real> Avx2PatchLoops();
#endif
// The fastest of these loops that this processor can run.
template <typename Real>
const PatchLoops<Real>& BestPatchLoops();

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_CPU_PATCH_LOOPS_H_
