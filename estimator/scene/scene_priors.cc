#include "estimator/scene/scene_priors.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "thicklens/base/index.h"

namespace thicklens::estimator {
namespace {

// Sets the sum over the channels of the squared forward differences at each pixel of a row.
template <typename Real>
void SquaredDifferences(const DataTerm<Real>& data, const std::vector<Real>& image, int y,
                        std::vector<Real>* squares) {
  const int width = data.width_px;
  std::fill(squares->begin(), squares->end(), Real(0));
  for (int channel = 0; channel < data.channels; ++channel) {
    const Real* r = image.data() + Index(channel) * data.pixels() + Index(y) * Index(width);
    Real* out = squares->data();
    for (int i = 0; i + 1 < width; ++i) {
      const Real across = r[i + 1] - r[i];
      out[i] += across * across;
    }
    if (y + 1 == data.height_px) continue;
    for (int i = 0; i < width; ++i) {
      const Real down = r[i + width] - r[i];
      out[i] += down * down;
    }
  }
}

// Returns the sum over the pixels of the rows [first, last) of s^2 |grad I|^2, channels and both
// differences added.
template <typename Real>
double SumSquaredGradient(const DataTerm<Real>& data, const std::vector<Real>& slope_squared,
                          int first, int last) {
  const Sums sums = SumOverBands(data.height_px, data.threads, [&](int y0, int y1) {
    std::vector<Real> squares(Index(data.width_px));
    double sum = 0;
    for (int y = std::max(y0, first); y < std::min(y1, last); ++y) {
      SquaredDifferences(data, data.photograph, y, &squares);
      for (std::size_t i = 0; i < squares.size(); ++i) {
        sum += static_cast<double>(squares[i]) *
               static_cast<double>(slope_squared[Index(y) * Index(data.width_px) + i]);
      }
    }
    return Sums{sum};
  });
  return sums[0];
}

// Returns the mean over all pixels.
template <typename Real>
double MeanSquaredGradient(const DataTerm<Real>& data, const std::vector<Real>& slope_squared) {
  return SumSquaredGradient(data, slope_squared, 0, data.height_px) /
         static_cast<double>(data.pixels());
}

// Returns the sum over the pixels of the rows and channels of s^2 |I - H I|^2.
template <typename Real>
double SumSquaredBlurLoss(const DataTerm<Real>& data, const std::vector<Real>& slope_squared,
                          int first, int last) {
  std::vector<Real> blurred(data.photograph.size());
  data.projection.apply(data.photograph.data(), data.channels, blurred.data());
  double sum = 0;
  for (int channel = 0; channel < data.channels; ++channel) {
    const std::size_t plane = Index(channel) * data.pixels();
    for (std::size_t i = Index(first) * Index(data.width_px);
         i < Index(last) * Index(data.width_px); ++i) {
      const double lost =
          static_cast<double>(data.photograph[plane + i]) - static_cast<double>(blurred[plane + i]);
      sum += static_cast<double>(slope_squared[i]) * lost * lost;
    }
  }
  return sum;
}

// The inverse of the ratio of the sharp scene's variance to the variance that the photograph shows:
// within a factor of 2 of the best on rendered and simulated scenes with noise of 0.3/255 to 4/255.
constexpr double kRidgeShare = 0.2;
constexpr double kGradientShare = 0.125;
// Minimum signal relative to the noise: a smaller signal cannot be distinguished from noise.
constexpr double kMinSignal = 0.25;

}  // namespace

template <typename Real>
SignalSum SignalOf(Prior prior, const DataTerm<Real>& data, const std::vector<Real>& slope_squared,
                   int first_row, int last_row) {
  const double values = static_cast<double>(last_row - first_row) * data.width_px * data.channels;
  switch (prior) {
    case Prior::kRidge:
      return {SumSquaredBlurLoss(data, slope_squared, first_row, last_row), values};
    case Prior::kGradient:
      return {SumSquaredGradient(data, slope_squared, first_row, last_row), 2 * values};
    case Prior::kTotalVariation:
    case Prior::kPatches:
      break;
  }
  return {};
}

double StrengthForNoise(Prior prior, double sigma, const SignalSum& signal) {
  if (!NeedsSignal(prior)) return 1e-3 * std::pow(255 * sigma, 1.5);
  const double noise = sigma * sigma;
  const double mean = signal.squares / signal.count;
  if (prior == Prior::kRidge) {
    return kRidgeShare * noise / std::max(mean - noise, kMinSignal * noise);
  }
  return kGradientShare * noise / std::max(mean - 2 * noise, kMinSignal * noise);
}

template <typename Real>
double StrengthForNoise(Prior prior, double sigma, const DataTerm<Real>& data,
                        const std::vector<Real>& slope_squared) {
  return StrengthForNoise(prior, sigma, SignalOf(prior, data, slope_squared, 0, data.height_px));
}

template <typename Real>
QuadraticPrior<Real> RidgePrior(const std::vector<Real>& slope_squared, double mu) {
  QuadraticPrior<Real> prior;
  prior.target_is_photograph = true;
  prior.tikhonov_weight = slope_squared;
  for (Real& value : prior.tikhonov_weight) value *= static_cast<Real>(mu);
  return prior;
}

template <typename Real>
QuadraticPrior<Real> GradientPrior(const std::vector<Real>& slope_squared, double eta) {
  QuadraticPrior<Real> prior;
  prior.tikhonov_weight.assign(slope_squared.size(), static_cast<Real>(kMinTikhonovWeight));
  prior.gradient_weight = slope_squared;
  for (Real& value : prior.gradient_weight) value *= static_cast<Real>(eta);
  return prior;
}

template <typename Real>
kernels::TotalVariation<Real> VariationPrior(const std::vector<Real>& slope_squared,
                                             double lambda) {
  return {&slope_squared, lambda, kVariationEps, kMinTikhonovWeight};
}

template <typename Real>
QuadraticPrior<Real> ReweightedPrior(const DataTerm<Real>& data,
                                     const std::vector<Real>& slope_squared, double lambda,
                                     const std::vector<Real>& radiance) {
  QuadraticPrior<Real> prior;
  prior.tikhonov_weight.assign(data.pixels(), static_cast<Real>(kMinTikhonovWeight));
  prior.gradient_weight.resize(data.pixels());
  ForFixedBands(data.height_px, data.threads, [&](int y0, int y1) {
    std::vector<Real> squares(Index(data.width_px));
    for (int y = y0; y < y1; ++y) {
      SquaredDifferences(data, radiance, y, &squares);
      for (std::size_t x = 0; x < squares.size(); ++x) {
        const std::size_t i = Index(y) * Index(data.width_px) + x;
        const auto slope = static_cast<double>(slope_squared[i]);
        prior.gradient_weight[i] = static_cast<Real>(
            lambda / 2 * slope /
            std::sqrt(slope * static_cast<double>(squares[x]) + kVariationEps * kVariationEps));
      }
    }
  });
  return prior;
}

namespace {

// First iterations of total variation with equal weights everywhere, which bring the blurred parts
// of the photograph close to their final values.
constexpr int kStartIterations = 4;
// The ridge of a pixel with a clipped value, over that of others: the photograph does not say what
// its radiance is near.
constexpr double kRidgeOfBounds = 0.01;

// Returns the ridge of a photograph, some of whose values may be lower bounds.
template <typename Real>
QuadraticPrior<Real> RidgeOf(const DataTerm<Real>& data, const std::vector<Real>& slope_squared,
                             double mu) {
  QuadraticPrior<Real> ridge = RidgePrior(slope_squared, mu);
  for (const std::size_t bound : data.bounds) {
    const std::size_t pixel = bound % data.pixels();
    ridge.tikhonov_weight[pixel] = static_cast<Real>(kRidgeOfBounds * mu) * slope_squared[pixel];
  }
  return ridge;
}

}  // namespace

template <typename Real>
RadianceOutcome SolveRadiance(Prior prior, double strength, const DataTerm<Real>& data,
                              const std::vector<Real>& slope_squared, const RadianceLimits& limits,
                              SceneSystem<Real>* system, std::vector<Real>* radiance) {
  RadianceOutcome outcome;
  CgLimits cg;
  cg.tolerance = limits.tolerance;
  cg.max_iterations = limits.max_iterations;
  cg.on_iteration = limits.on_iteration;
  if (prior == Prior::kTotalVariation) {
    // The weight that is used everywhere is that of the photograph's own variation.
    const double eta =
        strength /
        (2 * std::sqrt(MeanSquaredGradient(data, slope_squared) + kVariationEps * kVariationEps));
    system->SetPrior(GradientPrior(slope_squared, eta));
    system->SetVariation(VariationPrior(slope_squared, strength));
    int calls = 0;
    const auto renew = [&] {
      if (calls++ < kStartIterations) return false;
      system->ReweightVariation();
      ++outcome.reweightings;
      return true;
    };
    outcome.iterations = system->SolveRenewed(cg, renew, radiance).iterations;
    system->ReweightVariation();
  } else {
    system->SetPrior(prior == Prior::kRidge ? RidgeOf(data, slope_squared, strength)
                                            : GradientPrior(slope_squared, strength));
    outcome.iterations = system->Solve(cg, radiance).iterations;
  }
  outcome.relative_residual = system->RelativeResidual(*radiance);
  outcome.converged = outcome.relative_residual <= limits.tolerance;
  return outcome;
}

#define THICKLENS_PRIORS(Real)                                                                   \
  template SignalSum SignalOf(Prior, const DataTerm<Real>&, const std::vector<Real>&, int, int); \
  template double StrengthForNoise(Prior, double, const DataTerm<Real>&,                         \
                                   const std::vector<Real>&);                                    \
  template QuadraticPrior<Real> RidgePrior(const std::vector<Real>&, double);                    \
  template QuadraticPrior<Real> GradientPrior(const std::vector<Real>&, double);                 \
  template QuadraticPrior<Real> ReweightedPrior(const DataTerm<Real>&, const std::vector<Real>&, \
                                                double, const std::vector<Real>&);               \
  template kernels::TotalVariation<Real> VariationPrior(const std::vector<Real>&, double);       \
  template RadianceOutcome SolveRadiance(Prior, double, const DataTerm<Real>&,                   \
                                         const std::vector<Real>&, const RadianceLimits&,        \
                                         SceneSystem<Real>*, std::vector<Real>*);
THICKLENS_PRIORS(float)
THICKLENS_PRIORS(double)
#undef THICKLENS_PRIORS

}  // namespace thicklens::estimator
