#ifndef THICKLENS_KERNELS_CPU_LANES_H_
#define THICKLENS_KERNELS_CPU_LANES_H_

#include <cstddef>

namespace thicklens::kernels {

// Numbers that hot loops process together. Computations with them become the vector instructions of
// the function that they are inlined into.
constexpr std::size_t kLanes = 8;
template <typename Real>
struct LanesOf {
  typedef Real Type __attribute__((vector_size(kLanes * sizeof(Real))));
};
template <typename Real>
using Lanes = typename LanesOf<Real>::Type;

template <typename Real>
inline __attribute__((always_inline)) void Load(const Real* from, Lanes<Real>* to) {
  __builtin_memcpy(to, from, sizeof(Lanes<Real>));
}
template <typename Real>
inline __attribute__((always_inline)) void Store(const Lanes<Real>& from, Real* to) {
  __builtin_memcpy(to, &from, sizeof(Lanes<Real>));
}

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_CPU_LANES_H_
