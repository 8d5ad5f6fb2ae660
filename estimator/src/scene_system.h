#ifndef THICKLENS_ESTIMATOR_SRC_SCENE_SYSTEM_H_
#define THICKLENS_ESTIMATOR_SRC_SCENE_SYSTEM_H_

#include <array>
#include <cstddef>
#include <functional>
#include <vector>

namespace thicklens::estimator {

// A linear map H between pictures of one size. Pictures are planar: one plane a channel, rows top
// to bottom. Results are set, not added to.
template <typename Real>
struct PictureMap {
  std::function<void(const Real* x, int channels, Real* y)> apply;             // y = H x
  std::function<void(const Real* y, int channels, Real* x)> apply_transposed;  // x = H^T y
};

// What all systems of one photograph have in common: sum_x W(x) |H r - I|^2, all channels alike.
template <typename Real>
struct DataTerm {
  int width_px = 0, height_px = 0, channels = 0;
  PictureMap<Real> projection;    // H
  std::vector<Real> photograph;   // I, planar
  std::vector<Real> weight;       // W, one plane
  std::vector<Real> squared_row;  // sum_j H_ij^2 of each pixel i: how little it is a mean of many
  int threads = 1;

  std::size_t pixels() const {
    return static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px);
  }
};

// A quadratic prior: sum_p smoothness(p) |grad r(p)|^2 + pull(p) |r(p) - target(p)|^2, grad the two
// forward differences, of which those that leave the picture are 0; all channels alike.
template <typename Real>
struct QuadraticPrior {
  std::vector<Real> smoothness;       // one plane; empty: 0
  std::vector<Real> pull;             // one plane, > 0
  bool target_is_photograph = false;  // else 0
};

struct CgLimits {
  double tolerance = 1e-4;  // of |A r - b|/|b|
  int max_iterations = 200;
  std::function<void()> on_iteration;  // may be empty; may throw to stop
};
struct CgOutcome {
  int iterations = 0;
  bool converged = false;  // by the recurrence
};

// (H^T W H + P) r = b, P the matrix of the prior: the normal equations of data term and prior, with
// b = H^T W I + pull target. Solved by conjugate gradients with the diagonal as preconditioner,
// vectors in Real, sums in double; all channels together (one polynomial of A for all).
// The result does not depend on the number of threads.
template <typename Real>
class SceneSystem {
 public:
  // `data` is kept by reference.
  explicit SceneSystem(const DataTerm<Real>& data);

  void SetPrior(QuadraticPrior<Real> prior);
  const QuadraticPrior<Real>& prior() const { return prior_; }

  // From x to the solution.
  CgOutcome Solve(const CgLimits& limits, std::vector<Real>* x);
  // The same where the prior is one that touches another at x: `renew` sets it before every
  // iteration (with SetPrior) and says whether it is the one to converge with; and the directions
  // are those of nonlinear conjugate gradients (Polak and Ribiere's, not below 0).
  using Renew = std::function<bool(const std::vector<Real>& x)>;
  CgOutcome SolveRenewed(const CgLimits& limits, const Renew& renew, std::vector<Real>* x);
  // The same for a photograph of which W^(1/2) I is `whitened`, one plane, from 0.
  CgOutcome SolveWhitened(const std::vector<Real>& whitened, const CgLimits& limits,
                          std::vector<Real>* x);
  // |A x - b|/|b| of Solve's system, computed anew.
  double RelativeResidual(const std::vector<Real>& x);

  // sum W |H x - I|^2.
  double DataMisfit(const std::vector<Real>& x);

 private:
  struct RightSide {
    const Real* data = nullptr;    // H^T W I
    const Real* target = nullptr;  // of the pull; null: 0
    int channels = 1;
  };
  RightSide PhotographSide() const;
  CgOutcome Iterate(const RightSide& right, const CgLimits& limits, const Renew& renew,
                    std::vector<Real>* x);
  void MultiplyData(const Real* x, int channels, Real* y);  // y = H^T W H x
  // r = data_residual - P x + pull target. M is the preconditioner.
  struct ResidualSums {
    double squared = 0;         // |r|^2
    double preconditioned = 0;  // r . M^-1 r
    double with_former = 0;     // r . M^-1 (what r was before)
  };
  ResidualSums UpdateResidual(const RightSide& right, const std::vector<Real>& x,
                              const std::vector<Real>& data_residual, std::vector<Real>* r) const;
  double SquaredRightSide(const RightSide& right) const;
  void UpdatePreconditioner();

  const DataTerm<Real>& data_;
  QuadraticPrior<Real> prior_;
  std::vector<Real> weighted_photograph_;  // H^T W I
  std::vector<Real> data_diagonal_;        // of H^T W H, about
  std::vector<Real> inverse_diagonal_;
  std::vector<Real> projected_;  // H x
};

// Calls rows(y0, y1) for bands of a picture's rows that do not depend on the number of threads.
void ForBands(int height_px, int threads, const std::function<void(int y0, int y1)>& rows);
// The same, and sums what they return in their order.
using Sums = std::array<double, 3>;
Sums SumOverBands(int height_px, int threads, const std::function<Sums(int y0, int y1)>& rows);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SRC_SCENE_SYSTEM_H_
