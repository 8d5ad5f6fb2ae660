#ifndef THICKLENS_KERNELS_CPU_RADIANCE_LOOPS_H_
#define THICKLENS_KERNELS_CPU_RADIANCE_LOOPS_H_

#include "thicklens/kernels/radiance_steps.h"

namespace thicklens::kernels {

// The innermost loops of the CPU's RadianceSteps. Each processes a row of numbers with the widest
// vectors of the processor. Sums are added in double, in a fixed order.

// Computes r = data - prior (+ tikhonov_weight target), and sums over r and over its previous
// value.
template <typename Real>
struct ResidualRow {
  const Real* data = nullptr;
  const Real* prior = nullptr;
  const Real* tikhonov_weight = nullptr;  // null: no target
  const Real* target = nullptr;
  const Real* inverse_diagonal = nullptr;
  Real* residual = nullptr;
};
template <typename Real>
ResidualSums UpdateRow(const ResidualRow<Real>& row, int count);

// Sets p = m r + beta p and returns p . r.
template <typename Real>
double UpdateDirectionRow(const Real* m, const Real* r, Real beta, int count, Real* p);
// Returns x . y.
template <typename Real>
double DotRow(const Real* x, const Real* y, int count);
// Computes x += step p, r -= step product.
template <typename Real>
void UpdateSolutionRow(Real step, const Real* p, const Real* product, int count, Real* x, Real* r);

// Computes row y of the prior's matrix times a plane. `across` is memory for width + 1 numbers.
template <typename Real>
void MultiplyPriorRow(const QuadraticPrior<Real>& prior, int width_px, int height_px,
                      const Real* plane, int y, Real* across, Real* out);

// Adds (x[i + 1] - x[i])^2, except for the last pixel, and (below[i] - x[i])^2 (below null: none)
// to squares[i].
template <typename Real>
void AddSquaredDifferences(const Real* x, const Real* below, int count, Real* squares);
// Computes gradient_weight = half s^2/(s^2 squares + floor)^(1/2).
template <typename Real>
void ReweightRow(const Real* slope_squared, const Real* squares, Real half, Real floor, int count,
                 Real* gradient_weight);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_CPU_RADIANCE_LOOPS_H_
