#ifndef THICKLENS_ESTIMATOR_SCENE_SCENE_SYSTEM_H_
#define THICKLENS_ESTIMATOR_SCENE_SCENE_SYSTEM_H_

#include <array>
#include <functional>
#include <memory>
#include <vector>

#include "thicklens/kernels/device.h"
#include "thicklens/kernels/radiance_steps.h"

namespace thicklens::estimator {

using kernels::DataTerm;
using kernels::PictureMap;
using kernels::QuadraticPrior;

struct CgLimits {
  double tolerance = 1e-4;  // of |A r - b|/|b|
  int max_iterations = 200;
  std::function<void()> on_iteration;  // may be empty; may throw to stop
};
struct CgOutcome {
  int iterations = 0;
  bool converged = false;  // by the recurrence
};

// [D106] (H^T W H + P) r = b, P the matrix of the prior: the normal equations of data term and
// prior, with b = H^T W I + pull target. Solved by conjugate gradients with the diagonal as
// preconditioner, vectors in Real, sums in double; all channels together (one polynomial of A for
// all). The steps are done where the backend is. The result does not depend on the number of
// threads.
template <typename Real>
class SceneSystem {
 public:
  // `data` is kept by reference. No backend: C++ on the processor.
  explicit SceneSystem(const DataTerm<Real>& data, kernels::Backend* backend = nullptr);

  void SetPrior(const QuadraticPrior<Real>& prior);
  // Of a prior that is not quadratic, which TouchVariation needs.
  void SetVariation(const kernels::TotalVariation<Real>& variation);
  // The prior is from now on the quadratic that touches that one from above, at the radiance to
  // which the last iteration led.
  void TouchVariation();

  // From x to the solution.
  CgOutcome Solve(const CgLimits& limits, std::vector<Real>* x);
  // The same where the prior is one that touches another: `renew` sets it before every iteration
  // and says whether it is the one to converge with; and the directions are those of nonlinear
  // conjugate gradients (Polak and Ribiere's, not below 0).
  using Renew = std::function<bool()>;
  CgOutcome SolveRenewed(const CgLimits& limits, const Renew& renew, std::vector<Real>* x);
  // The same for a photograph of which W^(1/2) I is `whitened`, one plane, from 0.
  CgOutcome SolveWhitened(const std::vector<Real>& whitened, const CgLimits& limits,
                          std::vector<Real>* x);
  // |A x - b|/|b| of Solve's system, computed anew.
  double RelativeResidual(const std::vector<Real>& x);

  // sum W |H x - I|^2.
  double DataMisfit(const std::vector<Real>& x);

 private:
  CgOutcome Iterate(const CgLimits& limits, const Renew& renew);

  const DataTerm<Real>& data_;
  std::unique_ptr<kernels::RadianceSteps<Real>> steps_;
};

// Calls rows(y0, y1) for bands of a picture's rows that do not depend on the number of threads.
void ForBands(int height_px, int threads, const std::function<void(int y0, int y1)>& rows);
// The same, and sums what they return in their order.
using Sums = std::array<double, 3>;
Sums SumOverBands(int height_px, int threads, const std::function<Sums(int y0, int y1)>& rows);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_SCENE_SYSTEM_H_
