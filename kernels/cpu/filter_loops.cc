#include "kernels/cpu/filter_loops.h"

#include "kernels/cpu/filter_loops_body.h"
#include "kernels/cpu/processor.h"

namespace thicklens::kernels {

template <typename Real>
FilterLoops<Real> PlainFilterLoops() {
  return LoopsOfThisFile<Real>();
}

template <typename Real>
const FilterLoops<Real>& BestFilterLoops() {
#if defined(__x86_64__)
  static const FilterLoops<Real> loops =
      HasAvx2AndFma() ? Avx2FilterLoops<Real>() : PlainFilterLoops<Real>();
#else
  static const FilterLoops<Real> loops = PlainFilterLoops<Real>();
#endif
  return loops;
}

template FilterLoops<float> PlainFilterLoops();
template FilterLoops<double> PlainFilterLoops();
template const FilterLoops<float>& BestFilterLoops();
template const FilterLoops<double>& BestFilterLoops();

}  // namespace thicklens::kernels
