#ifndef THICKLENS_ESTIMATOR_FUNCTIONAL_SOLVER_H_
#define THICKLENS_ESTIMATOR_FUNCTIONAL_SOLVER_H_

#include <functional>
#include <optional>
#include <string>

#include "thicklens/estimator/estimate_input.h"

namespace thicklens::estimator {

struct FunctionalOptions {
  double gamma = 1;             // > 0
  std::optional<double> ridge;  // mu, > 0; default 1e-2/(U V)
  double tolerance = 1e-3;      // relative residual at which conjugate gradients stop, > 0, < 1
  int max_iterations = 1000;    // limit for each channel, >= 1
  bool double_precision = false;
  bool falloff = true;                     // applies the irradiance of [S12] if there is a camera
  int threads = 0;                         // 0: one per core
  std::optional<double> memory_limit_mib;  // limit for the whole process
  // Called for each view and each iteration, from any thread, but never by two threads at once. May
  // throw to stop the estimate.
  std::function<void(int done, int total)> progress;

  bool IsValid(std::string* why) const;
};

struct FunctionalSummary {
  std::string message = "not run";
  int iterations = 0;      // maximum over the channels
  bool converged = false;  // whether all channels reached the tolerance
  // |b - S y|/|b| of the system S y = b below, recomputed from the solution; the maximum over the
  // channels.
  double relative_residual = 0;
  double gamma = 0, ridge = 0;
  double setup_seconds = 0, solve_seconds = 0, views_seconds = 0;
  // Maximum memory that the whole process is expected to hold, with what it held before.
  double predicted_memory_mib = 0;
  int threads = 0;
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
// Throws Error for options and inputs that do not fit, for a memory limit that is too low, and for
// iterations that end with a relative residual of 10 or more. The result does not depend on the
// number of threads.
model::LightField EstimateFunctional(const EstimateInput& input, const FunctionalOptions& options,
                                     FunctionalSummary* summary);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_FUNCTIONAL_SOLVER_H_
