#include "scene_system.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "thicklens/model/parallel.h"

namespace thicklens::estimator {
namespace {

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

constexpr int kBandRows = 16;

// Sum of x y in double. Eight sums side by side, which a compiler may keep in vectors.
template <typename Real>
double RowDot(const Real* x, const Real* y, int count) {
  constexpr int kLanes = 8;
  double lanes[kLanes] = {};
  int i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    for (int lane = 0; lane < kLanes; ++lane) {
      lanes[lane] += static_cast<double>(x[i + lane]) * static_cast<double>(y[i + lane]);
    }
  }
  double sum = std::accumulate(lanes, lanes + kLanes, 0.0);
  for (; i < count; ++i) sum += static_cast<double>(x[i]) * static_cast<double>(y[i]);
  return sum;
}

// Sum of m x y.
template <typename Real>
double RowDot(const Real* x, const Real* y, const Real* m, int count) {
  constexpr int kLanes = 8;
  double lanes[kLanes] = {};
  int i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    for (int lane = 0; lane < kLanes; ++lane) {
      lanes[lane] +=
          static_cast<double>(x[i + lane] * y[i + lane]) * static_cast<double>(m[i + lane]);
    }
  }
  double sum = std::accumulate(lanes, lanes + kLanes, 0.0);
  for (; i < count; ++i) sum += static_cast<double>(x[i] * y[i]) * static_cast<double>(m[i]);
  return sum;
}

// Rows of P x: pull x, and smoothness times the differences, taken back by the transposed ones.
template <typename Real>
class PriorRows {
 public:
  PriorRows(const QuadraticPrior<Real>& prior, int width_px, int height_px)
      : pull_(prior.pull.data()),
        t_(prior.smoothness.empty() ? nullptr : prior.smoothness.data()),
        width_(width_px),
        height_(height_px) {}

  // across: room for width + 1 numbers.
  void Multiply(const Real* plane, int y, Real* across, Real* out) const {
    const std::size_t row = Index(y) * Index(width_);
    const Real* x = plane + row;
    const Real* pull = pull_ + row;
    for (int i = 0; i < width_; ++i) out[i] = pull[i] * x[i];
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

  // The smoothness of all differences that a pixel has part in, and its pull.
  void AddDiagonal(int y, Real* out) const {
    const Real* pull = pull_ + Index(y) * Index(width_);
    for (int i = 0; i < width_; ++i) out[i] += pull[i];
    if (t_ == nullptr) return;
    const Real* t = t_ + Index(y) * Index(width_);
    for (int i = 0; i < width_; ++i) {
      if (i + 1 < width_) out[i] += t[i];
      if (i > 0) out[i] += t[i - 1];
      if (y + 1 < height_) out[i] += t[i];
      if (y > 0) out[i] += t[i - width_];
    }
  }

 private:
  const Real* pull_;
  const Real* t_;
  int width_, height_;
};

}  // namespace

void ForBands(int height_px, int threads, const std::function<void(int, int)>& rows) {
  const int bands = (height_px + kBandRows - 1) / kBandRows;
  model::ParallelFor(bands, threads, [&](int band) {
    rows(band * kBandRows, std::min((band + 1) * kBandRows, height_px));
  });
}

Sums SumOverBands(int height_px, int threads, const std::function<Sums(int, int)>& rows) {
  std::vector<Sums> of_band(Index((height_px + kBandRows - 1) / kBandRows));
  ForBands(height_px, threads,
           [&](int y0, int y1) { of_band[Index(y0 / kBandRows)] = rows(y0, y1); });
  Sums sums{};
  for (const Sums& band : of_band) {
    for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += band[i];
  }
  return sums;
}

template <typename Real>
SceneSystem<Real>::SceneSystem(const DataTerm<Real>& data)
    : data_(data),
      weighted_photograph_(data.photograph.size()),
      data_diagonal_(data.pixels()),
      inverse_diagonal_(data.pixels()),
      projected_(data.photograph.size()) {
  const std::size_t pixels = data.pixels();
  for (int channel = 0; channel < data.channels; ++channel) {
    const std::size_t plane = Index(channel) * pixels;
    for (std::size_t i = 0; i < pixels; ++i) {
      projected_[plane + i] = data.weight[i] * data.photograph[plane + i];
    }
  }
  data.projection.apply_transposed(projected_.data(), data.channels, weighted_photograph_.data());
  // The diagonal is sum_i W_i H_ij^2. Taking H_ij^2 for H_ij times the row's mean of H by itself,
  // sum_j H_ij^2, costs one application; exact where a row's weights are equal.
  for (std::size_t i = 0; i < pixels; ++i) projected_[i] = data.weight[i] * data.squared_row[i];
  data.projection.apply_transposed(projected_.data(), 1, data_diagonal_.data());
}

template <typename Real>
void SceneSystem<Real>::SetPrior(QuadraticPrior<Real> prior) {
  prior_ = std::move(prior);
  UpdatePreconditioner();
}

