#ifndef THICKLENS_KERNELS_CPU_PATCH_LOOPS_H_
#define THICKLENS_KERNELS_CPU_PATCH_LOOPS_H_

#include <cstddef>

namespace thicklens::kernels {

// The innermost loop of patch_filter.h, compiled once for each kind of processor; what is said in
// filter_loops.h holds here.

constexpr int kPatchPx = 8;
constexpr int kPatchChunkPx = 64;  // of a row, that is done at a time

// All patches with their first row in common. Rows are `stride` apart, which is a multiple of 16
// and at least 16 more than the width rounded up to chunks; what lies there beside the picture is
// finite.
template <typename Real>
struct PatchRow {
  const Real* from = nullptr;  // 8 rows
  Real* columns = nullptr;     // room for 8 rows
  std::ptrdiff_t stride = 0;
  int patches = 0;
  Real threshold = 0;
  // 8 rows each: what the patches come to, times their weights, and the weights are added here.
  Real* sum = nullptr;
  Real* weight = nullptr;
};

template <typename Real>
struct PatchLoops {
  void (*filter_row)(const PatchRow<Real>& row);
};

// For every processor of the architecture.
template <typename Real>
PatchLoops<Real> PlainPatchLoops();
#if defined(__x86_64__)
// With AVX2 and FMA.
template <typename Real>
PatchLoops<Real> Avx2PatchLoops();
#endif
// The fastest of these that runs on this processor.
template <typename Real>
const PatchLoops<Real>& BestPatchLoops();

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_CPU_PATCH_LOOPS_H_
