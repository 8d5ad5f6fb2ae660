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
  Doubles squared{}, preconditioned{}, with_former{};
  int i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    Lanes<Real> r, prior, m, former;
    Load(row.data + i, &r);
    Load(row.prior + i, &prior);
    Load(row.inverse_diagonal + i, &m);
    Load(row.residual + i, &former);
    r -= prior;
    if (row.pull != nullptr) {
      Lanes<Real> pull, target;
      Load(row.pull + i, &pull);
      Load(row.target + i, &target);
      r += pull * target;
    }
    Store(r, row.residual + i);
    const Doubles wide = __builtin_convertvector(r, Doubles);
    const Lanes<Real> step = m * r;
    const Doubles wide_step = __builtin_convertvector(step, Doubles);
    squared += wide * wide;
    preconditioned += wide * wide_step;
    with_former += __builtin_convertvector(former, Doubles) * wide_step;
  }
  ResidualSums sums{Total(squared), Total(preconditioned), Total(with_former)};
  for (; i < count; ++i) {
    Real r = row.data[i] - row.prior[i];
    if (row.pull != nullptr) r += row.pull[i] * row.target[i];
    const double step = static_cast<double>(row.inverse_diagonal[i] * r);
    sums.squared += static_cast<double>(r) * static_cast<double>(r);
    sums.preconditioned += static_cast<double>(r) * step;
    sums.with_former += static_cast<double>(row.residual[i]) * step;
    row.residual[i] = r;
  }
  return sums;
}

template <typename Real>
THICKLENS_INLINE double Turn(const Real* m, const Real* r, Real beta, int count, Real* p) {
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
THICKLENS_INLINE void Advance(Real step, const Real* p, const Real* product, int count,
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
THICKLENS_INLINE void Touch(const Real* slope_squared, const Real* squares, Real half, Real floor,
                            int count, Real* __restrict smoothness) {
  for (int i = 0; i < count; ++i) {
    const Real s2 = slope_squared[i];
    smoothness[i] = half * s2 / std::sqrt(s2 * squares[i] + floor);
  }
}

#if defined(__x86_64__)

#define THICKLENS_FMA __attribute__((target("avx2,fma")))

template <typename Real>
THICKLENS_FMA ResidualSums UpdateFma(const ResidualRow<Real>& row, int count) {
  return Update(row, count);
}
template <typename Real>
THICKLENS_FMA double TurnFma(const Real* m, const Real* r, Real beta, int count, Real* p) {
  return Turn(m, r, beta, count, p);
}
template <typename Real>
THICKLENS_FMA double DotFma(const Real* x, const Real* y, int count) {
  return Dot(x, y, count);
}
template <typename Real>
THICKLENS_FMA void AdvanceFma(Real step, const Real* p, const Real* product, int count, Real* x,
                              Real* r) {
  Advance(step, p, product, count, x, r);
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
THICKLENS_FMA void TouchFma(const Real* slope_squared, const Real* squares, Real half, Real floor,
                            int count, Real* smoothness) {
  Touch(slope_squared, squares, half, floor, count, smoothness);
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
double TurnRow(const Real* m, const Real* r, Real beta, int count, Real* p) {
  THICKLENS_BEST(TurnFma(m, r, beta, count, p), Turn(m, r, beta, count, p));
}

template <typename Real>
double DotRow(const Real* x, const Real* y, int count) {
  THICKLENS_BEST(DotFma(x, y, count), Dot(x, y, count));
}

template <typename Real>
void AdvanceRow(Real step, const Real* p, const Real* product, int count, Real* x, Real* r) {
  THICKLENS_BEST(AdvanceFma(step, p, product, count, x, r), Advance(step, p, product, count, x, r));
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
void TouchRow(const Real* slope_squared, const Real* squares, Real half, Real floor, int count,
              Real* smoothness) {
  THICKLENS_BEST(TouchFma(slope_squared, squares, half, floor, count, smoothness),
                 Touch(slope_squared, squares, half, floor, count, smoothness));
}

#define THICKLENS_ROWS(Real)                                                                     \
  template ResidualSums UpdateRow(const ResidualRow<Real>&, int);                                \
  template double TurnRow(const Real*, const Real*, Real, int, Real*);                           \
  template double DotRow(const Real*, const Real*, int);                                         \
  template void AdvanceRow(Real, const Real*, const Real*, int, Real*, Real*);                   \
  template void MultiplyPriorRow(const QuadraticPrior<Real>&, int, int, const Real*, int, Real*, \
                                 Real*);                                                         \
  template void AddSquaredDifferences(const Real*, const Real*, int, Real*);                     \
  template void TouchRow(const Real*, const Real*, Real, Real, int, Real*);
THICKLENS_ROWS(float)
THICKLENS_ROWS(double)
#undef THICKLENS_ROWS

}  // namespace thicklens::kernels
