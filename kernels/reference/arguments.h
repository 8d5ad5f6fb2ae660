#ifndef THICKLENS_KERNELS_REFERENCE_ARGUMENTS_H_
#define THICKLENS_KERNELS_REFERENCE_ARGUMENTS_H_

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "thicklens/kernels/kernels.h"
#include "thicklens/kernels/sparse.h"

namespace thicklens::kernels {

// The arguments of Kernels, checked alike by all that implement it: each throws Error naming what
// does not fit.

// Sizes, weights and fractions; pixels must have a number.
void CheckBlock(const BlockGeometry& block);
// And rays, with `rows_per_ray` matrix rows for each.
void CheckRayNumbers(const BlockGeometry& block, int rows_per_ray);

// Slopes of WarpDifferences and SixTermMasks.
void CheckSlopes(const BlockGeometry& block, int rows_per_ray, std::size_t slopes_u,
                 std::size_t slopes_v);

void CheckSize(const std::string& what, std::size_t size, std::size_t right);
// `rays` as FindRays gives them.
void CheckRays(const BlockGeometry& block, Splat splat, const std::vector<std::int32_t>& rays);

template <typename Real>
void CheckCsr(const CsrMatrix<Real>& a);
void CheckPattern(const CsrPattern& pattern, int rows);

// The whole light field that blocks are added to.
struct WholeShape {
  int s_count = 0, t_count = 0, u_count = 0, v_count = 0, channels = 0;

  std::size_t view_samples() const {
    return static_cast<std::size_t>(s_count) * static_cast<std::size_t>(t_count);
  }
  std::size_t channel_samples() const {
    return view_samples() * static_cast<std::size_t>(u_count) * static_cast<std::size_t>(v_count);
  }
};
void CheckWhole(const WholeShape& whole);
// Whether a block of `rays` numbers can be added to that channel.
void CheckAddition(const WholeShape& whole, const BlockGeometry& block, int channel,
                   std::size_t rays);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_REFERENCE_ARGUMENTS_H_
