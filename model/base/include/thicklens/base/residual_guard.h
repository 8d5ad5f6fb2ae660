#ifndef THICKLENS_BASE_RESIDUAL_GUARD_H_
#define THICKLENS_BASE_RESIDUAL_GUARD_H_

#include <cmath>
#include <string>

#include "thicklens/base/export.h"

namespace thicklens {

// Throws Error if the final relative residual [D118] |N x - b|/|b| of the iterations is 10 or more,
// or NaN: x = 0 would then have been far better, and the solution may be anything. During their
// iterations conjugate gradients may be above 1 with an iterate that is better than their start.
// Below 10 an unconverged solution is usable, and its summary reports it. `advice` says how to make
// the iterations converge.
THICKLENS_EXPORT void RequireProgress(const std::string& solver, double relative_residual,
                                      int iterations, const std::string& advice);

// Returns the larger residual; NaN counts as larger than every number.
inline double LargerResidual(double a, double b) { return a >= b || std::isnan(a) ? a : b; }

}  // namespace thicklens

#endif  // THICKLENS_BASE_RESIDUAL_GUARD_H_
