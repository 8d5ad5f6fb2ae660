#ifndef THICKLENS_ESTIMATOR_SCENE_SCENE_STRENGTH_H_
#define THICKLENS_ESTIMATOR_SCENE_SCENE_STRENGTH_H_

#include <vector>

#include "estimator/scene/scene_priors.h"

namespace thicklens::estimator {

// Returns the score V of generalised cross-validation (Golub, Heath, Wahba 1979) [L12]:
//
//   V = (|W^(1/2) (H r - I)|^2/n) / (1 - 1.4 tr(B)/n)^2,
//
// where B is the matrix from W^(1/2) I to W^(1/2) H r. The factor 1.4 (Kim and Gu 2004) prevents
// too weak a prior; where the bracket of the denominator is not positive, V is infinite. Up to a
// constant V estimates the error of H r without the noise. `misfit` and `trace` are means per
// value.
double ValidationScore(double misfit, double trace);

// Estimates the trace of that B by one seeded probe of +-1 (Hutchinson), on one channel for all.
// Returns the part of each pixel. The prior of the system must be set.
template <typename Real>
std::vector<Real> ProbedTrace(const DataTerm<Real>& data, const RadianceLimits& limits,
                              SceneSystem<Real>* system, int* iterations);

// Returns V of a radiance that solves the system.
template <typename Real>
double CrossValidation(const DataTerm<Real>& data, const std::vector<Real>& radiance,
                       const RadianceLimits& limits, SceneSystem<Real>* system, int* iterations);

struct StrengthSearch {
  double strength = 0;
  int iterations = 0;  // iterations of all systems
};
// Returns the strength of the smallest V: it descends from `start` by factors of 2 and takes the
// vertex of the parabola (in the logarithm) of the three lowest. `radiance` is the start of the
// solves and receives one of their solutions.
template <typename Real>
StrengthSearch SearchStrength(Prior prior, double start, const DataTerm<Real>& data,
                              const std::vector<Real>& slope_squared, const RadianceLimits& limits,
                              SceneSystem<Real>* system, std::vector<Real>* radiance);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_SCENE_STRENGTH_H_
