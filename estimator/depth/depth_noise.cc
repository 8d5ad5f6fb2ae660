#include "thicklens/estimator/depth_noise.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"

namespace thicklens::estimator {
namespace {

constexpr int kReachPx = 3;
constexpr double kWindowSigmaPx = 2;
// The difference of two pixels of one surface has 1.4 times the noise; 1 in 2500 such differences
// exceeds this limit.
constexpr double kSameSurface = 5;
constexpr int kMinNeighbours = 6;

// The Gaussian over the window, one axis.
std::array<double, 2 * kReachPx + 1> WindowWeights() {
  std::array<double, 2 * kReachPx + 1> weights{};
  for (int n = -kReachPx; n <= kReachPx; ++n) {
    weights[Index(n + kReachPx)] = std::exp(-n * n / (2 * kWindowSigmaPx * kWindowSigmaPx));
  }
  return weights;
}

// Normal equations of the plane d + gx x + gy y around a pixel, and their form with squared
// weights, from which the variance of the central value follows.
struct PlaneSums {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero(), squared = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  int count = 0;

  void Add(double weight, int x, int y, double value) {
    const Eigen::Vector3d place(1, x, y);
    normal += weight * place * place.transpose();
    squared += weight * weight * place * place.transpose();
    right += weight * value * place;
    ++count;
  }
};

struct Middle {
  double value = 0;     // relative to the pixel's own value
  double variance = 1;  // in units of the variance of the noise
};
Middle MiddleOf(const PlaneSums& sums) {
  if (sums.count <= kMinNeighbours) return {};
  const Eigen::LDLT<Eigen::Matrix3d> factor(sums.normal);
  const Eigen::Vector3d pivots = factor.vectorD();
  if (!(pivots.minCoeff() > 1e-6 * pivots.maxCoeff())) return {};
  // The central value is e^T N^-1 b with e = (1, 0, 0): its variance is e^T N^-1 Q N^-1 e.
  const Eigen::Vector3d share = factor.solve(Eigen::Vector3d::UnitX());
  return {share.dot(sums.right), share.dot(sums.squared * share)};
}

}  // namespace

SmoothedDepth SmoothDepth(const DisparityMap& map, double noise_px, int threads,
                          const std::vector<float>& confidence) {
  if (!(noise_px > 0)) {
    throw Error(fmt::format("noise of the depth is {} px per view step: it must be > 0", noise_px));
  }
  if (!confidence.empty() && confidence.size() != map.disparity.size()) {
    throw Error(fmt::format("{} confidences for {} disparities: their numbers must be equal",
                            confidence.size(), map.disparity.size()));
  }
  for (const float disparity : map.disparity) {
    if (std::isnan(disparity)) throw Error("the disparity has holes: they must be filled first");
  }
  const double step = map.step.cwiseAbs().maxCoeff();
  const auto tolerance = static_cast<float>(kSameSurface * noise_px / step);
  const auto window = WindowWeights();
  SmoothedDepth smoothed{map, 0};
  std::vector<double> variance(Index(map.height_px), 0.0);  // sum over each row
  ParallelFor(map.height_px, ResolveThreads(threads), [&](int y) {
    for (int x = 0; x < map.width_px; ++x) {
      const std::size_t i = Index(y) * Index(map.width_px) + Index(x);
      const float own = map.disparity[i];
      PlaneSums sums;
      for (int v = std::max(-kReachPx, -y); v <= std::min(kReachPx, map.height_px - 1 - y); ++v) {
        for (int u = std::max(-kReachPx, -x); u <= std::min(kReachPx, map.width_px - 1 - x); ++u) {
          const float there = map.disparity[Index(y + v) * Index(map.width_px) + Index(x + u)];
          if (!(std::abs(there - own) <= tolerance)) continue;
          const std::size_t neighbour = Index(y + v) * Index(map.width_px) + Index(x + u);
          const double trust = confidence.empty() ? 1 : static_cast<double>(confidence[neighbour]);
          if (!(trust > 0)) continue;
          sums.Add(trust * window[Index(u + kReachPx)] * window[Index(v + kReachPx)], u, v,
                   static_cast<double>(there - own));
        }
      }
      const Middle middle = MiddleOf(sums);
      smoothed.map.disparity[i] = static_cast<float>(static_cast<double>(own) + middle.value);
      variance[Index(y)] += middle.variance;
    }
  });
  double sum = 0;
  for (const double of_row : variance) sum += of_row;
  smoothed.noise_left_px = noise_px * std::sqrt(sum / static_cast<double>(map.disparity.size()));
  return smoothed;
}

}  // namespace thicklens::estimator
