#include "model/simulate/sweep/edge_spread.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace thicklens::model {
namespace {

constexpr double kPi = 3.14159265358979323846;

// The edge spread by adding up: over the disc's projection, and over the pixel's area with three
// Gauss-Legendre nodes in each tenth of its sides.
double EdgeOracle(double angle_rad, double sigma, double radius, double distance) {
  constexpr int kParts = 10;
  const double nodes[] = {-std::sqrt(0.6) / 2, 0, std::sqrt(0.6) / 2};
  const double weights[] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
  std::vector<std::pair<double, double>> side;  // place and weight
  for (int i = 0; i < kParts; ++i) {
    for (int k = 0; k < 3; ++k) {
      side.emplace_back((i + 0.5 + nodes[k]) / kParts - 0.5, weights[k] / kParts);
    }
  }
  const int disc_steps = radius > 0 ? 200 : 1;
  double sum = 0;
  for (int k = 0; k < disc_steps; ++k) {
    const double phi = kPi * ((k + 0.5) / disc_steps - 0.5);
    const double weight = radius > 0 ? 2 * std::pow(std::cos(phi), 2) / disc_steps : 1;
    const double shifted = distance + (radius > 0 ? radius * std::sin(phi) : 0);
    for (const auto& [x, x_weight] : side) {
      for (const auto& [y, y_weight] : side) {
        const double d = shifted + x * std::cos(angle_rad) + y * std::sin(angle_rad);
        sum += weight * x_weight * y_weight * std::erfc(-d / sigma / std::sqrt(2.0)) / 2;
      }
    }
  }
  return sum;
}

TEST(EdgeSpreadTest, EqualsTheConvolutionAddedUp) {
  struct Case {
    double sigma, radius;
  };
  for (const Case& c : {Case{0.5, 0}, Case{3, 0}, Case{0.5, 0.3}, Case{0.7, 6}, Case{1.5, 18}}) {
    for (const double angle_deg : {0.0, 5.0, -31.0, 45.0, 90.0}) {
      const double angle_rad = angle_deg * kPi / 180;
      const EdgeSpread edge(angle_rad, c.sigma, c.radius);
      for (const double d : {0.0, 0.31, -0.9, 0.6 * c.radius, -c.radius - 0.4}) {
        EXPECT_NEAR(edge.At(d), EdgeOracle(angle_rad, c.sigma, c.radius, d), 2e-8)
            << "angle " << angle_deg << " sigma " << c.sigma << " R " << c.radius << " d " << d;
      }
    }
  }
}

TEST(EdgeSpreadTest, WithoutBlurItIsTheAreaOfThePixelBehindTheEdge) {
  const EdgeSpread upright(0, 0, 0);
  for (const double d : {-0.7, -0.5, -0.2, 0.0, 0.3, 0.49, 0.8}) {
    EXPECT_NEAR(upright.At(d), std::clamp(d + 0.5, 0.0, 1.0), 3e-6) << d;
  }
  const EdgeSpread diagonal(kPi / 4, 0, 0);
  for (const double d : {0.0, 0.1, 0.3, 0.6, 0.7}) {
    const double cut_off = 1 / std::sqrt(2.0) - d;  // height of the corner beyond the edge
    EXPECT_NEAR(diagonal.At(d), 1 - cut_off * cut_off, 1e-9) << d;
    EXPECT_NEAR(diagonal.At(-d), cut_off * cut_off, 1e-9) << d;
  }
}

TEST(EdgeSpreadTest, DiscAloneIsTheLimitOfASmallGaussian) {
  // The two roads: closed form without a Gaussian, Fourier series with one.
  for (const double angle_rad : {0.0, 0.1, 0.7}) {
    const EdgeSpread closed(angle_rad, 0, 5);
    const EdgeSpread series(angle_rad, 0.004, 5);
    for (double d = -6; d <= 6; d += 0.137) {
      // A variance of 1.6e-5 times half the largest curvature, which is near the disc's rim.
      EXPECT_NEAR(closed.At(d), series.At(d), 2e-6) << angle_rad << " " << d;
    }
  }
}

TEST(EdgeSpreadTest, RisesFromZeroToOneAndIsAntisymmetric) {
  for (const double radius : {0.0, 4.0}) {
    const EdgeSpread edge(0.09, 0.6, radius);
    double before = 0;
    for (double d = -edge.reach_px() - 1; d <= edge.reach_px() + 1; d += 0.01) {
      EXPECT_GE(edge.At(d), before - 1e-8);
      EXPECT_NEAR(edge.At(d) + edge.At(-d), 1, 1e-8);
      before = edge.At(d);
    }
    EXPECT_EQ(edge.At(-1e6), 0);
    EXPECT_EQ(edge.At(1e6), 1);
  }
}

}  // namespace
}  // namespace thicklens::model
