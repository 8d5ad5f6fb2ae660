#ifndef THICKLENS_ESTIMATOR_FUNCTIONAL_SOLVER_H_
#define THICKLENS_ESTIMATOR_FUNCTIONAL_SOLVER_H_

#include <optional>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/estimator/estimate_input.h"
#include "thicklens/estimator/solver_run.h"

namespace thicklens::estimator {

// The options of the two solvers that take the whole image at once and have no blocks.
struct WholeImageOptions {
  double gamma = 1;               // > 0
  std::optional<double> ridge;    // mu, > 0; default 1e-2/(U V)
  double tolerance = 1e-3;        // relative residual at which conjugate gradients stop, > 0, < 1
  int max_iterations = 1000;      // limit for each channel, >= 1
  bool double_precision = false;  // compute in double
  bool falloff = true;            // applies the irradiance of [S12] if there is a camera

  // Returns false, and the reason in `why` (may be null), if a member is not in its range.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// The options of EstimateFunctional. They have a type of their own because the type selects the
// solver (SolverOptions).
struct FunctionalOptions : WholeImageOptions {};

// The weights that the functional had.
struct FunctionalDiagnostics {
  double gamma = 0, ridge = 0;  // gamma and mu
};

// The relative residual is |b - S y|/|b| of the system S y = b below.
struct FunctionalSummary : SolverResult, FunctionalDiagnostics {
  int iterations = 0;  // maximum over the channels
};

// Estimates the light field of one photograph with the functional of EstimateByBlocks, but for the
// whole image at once and on the rays of scene points. R(p, k) is the radiance that the point seen
// by pixel p of the centre view sends toward the aperture sample k:
//   |H R - I|^2 + gamma |D R|^2 + mu |R - R0|^2.
// H is that of SceneRays, D takes the differences between neighbouring aperture samples of a point
// (no link is lost at a border), and R0(p, k) = I(p). With A = gamma D^T D + mu (see AperturePrior)
// the normal equations reduce to a system with one unknown for each pixel:
//   (Id + H A^-1 H^T) y = I - H R0,   R = R0 + A^-1 H^T y;
// derived here [D115]. Conjugate gradients solve it. Its eigenvalues are at least 1 and, up to the
// unevenness of H, at most 1 + 1/(U V mu), whatever the blur.
//
// Limit case: as gamma grows, R(p, .) becomes even. That is EstimateScene with a ridge of U V mu, a
// linear H and no pixel weights. Each view shows R(., k) by its depth.
//
// `summary` may be null. Throws Error for options and inputs that do not fit, for a memory limit
// that is too low, and for iterations that end with a relative residual of 10 or more. The result
// does not depend on the number of threads.
THICKLENS_EXPORT model::LightField EstimateFunctional(const EstimateInput& input,
                                                      const FunctionalOptions& options,
                                                      const SolverRun& run,
                                                      FunctionalSummary* summary);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_FUNCTIONAL_SOLVER_H_
