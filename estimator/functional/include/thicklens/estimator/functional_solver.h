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
  int max_iterations = 1000;    // for each channel, >= 1
  bool double_precision = false;
  bool falloff = true;                     // the irradiance of [S12], where there is a camera
  int threads = 0;                         // 0: one per core
  std::optional<double> memory_limit_mib;  // for the whole process
  // Called from any thread, one at a time, for each view and each iteration. May throw to stop.
  std::function<void(int done, int total)> progress;

  bool IsValid(std::string* why) const;
};

struct FunctionalSummary {
  std::string message = "not run";
  int iterations = 0;      // the most of the channels
  bool converged = false;  // all channels, to the tolerance
  // |b - S y|/|b|, S y = b the system below, recomputed from the answer; the largest of the
  // channels.
  double relative_residual = 0;
  double gamma = 0, ridge = 0;
  double setup_seconds = 0, solve_seconds = 0, views_seconds = 0;
  // Most that the whole process is expected to hold, with what it held before.
  double predicted_memory_mib = 0;
  int threads = 0;
};

// The light field of one picture by the functional of EstimateByBlocks, for the whole picture and
// on the rays of scene points, R(p, k) the radiance of the point that pixel p of the centre view
// shows toward the aperture sample k:
//   |H R - I|^2 + gamma |D R|^2 + mu |R - R0|^2,
// H as in SceneRays, D the differences between neighbouring aperture samples of a point (no link is
// lost at a border), R0(p, k) = I(p). The normal equations with A = gamma D^T D + mu (see
// AperturePrior) reduce to a system of the picture's size, whose eigenvalues are at least 1 and, up
// to the unevenness of H, at most 1 + 1/(U V mu), whatever the blur:
//   (Id + H A^-1 H^T) y = I - H R0,   R = R0 + A^-1 H^T y,
// derived here [D115], by conjugate gradients. As gamma grows R(p, .) becomes even: that is
// EstimateScene with a ridge of U V mu, a linear H and no weights of pixels. Each view shows the
// R(., k) by its depth. Throws Error for options and inputs that do not fit and a memory limit that
// is too low. The result does not depend on the number of threads.
model::LightField EstimateFunctional(const EstimateInput& input, const FunctionalOptions& options,
                                     FunctionalSummary* summary);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_FUNCTIONAL_SOLVER_H_
