#include "kernels/cpu/radiance_loops.h"

#include <cmath>

#include "kernels/cpu/prior_rows.h"
#include "kernels/cpu/processor.h"

namespace thicklens::kernels {
namespace {

#define THICKLENS_INLINE inline __attribute__((always_inline))

// Number of doubles in a vector of AVX2.
constexpr int kLanes = 4;

template <typename Real>
struct LanesOf {
  typedef Real Type __attribute__((vector_size(kLanes * sizeof(Real))));
};
template <typename Real>
using Lanes = typename LanesOf<Real>::Type;
using Doubles = Lanes<double>;

template <typename Real>
THICKLENS_INLINE void Load(const Real* from, Lanes<Real>* to) {
  __builtin_memcpy(to, from, sizeof *to);
}
template <typename Real>
THICKLENS_INLINE void Store(const Lanes<Real>& from, Real* to) {
  __builtin_memcpy(to, &from, sizeof from);
}

THICKLENS_INLINE double Total(const Doubles& lanes) {
  double sum = 0;
  for (int lane = 0; lane < kLanes; ++lane) sum += lanes[lane];
  return sum;
}

template <typename Real>
THICKLENS_INLINE ResidualSums Update(const ResidualRow<Real>& given, int count) {
  const ResidualRow<Real> row = given;
  Doubles squared{}, preconditioned{}, with_previous{};
  int i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    Lanes<Real> r, prior, m, former;
    Load(row.data + i, &r);
    Load(row.prior + i, &prior);
    Load(row.inverse_diagonal + i, &m);
    Load(row.residual + i, &former);
    r -= prior;
    if (row.tikhonov_weight != nullptr) {
      Lanes<Real> tikhonov_weight, target;
      Load(row.tikhonov_weight + i, &tikhonov_weight);
      Load(row.target + i, &target);
      r += tikhonov_weight * target;
    }
    Store(r, row.residual + i);
    const Doubles wide = __builtin_convertvector(r, Doubles);
    const Lanes<Real> step = m * r;
    const Doubles wide_step = __builtin_convertvector(step, Doubles);
    squared += wide * wide;
    preconditioned += wide * wide_step;
    with_previous += __builtin_convertvector(former, Doubles) * wide_step;
  }
  ResidualSums sums{Total(squared), Total(preconditioned), Total(with_previous)};
  for (; i < count; ++i) {
    Real r = row.data[i] - row.prior[i];
    if (row.tikhonov_weight != nullptr) r += row.tikhonov_weight[i] * row.target[i];
    const double step = static_cast<double>(row.inverse_diagonal[i] * r);
    sums.squared += static_cast<double>(r) * static_cast<double>(r);
    sums.preconditioned += static_cast<double>(r) * step;
    sums.with_previous += static_cast<double>(row.residual[i]) * step;
    row.residual[i] = r;
  }
  return sums;
}

template <typename Real>
THICKLENS_INLINE double UpdateDirection(const Real* m, const Real* r, Real beta, int count,
                                        Real* p) {
  Doubles sum{};
  int i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    Lanes<Real> m_lanes, r_lanes, p_lanes;
    Load(m + i, &m_lanes);
    Load(r + i, &r_lanes);
    Load(p + i, &p_lanes);
    p_lanes = m_lanes * r_lanes + beta * p_lanes;
    Store(p_lanes, p + i);
    sum += __builtin_convertvector(p_lanes, Doubles) * __builtin_convertvector(r_lanes, Doubles);
  }
  double total = Total(sum);
  for (; i < count; ++i) {
    p[i] = m[i] * r[i] + beta * p[i];
    total += static_cast<double>(p[i]) * static_cast<double>(r[i]);
  }
  return total;
}

template <typename Real>
THICKLENS_INLINE double Dot(const Real* x, const Real* y, int count) {
  Doubles sum{};
  int i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    Lanes<Real> x_lanes, y_lanes;
    Load(x + i, &x_lanes);
    Load(y + i, &y_lanes);
    sum += __builtin_convertvector(x_lanes, Doubles) * __builtin_convertvector(y_lanes, Doubles);
  }
  double total = Total(sum);
  for (; i < count; ++i) total += static_cast<double>(x[i]) * static_cast<double>(y[i]);
  return total;
}

template <typename Real>
THICKLENS_INLINE void UpdateSolution(Real step, const Real* p, const Real* product, int count,
                                     Real* __restrict x, Real* __restrict r) {
  for (int i = 0; i < count; ++i) x[i] += step * p[i];
  for (int i = 0; i < count; ++i) r[i] -= step * product[i];
}

template <typename Real>
THICKLENS_INLINE void AddSquares(const Real* x, const Real* below, int count,
                                 Real* __restrict squares) {
  for (int i = 0; i + 1 < count; ++i) squares[i] += (x[i + 1] - x[i]) * (x[i + 1] - x[i]);
  if (below == nullptr) return;
  for (int i = 0; i < count; ++i) squares[i] += (below[i] - x[i]) * (below[i] - x[i]);
}

