#ifndef THICKLENS_KERNELS_CATMULL_ROM_H_
#define THICKLENS_KERNELS_CATMULL_ROM_H_

#include <array>

namespace thicklens::kernels {

// Returns the weights of the samples at -1, 0, 1, 2 for the value at `fraction` in [0, 1]. They are
// the cubic convolution of Keys (1981) [L11] with a = -1/2, which is exact for polynomials up to
// the second degree. Their sum is 1; at 0 they are (0, 1, 0, 0).
template <typename Real>
std::array<Real, 4> CatmullRomWeights(Real fraction) {
  const Real f = fraction;
  return {((Real{-0.5} * f + 1) * f - Real{0.5}) * f, (Real{1.5} * f - Real{2.5}) * f * f + 1,
          ((Real{-1.5} * f + 2) * f + Real{0.5}) * f, (Real{0.5} * f - Real{0.5}) * f * f};
}

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_CATMULL_ROM_H_
