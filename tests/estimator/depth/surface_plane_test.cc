#include "estimator/depth/surface_plane.h"

#include <gtest/gtest.h>

#include <Eigen/QR>
#include <cstddef>
#include <random>
#include <vector>

namespace thicklens::estimator {
namespace {

std::vector<SurfaceSample> Samples(double slope_x, double slope_y, double sigma, unsigned seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> noise(0, 1);
  std::vector<SurfaceSample> samples;
  for (int y = 10; y < 14; ++y) {
    for (int x = 3; x < 9; ++x) {
      samples.push_back({x, y, 0.4 + slope_x * x + slope_y * y + sigma * noise(engine)});
    }
  }
  return samples;
}

// Plain least squares: value at (0, 0) and both slopes.
Eigen::Vector3d LeastSquares(const std::vector<SurfaceSample>& samples) {
  Eigen::MatrixX3d places(samples.size(), 3);
  Eigen::VectorXd values(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    places.row(row) << 1, samples[i].x, samples[i].y;
    values[row] = samples[i].disparity;
  }
  return places.colPivHouseholderQr().solve(values);
}

TEST(SurfacePlane, IsThatOfLeastSquaresWhereThereIsLittleNoise) {
  const std::vector<SurfaceSample> samples = Samples(0.3, -0.2, 0.01, 1);
  const SurfacePlane plane = FitSurfacePlane(samples);
  const Eigen::Vector3d expected = LeastSquares(samples);
  EXPECT_NEAR(plane.slope.x(), expected[1], 1e-4);
  EXPECT_NEAR(plane.slope.y(), expected[2], 1e-4);
  EXPECT_NEAR(plane.At(6, 12), expected.dot(Eigen::Vector3d(1, 6, 12)), 1e-4);
  EXPECT_NEAR(plane.rms, 0.01, 0.003);
}

TEST(SurfacePlane, TakesNoiseForNoSlope) {
  double shrunk = 0, plain = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    const std::vector<SurfaceSample> samples = Samples(0, 0, 0.1, seed);
    shrunk += FitSurfacePlane(samples).slope.squaredNorm();
    plain += LeastSquares(samples).tail<2>().squaredNorm();
  }
  EXPECT_LT(shrunk, 0.6 * plain);
}

TEST(SurfacePlane, HasNoSlopeThatItsSamplesDoNotTell) {
  std::vector<SurfaceSample> row;
  for (int x = 0; x < 9; ++x) row.push_back({x, 5, 1 + 0.1 * x});
  const SurfacePlane plane = FitSurfacePlane(row);
  EXPECT_NEAR(plane.slope.x(), 0.1, 1e-12);
  EXPECT_NEAR(plane.slope.y(), 0, 1e-12);
  row.resize(5);
  EXPECT_EQ(FitSurfacePlane(row).slope, Eigen::Vector2d(0, 0));
  EXPECT_NEAR(FitSurfacePlane(row).At(40, 40), 1.2, 1e-12);
}

}  // namespace
}  // namespace thicklens::estimator
