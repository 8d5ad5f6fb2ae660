#ifndef THICKLENS_ESTIMATOR_VIEWS_CATMULL_ROM_H_
#define THICKLENS_ESTIMATOR_VIEWS_CATMULL_ROM_H_

#include <array>

namespace thicklens::estimator {

// Returns the weights of the samples at -1, 0, 1, 2 for the value at `fraction` in [0, 1]. They are
// the cubic convolution of Keys (1981) [L11] with a = -1/2, which is exact for polynomials up to
// the second degree. Their sum is 1; at 0 they are (0, 1, 0, 0).
inline std::array<double, 4> CatmullRomWeights(double fraction) {
  const double f = fraction;
  return {((-0.5 * f + 1) * f - 0.5) * f, (1.5 * f - 2.5) * f * f + 1,
          ((-1.5 * f + 2) * f + 0.5) * f, (0.5 * f - 0.5) * f * f};
}

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_VIEWS_CATMULL_ROM_H_
