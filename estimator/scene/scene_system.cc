#include "estimator/scene/scene_system.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"

namespace thicklens::estimator {
namespace {

constexpr int kBandRows = 16;

}  // namespace

void ForFixedBands(int height_px, int threads, const std::function<void(int, int)>& rows) {
  const int bands = (height_px + kBandRows - 1) / kBandRows;
  ParallelFor(bands, threads, [&](int band) {
    rows(band * kBandRows, std::min((band + 1) * kBandRows, height_px));
  });
}

Sums SumOverBands(int height_px, int threads, const std::function<Sums(int, int)>& rows) {
  std::vector<Sums> of_band(Index((height_px + kBandRows - 1) / kBandRows));
  ForFixedBands(height_px, threads,
                [&](int y0, int y1) { of_band[Index(y0 / kBandRows)] = rows(y0, y1); });
  Sums sums{};
  for (const Sums& band : of_band) {
    for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += band[i];
  }
  return sums;
}

template <typename Real>
SceneSystem<Real>::SceneSystem(const DataTerm<Real>& data, kernels::Backend* backend)
    : data_(data),
      steps_(backend != nullptr && data.bounds.empty() ? backend->NewSteps(data)
                                                       : kernels::NewCpuRadianceSteps(data)) {}

template <typename Real>
void SceneSystem<Real>::SetPrior(const QuadraticPrior<Real>& prior) {
  steps_->SetPrior(prior);
}

template <typename Real>
void SceneSystem<Real>::SetVariation(const kernels::TotalVariation<Real>& variation) {
  steps_->SetVariation(variation);
}

template <typename Real>
void SceneSystem<Real>::ReweightVariation() {
  steps_->ReweightVariation();
}

template <typename Real>
CgOutcome SceneSystem<Real>::Iterate(const CgLimits& limits, const Renew& renew) {
  const double target = limits.tolerance * limits.tolerance * steps_->SquaredRightSide();
  double before = 0;
  CgOutcome outcome;
  for (;;) {
    const bool may_converge = !renew || renew();
    const kernels::ResidualSums sums = steps_->UpdateResidual();
    outcome.converged = may_converge && sums.squared <= target;
    if (outcome.converged || outcome.iterations == limits.max_iterations) break;
    const double beta =
        before > 0 ? std::max(0.0, (sums.preconditioned - sums.with_previous) / before) : 0;
    before = sums.preconditioned;
    const double steepness = steps_->UpdateDirection(beta);
    const double curvature = steps_->ApplyNormalOperator();
    if (!(curvature > 0)) {  // rounding has removed the direction: this system is solved
      if (may_converge) break;
      continue;
    }
    steps_->UpdateSolution(steps_->StepLength(steepness, curvature));
    ++outcome.iterations;
    if (limits.on_iteration) limits.on_iteration();
  }
  return outcome;
}

template <typename Real>
CgOutcome SceneSystem<Real>::Solve(const CgLimits& limits, std::vector<Real>* x) {
  return SolveRenewed(limits, nullptr, x);
}

template <typename Real>
CgOutcome SceneSystem<Real>::SolveRenewed(const CgLimits& limits, const Renew& renew,
                                          std::vector<Real>* x) {
  steps_->Start(*x);
  *x = {};  // the steps hold the values now
  const CgOutcome outcome = Iterate(limits, renew);
  *x = steps_->Radiance();
  return outcome;
}

template <typename Real>
CgOutcome SceneSystem<Real>::SolveWhitened(const std::vector<Real>& whitened,
                                           const CgLimits& limits, std::vector<Real>* x) {
  std::vector<Real> photograph(data_.pixels());
  for (std::size_t i = 0; i < photograph.size(); ++i) {
    photograph[i] = whitened[i] / std::sqrt(data_.weight[i]);
  }
  x->assign(data_.pixels(), 0);
  steps_->StartFor(photograph, *x);
  const CgOutcome outcome = Iterate(limits, nullptr);
  *x = steps_->Radiance();
  return outcome;
}

template <typename Real>
double SceneSystem<Real>::RelativeResidual(const std::vector<Real>& x) {
  steps_->Start(x);
  const double squared = steps_->UpdateResidual().squared;
  const double squared_right = steps_->SquaredRightSide();
  return std::sqrt(squared_right > 0 ? squared / squared_right : squared);
}

template <typename Real>
double SceneSystem<Real>::DataMisfit(const std::vector<Real>& x) {
  std::vector<Real> projected(x.size());
  data_.projection.apply(x.data(), data_.channels, projected.data());
  double sum = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double difference =
        static_cast<double>(projected[i]) - static_cast<double>(data_.photograph[i]);
    sum += static_cast<double>(data_.weight[i % data_.pixels()]) * difference * difference;
  }
  for (const std::size_t i : data_.bounds) {  // above a bound there is no misfit
    const double difference =
        static_cast<double>(projected[i]) - static_cast<double>(data_.photograph[i]);
    if (difference > 0) {
      sum -= static_cast<double>(data_.weight[i % data_.pixels()]) * difference * difference;
    }
  }
  return sum;
}

template class SceneSystem<float>;
template class SceneSystem<double>;

}  // namespace thicklens::estimator
