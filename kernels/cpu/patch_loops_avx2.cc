// This file is compiled for processors with AVX2 and FMA (see CMakeLists.txt), on x86 only.
#include "kernels/cpu/patch_loops.h"
#include "kernels/cpu/patch_loops_body.h"

namespace thicklens::kernels {

#if defined(__x86_64__)
template <typename Real>
PatchLoops<Real> Avx2PatchLoops() {
  return {FilterRow<Real>};
}

template PatchLoops<float> Avx2PatchLoops();
template PatchLoops<double> Avx2PatchLoops();
#endif

}  // namespace thicklens::kernels
