#ifndef THICKLENS_ESTIMATOR_SCENE_SCENE_PRIORS_H_
#define THICKLENS_ESTIMATOR_SCENE_SCENE_PRIORS_H_

#include <functional>
#include <vector>

#include "estimator/scene/scene_system.h"
#include "thicklens/estimator/scene_solver.h"

namespace thicklens::estimator {

// The smallest pull toward 0, which leaves no direction undetermined where nothing is known.
constexpr double kLeastPull = 1e-6;
// Of total variation, in stored values: below it differences count as squares.
constexpr double kVariationEps = 0.004;

// The strength of a prior for a photograph with noise of that standard deviation in stored values.
// A quadratic prior is to the data term as the variance of the noise is to that of what the prior
// speaks of (derived here, [D104], from the most probable r of normal noise and a normal prior):
//   mu = sigma^2/var(s (r - I)), eta = sigma^2/var(s grad r),
// where the variances come from those of s (I - H I) and s grad I, less their noise. So a picture
// with little blur gets a strong ridge. That of total variation is an empirical law,
// 1e-3 (255 sigma)^1.5: twice as much or half of it costs .2 dB. That of patches is that of their
// total variation.
template <typename Real>
double StrengthForNoise(Prior prior, double sigma, const DataTerm<Real>& data,
                        const std::vector<Real>& slope_squared);

// The same in two steps, for a photograph of which only parts are looked at: squares of what the
// prior speaks of, s (I - H I) or s grad I, in some of the photograph's rows, and how many they
// are; total variation needs none.
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
// [D103] lambda sum (g + eps^2)^(1/2) + kLeastPull |r|^2, g = sum s^2 |dr|^2. Refers to the slopes.
template <typename Real>
kernels::TotalVariation<Real> VariationPrior(const std::vector<Real>& slope_squared, double lambda);
// The quadratic that touches it at a radiance, all channels of the data.
template <typename Real>
QuadraticPrior<Real> TouchingPrior(const DataTerm<Real>& data,
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
  bool converged = false;  // of the last system, by its residual computed anew
  double relative_residual = 0;
};
// From `radiance` to the minimiser of data term and prior; not for patches (scene_patches.h). The
// system keeps the last quadratic.
template <typename Real>
RadianceOutcome SolveRadiance(Prior prior, double strength, const DataTerm<Real>& data,
                              const std::vector<Real>& slope_squared, const RadianceLimits& limits,
                              SceneSystem<Real>* system, std::vector<Real>* radiance);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_SCENE_PRIORS_H_
