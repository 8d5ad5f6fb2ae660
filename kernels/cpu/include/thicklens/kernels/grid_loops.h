#ifndef THICKLENS_KERNELS_GRID_LOOPS_H_
#define THICKLENS_KERNELS_GRID_LOOPS_H_

#include <cstddef>

#include "thicklens/base/export.h"

namespace thicklens::kernels {

// The innermost loop of D on the grid.

// Neighbouring rays of a view, each linked to the two rays of the next view on both sides of the
// position that shows its point: (D L)_i = (1 - w_i) near[i] + w_i far[i] - here[i], with w_i =
// slope * disparity[i] - whole.
template <typename Real>
struct LinkRun {
  std::size_t count = 0;             // <= kLongestRun
  const float* disparity = nullptr;  // of the rays, in the unit of the map
  Real slope = 0, whole = 0;         // samples per unit of disparity; whole samples of the shift
  const Real* here = nullptr;        // rays of this view
  const Real* near = nullptr;        // rays of the next view before the position
  const Real* far = nullptr;         // null: w is 0
  // Sums of D^T D L at the same rays. Only the near and the far ones may overlap.
  Real* sum_here = nullptr;
  Real* sum_near = nullptr;  // sums at the rays `near`
  Real* sum_far = nullptr;   // sums at the rays `far`
};
constexpr std::size_t kLongestRun = 256;  // Maximum number of rays of a run.

// Adds gamma * D^T D L of the links of a run to the sums.
template <typename Real>
THICKLENS_EXPORT void AddLinks(Real gamma, const LinkRun<Real>& run);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_GRID_LOOPS_H_
