// The adjustment of a camera to the views of a grid: derivatives, errors and their scatter.
#include "calib/grid/grid_adjustment.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/calib/grid/grid_bench.h"

namespace thicklens::calib {
namespace {

using thicklens::testing::GridBench;

GridSetup SetupOf(const GridBench& bench, const GridViews& views) {
  GridSetup setup;
  setup.target_mm = bench.Centred();
  setup.views = views.frames;
  setup.views.insert(setup.views.end(), views.views.begin(), views.views.end());
  setup.width_px = bench.width_px;
  setup.height_px = bench.height_px;
  setup.focal_length_px = 1400;
  setup.principal_point_px = {319.5, 239.5};
  setup.reading_sigma_mm = 0.02;
  return setup;
}

// The camera's parameters by their units, against differences; and the projection against OpenCV's.
TEST(GridAdjustment, TheCameraHasItsDerivatives) {
  GridBench bench(1);
  const GridSetup setup = SetupOf(bench, {});
  Eigen::VectorXd shared = Eigen::VectorXd::Zero(kRailAt);
  shared.head(kCameraSize) << 0.05, 0.02, -0.01, -0.02, 0.003, 0.001, -0.002, 0.0004;
  const Eigen::MatrixXd gradient = CameraGradient(setup, shared);
  for (int i = 0; i < kCameraSize; ++i) {
    Eigen::VectorXd more = shared, less = shared;
    more[i] += 1e-6;
    less[i] -= 1e-6;
    const Eigen::VectorXd slope = (CameraOf(setup, more) - CameraOf(setup, less)) / 2e-6;
    EXPECT_LT((slope - gradient.col(i)).norm(), 1e-5 * (1 + slope.norm())) << i;
  }
  const Eigen::VectorXd camera = CameraOf(setup, shared);
  bench.noise_px = 0;
  bench.focal_px = camera[0];
  bench.cx = camera[1];
  bench.cy = camera[2];
  bench.coefficients = {camera[3], camera[4], camera[5], camera[6], camera[7]};
  const Eigen::Vector3d rotation(0.3, -0.2, 0.1), place(3, 2, 280);
  const GridView view = bench.View(rotation, place);
  const std::vector<Eigen::Vector2d> projected = ProjectGrid(setup, shared, rotation, place);
  for (std::size_t i = 0; i < view.ids.size(); ++i)
    EXPECT_LT((projected[static_cast<std::size_t>(view.ids[i])] - view.image_px[i]).norm(), 1e-8);
}

// Without noise the truth comes back, from a start that is 7 % off.
TEST(GridAdjustment, FindsTheTruth) {
  GridBench bench(2);
  bench.noise_px = 0;
  bench.coefficients = {-0.25, 0.1, 0.001, -0.0008, 0.02};
  GridViews views;
  bench.Sweep(9, 80, {0.02, -0.03, 0.1}, {4, -3, 260}, {0.02, 0.01}, &views);
  bench.Tilted(6, 230, &views);
  const GridSetup setup = SetupOf(bench, views);
  const GridAdjustment found = AdjustGrid(setup);
  ASSERT_TRUE(found.done) << found.message;
  const Eigen::VectorXd camera = CameraOf(setup, found.shared);
  EXPECT_NEAR(camera[0], 1500, 0.5);
  EXPECT_NEAR(camera[1], 330, 0.3);
  EXPECT_NEAR(camera[2], 230, 0.3);
  EXPECT_NEAR(camera[3], -0.25, 0.005);
  EXPECT_LT(found.rms_px, 0.002);
}

// The centroid of a disc's image is not the image of its centre: it moves away from where the disc
// is farther.
TEST(GridAdjustment, ADiscIsSeenAtItsCentroid) {
  GridBench bench(3);
  GridSetup setup = SetupOf(bench, {});
  setup.target_mm = {{0, 0}};
  const Eigen::VectorXd shared = Eigen::VectorXd::Zero(kRailAt);
  const Eigen::Vector3d rotation(0, 0.6, 0), place(0, 0, 100);
  const double radius = 10;
  setup.disc_radius_mm = radius;
  // The centroid by a sum over the area of the disc, each part with the area of its image.
  double mass = 0, x = 0;
  GridSetup points = setup;
  points.disc_radius_mm = 0;
  const double step = 0.2;
  for (double u = -radius; u < radius; u += step) {
    for (double v = -radius; v < radius; v += step) {
      if (std::hypot(u + step / 2, v + step / 2) > radius) continue;
      points.target_mm = {{u, v}, {u + step, v}, {u, v + step}, {u + step, v + step}};
      const auto at = ProjectGrid(points, shared, rotation, place);
      const Eigen::Vector2d a = at[1] - at[0], b = at[2] - at[0];
      const double area = std::abs(a.x() * b.y() - a.y() * b.x());
      mass += area;
      x += area * 0.25 * (at[0] + at[1] + at[2] + at[3]).x();
    }
  }
  const double centroid = ProjectGrid(setup, shared, rotation, place)[0].x();
  points.target_mm = {{0, 0}};
  const double centre = ProjectGrid(points, shared, rotation, place)[0].x();
  EXPECT_GT(std::abs(x / mass - centre), 1) << "the difference is seen";
  EXPECT_NEAR(centroid, x / mass, 0.03 * std::abs(x / mass - centre));
}

// 40 noisy runs: the errors in their standard deviations have a mean square of 1, within what 40
// runs show (sqrt(2/40) = 0.22, three times), and the mean is not far from 0.
TEST(GridAdjustment, SigmasAreTheScatter) {
  constexpr int kRuns = 40;
  std::vector<double> squares(4, 0.0), sums(4, 0.0);
  for (int run = 0; run < kRuns; ++run) {
    GridBench bench(1000 + static_cast<std::uint64_t>(run));
    bench.grid.columns = 8;
    bench.grid.rows = 6;
    bench.grid.square_mm = 12;
    bench.coefficients = {-0.2, 0.05, 0, 0, 0};
    GridViews views;
    bench.Sweep(5, 80, {0.02, -0.03, 0.1}, {4, -3, 260}, {0.02, 0.01}, &views);
    for (GridView& frame : views.frames) *frame.position_mm += 0.02 * bench.Normal();
    bench.Tilted(5, 240, &views);
    const GridSetup setup = SetupOf(bench, views);
    const GridAdjustment found = AdjustGrid(setup);
    ASSERT_TRUE(found.done) << found.message;
    const auto camera = [&](int index) {
      return found.Of([&](const Eigen::VectorXd& s) { return CameraOf(setup, s)[index]; });
    };
    const double truth[] = {1500, 330, 230, -0.2};
    for (int i = 0; i < 4; ++i) {
      const model::Estimate of = camera(i);
      const double z = (of.value - truth[i]) / of.sigma;
      sums[static_cast<std::size_t>(i)] += z;
      squares[static_cast<std::size_t>(i)] += z * z;
    }
  }
  for (std::size_t i = 0; i < squares.size(); ++i) {
    EXPECT_GT(squares[i] / kRuns, 0.4) << i;
    EXPECT_LT(squares[i] / kRuns, 1.7) << i;
    EXPECT_LT(std::abs(sums[i]) / std::sqrt(kRuns), 3) << i;
  }
}

// A stage whose carriage wobbles is estimated to do so, so that the vanishing point of its motion
// gets the error that it has.
TEST(GridAdjustment, AStageThatWobblesHasItsScatter) {
  GridBench bench(5);
  GridViews views;
  for (int i = 0; i < 21; ++i) {
    const double along = 4.0 * (i - 10);
    GridView view =
        bench.View({0, 0.05, 0}, {0.1 * bench.Normal(), 0.1 * bench.Normal(), 260 + along});
    view.position_mm = along;
    views.frames.push_back(view);
  }
  const GridSetup setup = SetupOf(bench, views);
  const GridAdjustment found = AdjustGrid(setup);
  ASSERT_TRUE(found.done) << found.message;
  EXPECT_GT(found.lateral_sigma_mm, 0.06);
  EXPECT_LT(found.lateral_sigma_mm, 0.15);
  const model::Estimate x = found.Of([&](const Eigen::VectorXd& s) {
    const Eigen::VectorXd camera = CameraOf(setup, s);
    return camera[1] + camera[0] * s[kRailAt + 6];
  });
  EXPECT_LT(std::abs(x.value - 330), 3 * x.sigma);
  // 0.1 mm, 24 mm rms, 21 frames: 0.0009 rad.
  EXPECT_NEAR(x.sigma, 1500 * 0.1 / (24.2 * std::sqrt(21.0)), 0.6);
}

// A wrong corner, or dirt on it, has no effect.
TEST(GridAdjustment, WrongCornersAreLeftOut) {
  GridBench bench(6);
  GridViews views;
  bench.Tilted(8, 240, &views);
  for (GridView& view : views.views) view.image_px[7] += Eigen::Vector2d(3, -2);
  const GridAdjustment found = AdjustGrid(SetupOf(bench, views));
  ASSERT_TRUE(found.done) << found.message;
  EXPECT_LT(found.rms_px, 0.08);
}

}  // namespace
}  // namespace thicklens::calib
