#ifndef THICKLENS_ESTIMATOR_SCENE_SCENE_PATCHES_H_
#define THICKLENS_ESTIMATOR_SCENE_SCENE_PATCHES_H_

#include <memory>
#include <vector>

#include "estimator/scene/scene_priors.h"
#include "thicklens/estimator/disparity_map.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::estimator {

struct PatchPrior {
  double strength = 0;     // lambda of its total variation
  double noise_sigma = 0;  // of the photograph's encoded values
  model::TransferCurve transfer;
  const DisparityMap* disparity = nullptr;  // of the data's pixels
  double guide_slope = 0;  // c of ShadingGuideOf; below kMinShadingGuideSlope the relief is ignored
};

// Solves, from `radiance` on, for the radiance of Prior::kPatches [D107]:
//
//   1. r is solved for with total variation of strength lambda.
//   2. G is the shading of the relief (see FitShading), from r and from the estimate of the
//      relief's normals from a photograph of them, made with the quadratic that touches that prior
//      at r. From here on u = r - G is solved for, whose photograph is I - H G. If that estimate
//      does not converge within the limit of iterations, which it has for itself, there is no G.
//   3. u is solved for with total variation of strength f lambda, where
//      f = (sigma_p/(0.7 sigma))^1.5/2, but between 1/2 and 1, and sigma_p is the rms of
//      s (H r - I) within 4 px of p. Where H explains the photograph, less variation is needed,
//      because the patches do the rest; where it does not, at occluded points, all is needed.
//   4. v has the encoded values s G + FilterPatches of (those of r less s G), with the threshold
//      8.1/255 (255 sigma)^0.6. r then minimises sum_x W |H r - I|^2 + rho sum s^2 |r - v|^2,
//      rho = 0.15 (255 sigma)^0.8: half-quadratic splitting (Zoran and Weiss 2011) [L14] cut short.
//
// `system`, which belongs to the data and uses `backend`, is consumed. The iterations of the
// outcome are those of all systems together; the residual is that of the last, in u.
template <typename Real>
RadianceOutcome SolveWithPatches(const PatchPrior& prior, const DataTerm<Real>& data,
                                 const std::vector<Real>& slope_squared,
                                 const RadianceLimits& limits,
                                 std::unique_ptr<SceneSystem<Real>> system,
                                 kernels::Backend* backend, std::vector<Real>* radiance);

// Returns f of each pixel for a radiance.
template <typename Real>
std::vector<Real> LocalVariation(const DataTerm<Real>& data, const std::vector<Real>& slope_squared,
                                 const std::vector<Real>& radiance, double noise_sigma);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_SCENE_PATCHES_H_
