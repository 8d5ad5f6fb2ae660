#ifndef THICKLENS_ESTIMATOR_SRC_SCENE_PATCHES_H_
#define THICKLENS_ESTIMATOR_SRC_SCENE_PATCHES_H_

#include <vector>

#include "scene_priors.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::estimator {

struct PatchPrior {
  double strength = 0;     // lambda of its total variation
  double noise_sigma = 0;  // of the photograph's stored values
  model::TransferCurve transfer;
};

// From `radiance` to that of Prior::kPatches:
//   1. r of total variation of strength lambda;
//   2. r of total variation of strength f lambda, f = (sigma_p/(.7 sigma))^1.5/2, but between 1/2
//      and 1: sigma_p is the rms of s (H r - I) within 4 px of p. Where H explains the photograph
//      less of it is needed, as the patches do the rest; where it does not, at hidden things, all;
//   3. v = FilterPatches of the stored values of r, its threshold 8.1/255 (255 sigma)^.6, and r
//      that minimises sum_x W |H r - I|^2 + rho sum s^2 |r - v|^2, rho = .15 (255 sigma)^.8:
//      half-quadratic splitting (Zoran and Weiss 2011) cut short.
// The outcome is that of all systems together, the residual that of the last.
template <typename Real>
RadianceOutcome SolveWithPatches(const PatchPrior& prior, const DataTerm<Real>& data,
                                 const std::vector<Real>& slope_squared,
                                 const RadianceLimits& limits, SceneSystem<Real>* system,
                                 std::vector<Real>* radiance);

// f of each pixel for a radiance.
template <typename Real>
std::vector<Real> LocalVariation(const DataTerm<Real>& data, const std::vector<Real>& slope_squared,
                                 const std::vector<Real>& radiance, double noise_sigma);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SRC_SCENE_PATCHES_H_
