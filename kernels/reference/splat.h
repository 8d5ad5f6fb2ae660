#ifndef THICKLENS_KERNELS_REFERENCE_SPLAT_H_
#define THICKLENS_KERNELS_REFERENCE_SPLAT_H_

#include <cmath>
#include <cstddef>
#include <vector>

#include "thicklens/kernels/kernels.h"

namespace thicklens::kernels {

// Number of taps of one axis.
inline int TapCount(Splat splat) { return splat == Splat::kNearest ? 1 : 2; }

// Tap of pixel x, on one axis, for rays that land `fraction` f beside their nearest pixel:
//   share 1 - |f| of ray x (tap 0) and |f| of ray x - sign(f) (tap 1),
// the unit impulse g(d) = max(0, 1 - |d|). With kNearest it is all of ray x.
template <typename Real>
struct Tap {
  int offset;
  Real share;
};
template <typename Real>
Tap<Real> TapOf(Splat splat, double exact_fraction, int tap) {
  const Real fraction = static_cast<Real>(exact_fraction);
  if (splat == Splat::kNearest) return {0, Real{1}};
  if (tap == 0) return {0, Real{1} - std::abs(fraction)};
  return {fraction > 0 ? -1 : 1, std::abs(fraction)};
}

// Returns H0 = view weight * g of [M16] for each slot of FindRays, which is the same for all
// pixels.
template <typename Real>
std::vector<Real> SlotWeights(const BlockGeometry& block, Splat splat) {
  std::vector<Real> weights;
  for (int l = 0; l < block.v_count; ++l) {
    for (int k = 0; k < block.u_count; ++k) {
      const auto view = static_cast<std::size_t>(l * block.u_count + k);
      const Real view_weight = static_cast<Real>(block.view_weight[view]);
      for (int tap_y = 0; tap_y < TapCount(splat); ++tap_y) {
        const auto in_y = TapOf<Real>(splat, block.t_fraction[static_cast<std::size_t>(l)], tap_y);
        for (int tap_x = 0; tap_x < TapCount(splat); ++tap_x) {
          const auto in_x =
              TapOf<Real>(splat, block.s_fraction[static_cast<std::size_t>(k)], tap_x);
          weights.push_back(view_weight * in_y.share * in_x.share);
        }
      }
    }
  }
  return weights;
}

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_REFERENCE_SPLAT_H_
