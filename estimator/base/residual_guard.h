#ifndef THICKLENS_ESTIMATOR_BASE_RESIDUAL_GUARD_H_
#define THICKLENS_ESTIMATOR_BASE_RESIDUAL_GUARD_H_

#include <cmath>
#include <string>

namespace thicklens::estimator {

// Throws Error if the relative residual [D118] |N x - b|/|b| that iterations ended with is 10 or
// more, or no number: x = 0 would have been far better, and the light field may be anything. On
// their way conjugate gradients may well be above 1 with an answer that is better than their start.
// Below 10 an answer that did not converge is an answer, and its summary says so. `advice`: what
// helps.
void RequireProgress(const std::string& solver, double relative_residual, int iterations,
                     const std::string& advice);

// The larger one; no number is larger than all.
inline double LargerResidual(double a, double b) { return a >= b || std::isnan(a) ? a : b; }

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_BASE_RESIDUAL_GUARD_H_
