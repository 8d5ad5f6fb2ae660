#include "thicklens/kernels/grid_loops.h"

#include "kernels/cpu/processor.h"

namespace thicklens::kernels {
namespace {

template <typename Real>
inline __attribute__((always_inline)) void Links(Real gamma, const LinkRun<Real>& run) {
  const Real* __restrict here = run.here;
  const Real* __restrict near = run.near;
  Real* __restrict sum_here = run.sum_here;
  Real to_near[kLongestRun];
  if (run.far == nullptr) {
    for (std::size_t i = 0; i < run.count; ++i) {
      const Real difference = gamma * (near[i] - here[i]);
      to_near[i] = difference;
      sum_here[i] -= difference;
    }
    for (std::size_t i = 0; i < run.count; ++i) run.sum_near[i] += to_near[i];
    return;
  }
  const Real* __restrict far = run.far;
  const float* __restrict disparity = run.disparity;
  const Real slope = run.slope, whole = run.whole;
  Real to_far[kLongestRun];
  for (std::size_t i = 0; i < run.count; ++i) {
    const Real w = slope * static_cast<Real>(disparity[i]) - whole;
    const Real difference = gamma * (near[i] + w * (far[i] - near[i]) - here[i]);
    to_far[i] = w * difference;
    to_near[i] = difference - to_far[i];
    sum_here[i] -= difference;
  }
  for (std::size_t i = 0; i < run.count; ++i) run.sum_near[i] += to_near[i];
  for (std::size_t i = 0; i < run.count; ++i) run.sum_far[i] += to_far[i];
}

#if defined(__x86_64__)

template <typename Real>
__attribute__((target("avx2,fma"))) void LinksAvx2(Real gamma, const LinkRun<Real>& run) {
  Links(gamma, run);
}

#endif

}  // namespace

template <typename Real>
void AddLinks(Real gamma, const LinkRun<Real>& run) {
#if defined(__x86_64__)
  if (HasAvx2AndFma()) return LinksAvx2(gamma, run);
#endif
  Links(gamma, run);
}

template void AddLinks(float, const LinkRun<float>&);
template void AddLinks(double, const LinkRun<double>&);

}  // namespace thicklens::kernels
