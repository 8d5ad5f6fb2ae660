#include "estimator/functional/conjugate_gradients.h"

#include <algorithm>
#include <cmath>

#include "thicklens/base/parallel.h"
#include "thicklens/kernels/image_filter.h"

namespace thicklens::estimator {
namespace {

// Calls work(first, last) for pieces of the numbers [0, count).
template <typename Work>
void ForPieces(std::size_t count, int threads, const Work& work) {
  constexpr std::size_t kPiece = 1 << 16;
  const auto pieces = static_cast<int>((count + kPiece - 1) / kPiece);
  ParallelFor(pieces, threads, [&](int piece) {
    const std::size_t first = static_cast<std::size_t>(piece) * kPiece;
    work(first, std::min(count, first + kPiece));
  });
}

}  // namespace

template <typename Real>
ConjugateGradients<Real>::ConjugateGradients(std::size_t size, int threads)
    : threads_(threads), residual_(size), direction_(size), product_(size) {}

template <typename Real>
double ConjugateGradients<Real>::Dot(const std::vector<Real>& a, const std::vector<Real>& b) const {
  return kernels::Dot<Real>(a.data(), b.data(), nullptr, a.size(), threads_);
}

template <typename Real>
IterationOutcome ConjugateGradients<Real>::Solve(const LinearSystem<Real>& system,
                                                 const IterationLimits& limits,
                                                 const std::function<void()>& on_iteration,
                                                 std::vector<Real>* x) {
  const double target = limits.tolerance * limits.tolerance * system.right_squared;
  double left = Dot(residual_, residual_);
  IterationOutcome outcome;
  // The residual of the iterations drifts from the residual of their solution; where the precision
  // allows it, the iterations continue from the latter.
  while (left > target && outcome.iterations < limits.max_iterations) {
    const double before = left;
    Iterate(system, target, left, limits.max_iterations, on_iteration, &outcome.iterations, x);
    system.set_residual(*x, &residual_);
    left = Dot(residual_, residual_);
    if (!(left < before / 4)) break;
  }
  if (left > 0) outcome.relative_residual = std::sqrt(left / system.right_squared);
  return outcome;
}

template <typename Real>
void ConjugateGradients<Real>::Iterate(const LinearSystem<Real>& system, double target, double left,
                                       int max_iterations,
                                       const std::function<void()>& on_iteration, int* iterations,
                                       std::vector<Real>* x) {
  direction_ = residual_;
  while (left > target && *iterations < max_iterations) {
    system.multiply(direction_, &product_);
    const auto step = static_cast<Real>(left / Dot(direction_, product_));
    ForPieces(x->size(), threads_, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) {
        (*x)[i] += step * direction_[i];
        residual_[i] -= step * product_[i];
      }
    });
    const double now = Dot(residual_, residual_);
    const auto turn = static_cast<Real>(now / left);
    ForPieces(x->size(), threads_, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) {
        direction_[i] = residual_[i] + turn * direction_[i];
      }
    });
    left = now;
    ++*iterations;
    on_iteration();
  }
}

template class ConjugateGradients<float>;
template class ConjugateGradients<double>;

}  // namespace thicklens::estimator
