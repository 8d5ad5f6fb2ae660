#ifndef THICKLENS_ESTIMATOR_SCENE_SCENE_PRIORS_H_
#define THICKLENS_ESTIMATOR_SCENE_SCENE_PRIORS_H_

#include <functional>
#include <vector>

#include "estimator/scene/scene_system.h"
#include "thicklens/estimator/scene_solver.h"

namespace thicklens::estimator {

// The smallest Tikhonov weight; it leaves no direction undetermined where the data contain no
// information.
constexpr double kMinTikhonovWeight = 1e-6;
// Parameter of total variation, in encoded values: differences below it count as squares.
constexpr double kVariationEps = 0.004;

// Returns the strength of a prior for a photograph with noise of standard deviation `sigma` in
// encoded values. The ratio of a quadratic prior to the data term is that of the variance of the
// noise to the variance of the quantity in the prior (derived here, [D104], from the most probable
// r of normal noise and a normal prior):
//
//   mu = sigma^2/var(s (r - I)), eta = sigma^2/var(s grad r),
//
// where the variances come from those of s (I - H I) and s grad I, less their noise. So an image
// with little blur gets a strong ridge. The strength of total variation is an empirical law, 1e-3
// (255 sigma)^1.5: twice or half of it costs 0.2 dB. The strength of patches is that of their total
// variation.
template <typename Real>
double StrengthForNoise(Prior prior, double sigma, const DataTerm<Real>& data,
                        const std::vector<Real>& slope_squared);

// Splits StrengthForNoise in two steps, for a photograph of which only parts are read. SignalSum
// holds the sum of squares of the quantity in the prior, s (I - H I) or s grad I, over some of the
// photograph's rows, and their count; total variation needs none.
struct SignalSum {
  double squares = 0, count = 0;
};
inline bool NeedsSignal(Prior prior) { return prior == Prior::kRidge || prior == Prior::kGradient; }
template <typename Real>
SignalSum SignalOf(Prior prior, const DataTerm<Real>& data, const std::vector<Real>& slope_squared,
                   int first_row, int last_row);
double StrengthForNoise(Prior prior, double sigma, const SignalSum& signal);

template <typename Real>
QuadraticPrior<Real> RidgePrior(const std::vector<Real>& slope_squared, double mu);
template <typename Real>
QuadraticPrior<Real> GradientPrior(const std::vector<Real>& slope_squared, double eta);
// [D103] Returns lambda sum (g + eps^2)^(1/2) + kMinTikhonovWeight |r|^2, g = sum s^2 |dr|^2. The
// slopes are kept by reference.
template <typename Real>
kernels::TotalVariation<Real> VariationPrior(const std::vector<Real>& slope_squared, double lambda);
// Returns the quadratic that touches VariationPrior at a radiance of all channels of the data.
template <typename Real>
QuadraticPrior<Real> ReweightedPrior(const DataTerm<Real>& data,
                                     const std::vector<Real>& slope_squared, double lambda,
                                     const std::vector<Real>& radiance);

struct RadianceLimits {
  double tolerance = 1e-4;
  int max_iterations = 200;  // all systems of a radiance together
  std::function<void()> on_iteration;
};
struct RadianceOutcome {
  int iterations = 0;
  int reweightings = 0;
  bool converged = false;  // whether the last system converged, by its residual recomputed
  double relative_residual = 0;
};
// Solves, from `radiance` on, for the minimiser of data term and prior; not for patches
// (scene_patches.h). The system keeps the last quadratic.
template <typename Real>
RadianceOutcome SolveRadiance(Prior prior, double strength, const DataTerm<Real>& data,
                              const std::vector<Real>& slope_squared, const RadianceLimits& limits,
                              SceneSystem<Real>* system, std::vector<Real>* radiance);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_SCENE_PRIORS_H_
