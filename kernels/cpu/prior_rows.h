#ifndef THICKLENS_KERNELS_CPU_PRIOR_ROWS_H_
#define THICKLENS_KERNELS_CPU_PRIOR_ROWS_H_

#include <cstddef>

#include "thicklens/kernels/radiance_steps.h"

namespace thicklens::kernels {

// Rows of P x: tikhonov_weight x, plus the transposed differences of the gradient weights times the
// differences.
template <typename Real>
class PriorRows {
 public:
  PriorRows(const QuadraticPrior<Real>& prior, int width_px, int height_px)
      : tikhonov_weight_(prior.tikhonov_weight.data()),
        t_(prior.gradient_weight.empty() ? nullptr : prior.gradient_weight.data()),
        width_(width_px),
        height_(height_px) {}

  // `across` is memory for width + 1 numbers. The function is inlined so that it uses the
  // instruction set of its caller.
  inline __attribute__((always_inline)) void Multiply(const Real* plane, int y,
                                                      Real* __restrict across,
                                                      Real* __restrict out) const {
    const std::ptrdiff_t row = std::ptrdiff_t{y} * width_;
    const Real* x = plane + row;
    const Real* tikhonov_weight = tikhonov_weight_ + row;
    for (int i = 0; i < width_; ++i) out[i] = tikhonov_weight[i] * x[i];
    if (t_ == nullptr) return;
    const Real* t = t_ + row;
    across[0] = 0;
    across[width_] = 0;
    for (int i = 0; i + 1 < width_; ++i) across[i + 1] = t[i] * (x[i + 1] - x[i]);
    for (int i = 0; i < width_; ++i) out[i] += across[i] - across[i + 1];
    if (y + 1 < height_) {
      for (int i = 0; i < width_; ++i) out[i] += t[i] * (x[i] - x[i + width_]);
    }
    if (y > 0) {
      const Real* above = x - width_;
      const Real* t_above = t - width_;
      for (int i = 0; i < width_; ++i) out[i] += t_above[i] * (x[i] - above[i]);
    }
  }

  // Adds the gradient weight of all differences that include a pixel, and its Tikhonov weight.
  void AddDiagonal(int y, Real* out) const {
    const Real* tikhonov_weight = tikhonov_weight_ + std::ptrdiff_t{y} * width_;
    for (int i = 0; i < width_; ++i) out[i] += tikhonov_weight[i];
    if (t_ == nullptr) return;
    const Real* t = t_ + std::ptrdiff_t{y} * width_;
    for (int i = 0; i < width_; ++i) {
      if (i + 1 < width_) out[i] += t[i];
      if (i > 0) out[i] += t[i - 1];
      if (y + 1 < height_) out[i] += t[i];
      if (y > 0) out[i] += t[i - width_];
    }
  }

 private:
  const Real* tikhonov_weight_;
  const Real* t_;
  int width_, height_;
};

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_CPU_PRIOR_ROWS_H_