template <typename Real>
void SceneSystem<Real>::UpdatePreconditioner() {
  const int width = data_.width_px;
  const PriorRows<Real> prior(prior_, width, data_.height_px);
  ForBands(data_.height_px, data_.threads, [&](int y0, int y1) {
    for (int y = y0; y < y1; ++y) {
      const std::size_t row = Index(y) * Index(width);
      Real* out = inverse_diagonal_.data() + row;
      std::copy_n(data_diagonal_.data() + row, width, out);
      prior.AddDiagonal(y, out);
      for (int i = 0; i < width; ++i) out[i] = 1 / out[i];
    }
  });
}

template <typename Real>
void SceneSystem<Real>::MultiplyData(const Real* x, int channels, Real* y) {
  const std::size_t pixels = data_.pixels();
  data_.projection.apply(x, channels, projected_.data());
  ForBands(data_.height_px, data_.threads, [&](int y0, int y1) {
    const std::size_t end = Index(y1) * Index(data_.width_px);
    for (int channel = 0; channel < channels; ++channel) {
      Real* plane = projected_.data() + Index(channel) * pixels;
      for (std::size_t i = Index(y0) * Index(data_.width_px); i < end; ++i) {
        plane[i] *= data_.weight[i];
      }
    }
  });
  data_.projection.apply_transposed(projected_.data(), channels, y);
}

template <typename Real>
typename SceneSystem<Real>::RightSide SceneSystem<Real>::PhotographSide() const {
  return {weighted_photograph_.data(),
          prior_.target_is_photograph ? data_.photograph.data() : nullptr, data_.channels};
}

template <typename Real>
double SceneSystem<Real>::SquaredRightSide(const RightSide& right) const {
  double sum = 0;
  for (std::size_t i = 0; i < data_.pixels() * Index(right.channels); ++i) {
    Real b = right.data[i];
    if (right.target != nullptr) b += prior_.pull[i % data_.pixels()] * right.target[i];
    sum += static_cast<double>(b) * static_cast<double>(b);
  }
  return sum;
}

template <typename Real>
typename SceneSystem<Real>::ResidualSums SceneSystem<Real>::UpdateResidual(
    const RightSide& right, const std::vector<Real>& x, const std::vector<Real>& data_residual,
    std::vector<Real>* r) const {
  const int width = data_.width_px;
  const PriorRows<Real> prior(prior_, width, data_.height_px);
  const Sums sums = SumOverBands(data_.height_px, data_.threads, [&](int y0, int y1) {
    std::vector<Real> across(Index(width) + 1), row(Index(width));
    Sums of_band{};
    for (int channel = 0; channel < right.channels; ++channel) {
      const std::size_t plane = Index(channel) * data_.pixels();
      for (int y = y0; y < y1; ++y) {
        const std::size_t pixel = Index(y) * Index(width);
        prior.Multiply(x.data() + plane, y, across.data(), row.data());
        const Real* from = data_residual.data() + plane + pixel;
        for (int i = 0; i < width; ++i) row[Index(i)] = from[i] - row[Index(i)];
        if (right.target != nullptr) {
          const Real* target = right.target + plane + pixel;
          const Real* pull = prior_.pull.data() + pixel;
          for (int i = 0; i < width; ++i) row[Index(i)] += pull[i] * target[i];
        }
        Real* out = r->data() + plane + pixel;
        const Real* m = inverse_diagonal_.data() + pixel;
        of_band[0] += RowDot(row.data(), row.data(), width);
        of_band[1] += RowDot(row.data(), row.data(), m, width);
        of_band[2] += RowDot(row.data(), out, m, width);
        std::copy(row.begin(), row.end(), out);
      }
    }
    return of_band;
  });
  return {sums[0], sums[1], sums[2]};
}

