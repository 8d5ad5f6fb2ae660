#ifndef THICKLENS_ESTIMATOR_SCENE_SCENE_STRENGTH_H_
#define THICKLENS_ESTIMATOR_SCENE_SCENE_STRENGTH_H_

#include <vector>

#include "estimator/scene/scene_priors.h"

namespace thicklens::estimator {

// Generalised cross-validation (Golub, Heath, Wahba 1979) [L12]:
//   V = (|W^(1/2) (H r - I)|^2/n) / (1 - 1.4 tr(B)/n)^2,
// B the matrix from W^(1/2) I to W^(1/2) H r. The factor 1.4 (Kim and Gu 2004) keeps it from too
// weak a prior; where it leaves less than nothing, V is infinite. Up to a constant V estimates the
// error of H r, noise left out. Of the mean misfit and the mean of the trace:
double ValidationScore(double misfit, double trace);

// The trace of that B by one seeded probe of +-1 (Hutchinson), on one channel for all: what each
// pixel has in it. Of the system whose prior is set.
template <typename Real>
std::vector<Real> ProbedTrace(const DataTerm<Real>& data, const RadianceLimits& limits,
                              SceneSystem<Real>* system, int* iterations);

// V of a radiance that solves the system.
template <typename Real>
double CrossValidation(const DataTerm<Real>& data, const std::vector<Real>& radiance,
                       const RadianceLimits& limits, SceneSystem<Real>* system, int* iterations);

struct StrengthSearch {
  double strength = 0;
  int iterations = 0;  // of all systems
};
// The strength of the smallest V: from `start` down the slope by factors of 2, then the vertex of
// the parabola (in the logarithm) of the three lowest. `radiance` is where the solves start and is
// left at one of them.
template <typename Real>
StrengthSearch SearchStrength(Prior prior, double start, const DataTerm<Real>& data,
                              const std::vector<Real>& slope_squared, const RadianceLimits& limits,
                              SceneSystem<Real>* system, std::vector<Real>* radiance);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_SCENE_STRENGTH_H_
