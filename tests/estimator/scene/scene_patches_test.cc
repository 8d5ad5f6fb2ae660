// The parts of the prior on patches. Its effect on the results is tested with the solver.
#include "estimator/scene/scene_patches.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <random>
#include <utility>
#include <vector>

namespace thicklens::estimator {
namespace {

constexpr int kWidth = 60, kHeight = 40, kChannels = 3;
constexpr std::size_t kPixels = kWidth * kHeight;

// A photograph without blur: H is 1.
template <typename Real>
DataTerm<Real> SharpPhotograph(double noise_sigma, int threads) {
  DataTerm<Real> data;
  data.width_px = kWidth;
  data.height_px = kHeight;
  data.channels = kChannels;
  data.threads = threads;
  data.projection.apply = [](const Real* x, int channels, Real* y) {
    std::copy_n(x, static_cast<std::size_t>(channels) * kPixels, y);
  };
  data.projection.apply_transposed = data.projection.apply;
  std::mt19937 engine(1);
  std::normal_distribution<double> noise(0, 1);
  for (std::size_t i = 0; i < kChannels * kPixels; ++i) {
    const double wave = 0.1 * std::sin(0.9 * static_cast<double>(i % kWidth));
    data.photograph.push_back(static_cast<Real>(0.5 + wave + noise_sigma * noise(engine)));
  }
  data.weight.assign(kPixels, Real{1});
  data.row_norm2.assign(kPixels, Real{1});
  return data;
}

TEST(ScenePatches, NeedAllVariationWhereThePhotographIsNotExplained) {
  const DataTerm<double> data = SharpPhotograph<double>(0, 1);
  const std::vector<double> slope_squared(kPixels, 4.0);
  std::vector<double> radiance = data.photograph;
  for (std::size_t channel = 0; channel < kChannels; ++channel) {
    for (std::size_t i = 0; i < kPixels; ++i) {
      // s times it is 0 in the upper half, 1.4 sigma in the lower.
      if (i >= kPixels / 2) radiance[channel * kPixels + i] += i % 2 == 0 ? 0.007 : -0.007;
    }
  }
  const std::vector<double> shares = LocalVariation(data, slope_squared, radiance, 0.01);
  ASSERT_EQ(shares.size(), kPixels);
  EXPECT_EQ(shares[5 * kWidth + 5], 0.5);
  EXPECT_EQ(shares[35 * kWidth + 5], 1);
  // At the border four rows of nine have it: (4/9 1.4^2/0.7^2)^0.75/2.
  EXPECT_NEAR(shares[19 * kWidth + 30], 0.5 * std::pow(4.0 / 9 * 4, 0.75), 1e-9);
}

// A wave with noise, in focus: the photograph is close to the scene, and its noise is removed.
TEST(ScenePatches, TakeNoiseOutOfAWave) {
  const DataTerm<double> clean = SharpPhotograph<double>(0, 1);
  constexpr double kSigma = 4.0 / 255;
  const DataTerm<double> data = SharpPhotograph<double>(kSigma, 1);
  const std::vector<double> slope_squared(kPixels, 1.0);
  const auto rms_error = [&](const std::vector<double>& radiance) {
    double sum = 0;
    for (std::size_t i = 0; i < radiance.size(); ++i) {
      sum += std::pow(radiance[i] - clean.photograph[i], 2);
    }
    return std::sqrt(sum / static_cast<double>(radiance.size()));
  };
  auto system = std::make_unique<SceneSystem<double>>(data);
  std::vector<double> radiance = data.photograph, smooth = radiance;
  const double strength = 1e-3 * std::pow(255 * kSigma, 1.5);
  SolveRadiance(Prior::kTotalVariation, strength, data, slope_squared, {}, system.get(), &smooth);
  const RadianceOutcome outcome =
      SolveWithPatches({strength, kSigma, model::TransferCurve::Linear()}, data, slope_squared, {},
                       std::move(system), nullptr, &radiance);
  EXPECT_TRUE(outcome.converged);
  EXPECT_LT(rms_error(radiance), 0.85 * rms_error(smooth));
  EXPECT_LT(rms_error(radiance), 0.75 * kSigma);
}

TEST(ScenePatches, StopAtTheLimitOfIterations) {
  const DataTerm<double> data = SharpPhotograph<double>(0.02, 1);
  RadianceLimits limits;
  limits.tolerance = 1e-9;
  limits.max_iterations = 5;
  std::vector<double> radiance = data.photograph;
  const RadianceOutcome outcome =
      SolveWithPatches({1e-3, 0.02, {}}, data, std::vector<double>(kPixels, 1.0), limits,
                       std::make_unique<SceneSystem<double>>(data), nullptr, &radiance);
  EXPECT_EQ(outcome.iterations, 5);
  EXPECT_FALSE(outcome.converged);
}

// A relief whose normals are not done within the limit is left alone, and takes no iterations from
// the image's.
TEST(ScenePatches, LeaveTheReliefAtTheLimitOfIterations) {
  DataTerm<double> data = SharpPhotograph<double>(0.02, 1);
  // H takes the mean of a pixel and its right neighbour: no system is done in few iterations.
  const auto blur = [](const double* x, int channels, double* y) {
    for (std::size_t i = 0; i < static_cast<std::size_t>(channels) * kPixels; ++i) {
      y[i] = i % kWidth + 1 < kWidth ? (x[i] + x[i + 1]) / 2 : x[i];
    }
  };
  data.projection.apply = blur;
  data.projection.apply_transposed = [](const double* y, int channels, double* x) {
    for (std::size_t i = 0; i < static_cast<std::size_t>(channels) * kPixels; ++i) {
      x[i] = i % kWidth + 1 < kWidth ? y[i] / 2 : y[i];
      if (i % kWidth > 0) x[i] += y[i - 1] / 2;
    }
  };
  DisparityMap map{kWidth, kHeight, {}, {1, 1}};
  for (std::size_t i = 0; i < kPixels; ++i) {
    map.disparity.push_back(
        0.05F * std::sin(0.9F * static_cast<float>(i % kWidth) + static_cast<float>(i / kWidth)));
  }
  const auto solve = [&](const DisparityMap* disparity, double slope, int limit, int* iterations) {
    RadianceLimits limits;
    limits.max_iterations = limit;
    std::vector<double> radiance = data.photograph;
    const RadianceOutcome outcome = SolveWithPatches(
        {1e-3, 0.02, {}, disparity, slope}, data, std::vector<double>(kPixels, 1.0), limits,
        std::make_unique<SceneSystem<double>>(data), nullptr, &radiance);
    *iterations = outcome.iterations;
    return radiance;
  };
  int without = 0, with = 0;
  EXPECT_EQ(solve(&map, 0.03, 3, &with), solve(nullptr, 0, 3, &without));
  EXPECT_EQ(without, 3);
  EXPECT_EQ(with, 6);
  EXPECT_NE(solve(&map, 0.03, 200, &with), solve(nullptr, 0, 200, &without));
  EXPECT_GT(with, without);
}

TEST(ScenePatches, AnyNumberOfThreadsGivesTheSameBits) {
  std::vector<float> first;
  for (const int threads : {1, 2, 3}) {
    const DataTerm<float> data = SharpPhotograph<float>(0.02, threads);
    std::vector<float> radiance = data.photograph;
    SolveWithPatches({1e-3, 0.02, {}}, data, std::vector<float>(kPixels, 1.0F), {},
                     std::make_unique<SceneSystem<float>>(data), nullptr, &radiance);
    if (first.empty()) first = radiance;
    EXPECT_EQ(radiance, first) << threads;
  }
}

}  // namespace
}  // namespace thicklens::estimator
