// This file is compiled for processors with AVX2 and FMA (see CMakeLists.txt), on x86 only.
#include "kernels/cpu/filter_loops.h"
#include "kernels/cpu/filter_loops_body.h"

namespace thicklens::kernels {

#if defined(__x86_64__)
template <typename Real>
FilterLoops<Real> Avx2FilterLoops() {
  return LoopsOfThisFile<Real>();
}

template FilterLoops<float> Avx2FilterLoops();
template FilterLoops<double> Avx2FilterLoops();
#endif

}  // namespace thicklens::kernels
