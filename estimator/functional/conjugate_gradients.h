#ifndef THICKLENS_ESTIMATOR_FUNCTIONAL_CONJUGATE_GRADIENTS_H_
#define THICKLENS_ESTIMATOR_FUNCTIONAL_CONJUGATE_GRADIENTS_H_

#include <cstddef>
#include <functional>
#include <vector>

namespace thicklens::estimator {

// The system A x = b with A symmetric and positive definite.
template <typename Real>
struct LinearSystem {
  std::function<void(const std::vector<Real>& x, std::vector<Real>* product)> multiply;  // A x
  // Sets the residual b - A x.
  std::function<void(const std::vector<Real>& x, std::vector<Real>* residual)> set_residual;
  double right_squared = 0;  // |b|^2
};

struct IterationLimits {
  double tolerance = 0;  // limit of |b - A x|/|b|
  int max_iterations = 0;
};

struct IterationOutcome {
  int iterations = 0;
  double relative_residual = 0;  // |b - A x|/|b|, recomputed from x
};

// Conjugate gradients without a preconditioner. The bits of the result do not depend on the number
// of threads if those of the system do not.
template <typename Real>
class ConjugateGradients {
 public:
  ConjugateGradients(std::size_t size, int threads);

  // Residual b - A x of the start x of Solve; the caller sets it before.
  std::vector<Real>* residual() { return &residual_; }
  // Improves x.
  IterationOutcome Solve(const LinearSystem<Real>& system, const IterationLimits& limits,
                         const std::function<void()>& on_iteration, std::vector<Real>* x);

  static constexpr int kVectors = 3;  // number of vectors that the object holds

 private:
  double Dot(const std::vector<Real>& a, const std::vector<Real>& b) const;
  void Iterate(const LinearSystem<Real>& system, double target, double left, int max_iterations,
               const std::function<void()>& on_iteration, int* iterations, std::vector<Real>* x);

  const int threads_;
  std::vector<Real> residual_, direction_, product_;
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_FUNCTIONAL_CONJUGATE_GRADIENTS_H_
