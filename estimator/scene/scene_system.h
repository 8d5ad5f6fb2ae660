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
using kernels::ImageMap;
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

// [D106] (H^T W H + P) r = b, where P is the matrix of the prior: the normal equations of data term
// and prior, with b = H^T W I + tikhonov_weight target. They are solved by conjugate gradients with
// the diagonal as preconditioner, vectors in Real, sums in double, all channels together (one
// polynomial of A for all). The steps are computed on the backend. The result does not depend on
// the number of threads.
template <typename Real>
class SceneSystem {
 public:
  // `data` is kept by reference. Without a backend, or with bounds [D181], the steps run in C++ on
  // the processor.
  explicit SceneSystem(const DataTerm<Real>& data, kernels::Backend* backend = nullptr);

  void SetPrior(const QuadraticPrior<Real>& prior);
  // Sets the prior that is not quadratic, which ReweightVariation needs.
  void SetVariation(const kernels::TotalVariation<Real>& variation);
  // Replaces the prior by the quadratic that touches the variation from above, at the radiance of
  // the last iteration.
  void ReweightVariation();

  // Solves the system, starting from x.
  CgOutcome Solve(const CgLimits& limits, std::vector<Real>* x);
  // Solves with a prior that touches another: `renew` sets it before every iteration and returns
  // whether it is the one to converge with. The directions are those of nonlinear conjugate
  // gradients (Polak and Ribiere's, not below 0).
  using Renew = std::function<bool()>;
  CgOutcome SolveRenewed(const CgLimits& limits, const Renew& renew, std::vector<Real>* x);
  // Solves, from 0, for a photograph whose W^(1/2) I is `whitened`, one plane.
  CgOutcome SolveWhitened(const std::vector<Real>& whitened, const CgLimits& limits,
                          std::vector<Real>* x);
  // Returns |A x - b|/|b| of Solve's system, recomputed.
  double RelativeResidual(const std::vector<Real>& x);

  // Returns sum W |H x - I|^2; where I is a lower bound, only what is below it.
  double DataMisfit(const std::vector<Real>& x);

 private:
  CgOutcome Iterate(const CgLimits& limits, const Renew& renew);

  const DataTerm<Real>& data_;
  std::unique_ptr<kernels::RadianceSteps<Real>> steps_;
};

// Calls rows(y0, y1) for bands of an image's rows that do not depend on the number of threads.
void ForFixedBands(int height_px, int threads, const std::function<void(int y0, int y1)>& rows);
// Calls rows like ForFixedBands and sums its results in the order of the bands.
using Sums = std::array<double, 3>;
Sums SumOverBands(int height_px, int threads, const std::function<Sums(int y0, int y1)>& rows);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_SCENE_SYSTEM_H_
