#include "scene_patches.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "stored_slope.h"
#include "thicklens/kernels/patch_filter.h"

namespace thicklens::estimator {
namespace {

// Chosen on rendered and simulated scenes with noise of .3 to 3 grey levels.
constexpr double kLeastVariation = 0.5;
constexpr double kExplained = 0.7;  // sigma_p/sigma of a photograph that H explains
constexpr int kAroundPx = 4;
// Of a noise of one grey level; both grow with the noise.
constexpr double kThreshold = 8.1;  // grey levels
constexpr double kPull = 0.15;
constexpr double kThresholdPower = 0.6;
constexpr double kPullPower = 2 * (1 - kThresholdPower);  // as (noise/threshold)^2

// v of a radiance.
template <typename Real>
std::vector<Real> Filtered(const PatchPrior& prior, const DataTerm<Real>& data,
                           const std::vector<Real>& radiance) {
  const double threshold = kThreshold / 255 * std::pow(255 * prior.noise_sigma, kThresholdPower);
  std::vector<Real> values(radiance.size());
  const auto convert = [&](const auto& one) {
    ForBands(data.height_px * data.channels, data.threads, [&](int y0, int y1) {
      const auto width = static_cast<std::size_t>(data.width_px);
      for (std::size_t i = static_cast<std::size_t>(y0) * width;
           i < static_cast<std::size_t>(y1) * width; ++i) {
        values[i] = static_cast<Real>(one(i));
      }
    });
  };
  const StoredValueTable table(prior.transfer);
  convert([&](std::size_t i) { return table.Encode(static_cast<float>(radiance[i])); });
  values = kernels::FilterPatches(data.width_px, data.height_px, data.channels, values, threshold,
                                  data.threads);
  convert([&](std::size_t i) { return prior.transfer.Decode(static_cast<double>(values[i])); });
  return values;
}

}  // namespace

template <typename Real>
std::vector<Real> LocalVariation(const DataTerm<Real>& data, const std::vector<Real>& slope_squared,
                                 const std::vector<Real>& radiance, double noise_sigma) {
  std::vector<Real> shown(radiance.size());
  data.projection.apply(radiance.data(), data.channels, shown.data());
  std::vector<double> squares(data.pixels());
  for (std::size_t i = 0; i < shown.size(); ++i) {
    const std::size_t pixel = i % data.pixels();
    const double left = static_cast<double>(shown[i]) - static_cast<double>(data.photograph[i]);
    squares[pixel] += static_cast<double>(slope_squared[pixel]) * left * left / data.channels;
  }
  cv::Mat around(data.height_px, data.width_px, CV_64F, squares.data());
  constexpr int kSize = 2 * kAroundPx + 1;
  cv::blur(around, around, {kSize, kSize}, {-1, -1}, cv::BORDER_REPLICATE);
  const double explained = kExplained * kExplained * noise_sigma * noise_sigma;
  std::vector<Real> shares;
  shares.reserve(squares.size());
  for (const double square : squares) {
    const double share = kLeastVariation * std::pow(std::max(square, 0.0) / explained, 0.75);
    shares.push_back(static_cast<Real>(std::clamp(share, kLeastVariation, 1.0)));
  }
  return shares;
}

template <typename Real>
RadianceOutcome SolveWithPatches(const PatchPrior& prior, const DataTerm<Real>& data,
                                 const std::vector<Real>& slope_squared,
                                 const RadianceLimits& limits, SceneSystem<Real>* system,
                                 std::vector<Real>* radiance) {
  RadianceLimits left = limits;
  RadianceOutcome whole;
  const auto solve_variation = [&](const std::vector<Real>& slopes) {
    const RadianceOutcome outcome =
        SolveRadiance(Prior::kTotalVariation, prior.strength, data, slopes, left, system, radiance);
    whole.iterations += outcome.iterations;
    whole.reweightings += outcome.reweightings;
    left.max_iterations -= outcome.iterations;
  };
  solve_variation(slope_squared);
  {
    // Of the slopes the square: f s |dr| for s |dr|.
    std::vector<Real> slopes = LocalVariation(data, slope_squared, *radiance, prior.noise_sigma);
    for (std::size_t i = 0; i < slopes.size(); ++i) slopes[i] *= slopes[i] * slope_squared[i];
    solve_variation(slopes);
  }
  QuadraticPrior<Real> near_filtered;
  near_filtered.target = Filtered(prior, data, *radiance);
  near_filtered.pull = slope_squared;
  const double share = kPull * std::pow(255 * prior.noise_sigma, kPullPower);
  for (Real& pull : near_filtered.pull) pull *= static_cast<Real>(share);
  system->SetPrior(near_filtered);
  CgLimits cg;
  cg.tolerance = limits.tolerance;
  cg.max_iterations = left.max_iterations;
  cg.on_iteration = limits.on_iteration;
  *radiance = std::move(near_filtered.target);
  whole.iterations += system->Solve(cg, radiance).iterations;
  whole.relative_residual = system->RelativeResidual(*radiance);
  whole.converged = whole.relative_residual <= limits.tolerance;
  return whole;
}

#define THICKLENS_PATCHES(Real)                                                              \
  template RadianceOutcome SolveWithPatches(const PatchPrior&, const DataTerm<Real>&,        \
                                            const std::vector<Real>&, const RadianceLimits&, \
                                            SceneSystem<Real>*, std::vector<Real>*);         \
  template std::vector<Real> LocalVariation(const DataTerm<Real>&, const std::vector<Real>&, \
                                            const std::vector<Real>&, double);
THICKLENS_PATCHES(float)
THICKLENS_PATCHES(double)
#undef THICKLENS_PATCHES

}  // namespace thicklens::estimator