template <typename Real>
THICKLENS_INLINE void Reweight(const Real* slope_squared, const Real* squares, Real half,
                               Real floor, int count, Real* __restrict gradient_weight) {
  for (int i = 0; i < count; ++i) {
    const Real s2 = slope_squared[i];
    gradient_weight[i] = half * s2 / std::sqrt(s2 * squares[i] + floor);
  }
}

#if defined(__x86_64__)

#define THICKLENS_FMA __attribute__((target("avx2,fma")))

template <typename Real>
THICKLENS_FMA ResidualSums UpdateFma(const ResidualRow<Real>& row, int count) {
  return Update(row, count);
}
template <typename Real>
THICKLENS_FMA double UpdateDirectionFma(const Real* m, const Real* r, Real beta, int count,
                                        Real* p) {
  return UpdateDirection(m, r, beta, count, p);
}
template <typename Real>
THICKLENS_FMA double DotFma(const Real* x, const Real* y, int count) {
  return Dot(x, y, count);
}
template <typename Real>
THICKLENS_FMA void UpdateSolutionFma(Real step, const Real* p, const Real* product, int count,
                                     Real* x, Real* r) {
  UpdateSolution(step, p, product, count, x, r);
}
template <typename Real>
THICKLENS_FMA void MultiplyFma(const PriorRows<Real>& prior, const Real* plane, int y, Real* across,
                               Real* out) {
  prior.Multiply(plane, y, across, out);
}
template <typename Real>
THICKLENS_FMA void AddSquaresFma(const Real* x, const Real* below, int count, Real* squares) {
  AddSquares(x, below, count, squares);
}
template <typename Real>
THICKLENS_FMA void ReweightFma(const Real* slope_squared, const Real* squares, Real half,
                               Real floor, int count, Real* gradient_weight) {
  Reweight(slope_squared, squares, half, floor, count, gradient_weight);
}
#define THICKLENS_BEST(fma, plain) \
  if (HasAvx2AndFma()) return fma; \
  return plain

#else
#define THICKLENS_BEST(fma, plain) return plain
#endif

}  // namespace

template <typename Real>
ResidualSums UpdateRow(const ResidualRow<Real>& row, int count) {
  THICKLENS_BEST(UpdateFma(row, count), Update(row, count));
}

template <typename Real>
double UpdateDirectionRow(const Real* m, const Real* r, Real beta, int count, Real* p) {
  THICKLENS_BEST(UpdateDirectionFma(m, r, beta, count, p), UpdateDirection(m, r, beta, count, p));
}

template <typename Real>
double DotRow(const Real* x, const Real* y, int count) {
  THICKLENS_BEST(DotFma(x, y, count), Dot(x, y, count));
}

template <typename Real>
void UpdateSolutionRow(Real step, const Real* p, const Real* product, int count, Real* x, Real* r) {
  THICKLENS_BEST(UpdateSolutionFma(step, p, product, count, x, r),
                 UpdateSolution(step, p, product, count, x, r));
}

template <typename Real>
void MultiplyPriorRow(const QuadraticPrior<Real>& prior, int width_px, int height_px,
                      const Real* plane, int y, Real* across, Real* out) {
  const PriorRows<Real> rows(prior, width_px, height_px);
  THICKLENS_BEST(MultiplyFma(rows, plane, y, across, out), rows.Multiply(plane, y, across, out));
}

template <typename Real>
void AddSquaredDifferences(const Real* x, const Real* below, int count, Real* squares) {
  THICKLENS_BEST(AddSquaresFma(x, below, count, squares), AddSquares(x, below, count, squares));
}

template <typename Real>
void ReweightRow(const Real* slope_squared, const Real* squares, Real half, Real floor, int count,
                 Real* gradient_weight) {
  THICKLENS_BEST(ReweightFma(slope_squared, squares, half, floor, count, gradient_weight),
                 Reweight(slope_squared, squares, half, floor, count, gradient_weight));
}

#define THICKLENS_ROWS(Real)                                                                     \
  template ResidualSums UpdateRow(const ResidualRow<Real>&, int);                                \
  template double UpdateDirectionRow(const Real*, const Real*, Real, int, Real*);                \
  template double DotRow(const Real*, const Real*, int);                                         \
  template void UpdateSolutionRow(Real, const Real*, const Real*, int, Real*, Real*);            \
  template void MultiplyPriorRow(const QuadraticPrior<Real>&, int, int, const Real*, int, Real*, \
                                 Real*);                                                         \
  template void AddSquaredDifferences(const Real*, const Real*, int, Real*);                     \
  template void ReweightRow(const Real*, const Real*, Real, Real, int, Real*);
THICKLENS_ROWS(float)
THICKLENS_ROWS(double)
#undef THICKLENS_ROWS

}  // namespace thicklens::kernels
