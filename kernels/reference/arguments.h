#ifndef THICKLENS_KERNELS_REFERENCE_ARGUMENTS_H_
#define THICKLENS_KERNELS_REFERENCE_ARGUMENTS_H_

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "thicklens/kernels/kernels.h"
#include "thicklens/kernels/sparse.h"

namespace thicklens::kernels {

// Tests of the arguments of Kernels, common to all implementations. Each throws Error, which names
// the argument that does not fit.

// Tests sizes, weights and fractions. The number of pixels must be small enough to number them.
void CheckBlock(const BlockGeometry& block);
// Tests the block and the number of its rays, with `rows_per_ray` matrix rows for each.
void CheckRayNumbers(const BlockGeometry& block, int rows_per_ray);

// Tests the slopes of WarpDifferences and SixTermMasks.
void CheckSlopes(const BlockGeometry& block, int rows_per_ray, std::size_t slopes_u,
                 std::size_t slopes_v);

void CheckSize(const std::string& what, std::size_t size, std::size_t right);
// Tests `rays`, a result of FindRays.
void CheckRays(const BlockGeometry& block, Splat splat, const std::vector<std::int32_t>& rays);

template <typename Real>
void CheckCsr(const CsrMatrix<Real>& a);
void CheckPattern(const CsrPattern& pattern, int rows);

// The size of the whole light field to which blocks are added.
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
// Tests that a block of `rays` numbers can be added to the channel.
void CheckAddition(const WholeShape& whole, const BlockGeometry& block, int channel,
                   std::size_t rays);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_REFERENCE_ARGUMENTS_H_
