#include "kernels/cpu/patch_loops.h"

#include "kernels/cpu/patch_loops_body.h"
#include "kernels/cpu/processor.h"

namespace thicklens::kernels {

template <typename Real>
PatchLoops<Real> PlainPatchLoops() {
  return {FilterRow<Real>};
}

template <typename Real>
const PatchLoops<Real>& BestPatchLoops() {
#if defined(__x86_64__)
  static const PatchLoops<Real> loops =
      HasAvx2AndFma() ? Avx2PatchLoops<Real>() : PlainPatchLoops<Real>();
#else
  static const PatchLoops<Real> loops = PlainPatchLoops<Real>();
#endif
  return loops;
}

template PatchLoops<float> PlainPatchLoops();
template PatchLoops<double> PlainPatchLoops();
template const PatchLoops<float>& BestPatchLoops();
template const PatchLoops<double>& BestPatchLoops();

}  // namespace thicklens::kernels