template <typename Real>
CgOutcome SceneSystem<Real>::Iterate(const RightSide& right, const CgLimits& limits,
                                     const Renew& renew, std::vector<Real>* x) {
  const int width = data_.width_px;
  const std::size_t pixels = data_.pixels();
  const std::size_t count = pixels * Index(right.channels);
  // Sums over all rows of all channels; `first` is a row's first number, `pixel` its first pixel.
  using RowWork = std::function<double(std::size_t first, std::size_t pixel)>;
  const auto sum_rows = [&](const RowWork& row) {
    return SumOverBands(data_.height_px, data_.threads, [&](int y0, int y1) {
      Sums sums{};
      for (int channel = 0; channel < right.channels; ++channel) {
        for (int y = y0; y < y1; ++y) {
          const std::size_t pixel = Index(y) * Index(width);
          sums[0] += row(Index(channel) * pixels + pixel, pixel);
        }
      }
      return sums;
    })[0];
  };
  // p . P p.
  const auto prior_curvature = [&](const std::vector<Real>& p) {
    const PriorRows<Real> prior(prior_, width, data_.height_px);
    return SumOverBands(data_.height_px, data_.threads, [&](int y0, int y1) {
      std::vector<Real> across(Index(width) + 1), row(Index(width));
      Sums sums{};
      for (int channel = 0; channel < right.channels; ++channel) {
        const Real* plane = p.data() + Index(channel) * pixels;
        for (int y = y0; y < y1; ++y) {
          prior.Multiply(plane, y, across.data(), row.data());
          sums[0] += RowDot(plane + Index(y) * Index(width), row.data(), width);
        }
      }
      return sums;
    })[0];
  };

  const double target = limits.tolerance * limits.tolerance * SquaredRightSide(right);
  std::vector<Real> data_residual(right.data, right.data + count);
  std::vector<Real> residual(count, Real(0)), direction(count, Real(0)), product(count);
  MultiplyData(x->data(), right.channels, product.data());
  for (std::size_t i = 0; i < count; ++i) data_residual[i] -= product[i];
  double before = 0;
  CgOutcome outcome;
  for (;;) {
    const bool may_converge = !renew || renew(*x);
    const ResidualSums sums = UpdateResidual(right, *x, data_residual, &residual);
    outcome.converged = may_converge && sums.squared <= target;
    if (outcome.converged || outcome.iterations == limits.max_iterations) break;
    const double beta =
        before > 0 ? std::max(0.0, (sums.preconditioned - sums.with_former) / before) : 0;
    before = sums.preconditioned;
    const double steepness = sum_rows([&](std::size_t first, std::size_t pixel) {
      Real* p = direction.data() + first;
      const Real* r = residual.data() + first;
      const Real* m = inverse_diagonal_.data() + pixel;
      for (int i = 0; i < width; ++i) p[i] = m[i] * r[i] + static_cast<Real>(beta) * p[i];
      return RowDot(p, r, width);
    });
    MultiplyData(direction.data(), right.channels, product.data());
    const double curvature =
        prior_curvature(direction) + sum_rows([&](std::size_t first, std::size_t) {
          return RowDot(direction.data() + first, product.data() + first, width);
        });
    if (!(curvature > 0)) {  // rounding has eaten the direction: this system is solved
      if (may_converge) break;
      continue;
    }
    const Real step = static_cast<Real>(steepness / curvature);
    sum_rows([&](std::size_t first, std::size_t) {
      Real* to = x->data() + first;
      Real* r = data_residual.data() + first;
      const Real* p = direction.data() + first;
      const Real* take = product.data() + first;
      for (int i = 0; i < width; ++i) to[i] += step * p[i];
      for (int i = 0; i < width; ++i) r[i] -= step * take[i];
      return 0.0;
    });
    ++outcome.iterations;
    if (limits.on_iteration) limits.on_iteration();
  }
  return outcome;
}

template <typename Real>
CgOutcome SceneSystem<Real>::Solve(const CgLimits& limits, std::vector<Real>* x) {
  return Iterate(PhotographSide(), limits, nullptr, x);
}

template <typename Real>
CgOutcome SceneSystem<Real>::SolveRenewed(const CgLimits& limits, const Renew& renew,
                                          std::vector<Real>* x) {
  return Iterate(PhotographSide(), limits, renew, x);
}

template <typename Real>
CgOutcome SceneSystem<Real>::SolveWhitened(const std::vector<Real>& whitened,
                                           const CgLimits& limits, std::vector<Real>* x) {
  const std::size_t pixels = data_.pixels();
  std::vector<Real> weighted(pixels), photograph(pixels), right(pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    const Real root = std::sqrt(data_.weight[i]);
    weighted[i] = root * whitened[i];
    photograph[i] = whitened[i] / root;
  }
  data_.projection.apply_transposed(weighted.data(), 1, right.data());
  x->assign(pixels, 0);
  return Iterate({right.data(), prior_.target_is_photograph ? photograph.data() : nullptr, 1},
                 limits, nullptr, x);
}

template <typename Real>
double SceneSystem<Real>::RelativeResidual(const std::vector<Real>& x) {
  const RightSide right = PhotographSide();
  std::vector<Real> product(x.size()), residual(x.size(), Real(0));
  MultiplyData(x.data(), data_.channels, product.data());
  for (std::size_t i = 0; i < x.size(); ++i) product[i] = right.data[i] - product[i];
  const double squared = UpdateResidual(right, x, product, &residual).squared;
  const double squared_right = SquaredRightSide(right);
  return std::sqrt(squared_right > 0 ? squared / squared_right : squared);
}

template <typename Real>
double SceneSystem<Real>::DataMisfit(const std::vector<Real>& x) {
  data_.projection.apply(x.data(), data_.channels, projected_.data());
  double sum = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double difference =
        static_cast<double>(projected_[i]) - static_cast<double>(data_.photograph[i]);
    sum += static_cast<double>(data_.weight[i % data_.pixels()]) * difference * difference;
  }
  return sum;
}

template class SceneSystem<float>;
template class SceneSystem<double>;

}  // namespace thicklens::estimator
