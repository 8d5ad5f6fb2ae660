// Errors of the paper (the supplement of Couillaud & Ziou) that can be shown with the camera and
// its light field alone. Each test shows that the claim fails, and what holds instead.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "support/matrix_lens.h"
#include "support/test_cameras.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::model {
namespace {

using ::thicklens::testing::MatrixLens;
using ::thicklens::testing::MatrixLenses;
using thicklens::testing::TestCameraFocusedAt;
using thicklens::testing::TestSensor;
using thicklens::testing::WideLens;

constexpr int kImageSide = 4;
constexpr int kViewSide = 3;

Camera SmallCamera() {
  return TestCameraFocusedAt(640, "", WideLens(),
                             TestSensor(kImageSide, kImageSide, 0.006, {1.5, 1.5}));
}

// H, XY x STUV: each ray lands by [S16] and contributes its weight to the nearest pixel (the unit
// impulse).
Eigen::MatrixXd ProjectionMatrix(const Camera& camera, const LightFieldGrid& grid) {
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(
      static_cast<Eigen::Index>(camera.sensor.width_px) * camera.sensor.height_px,
      static_cast<Eigen::Index>(grid.s_count) * grid.t_count * grid.u_count * grid.v_count);
  Eigen::Index column = 0;
  for (int l = 0; l < grid.v_count; ++l) {
    for (int k = 0; k < grid.u_count; ++k) {
      for (int j = 0; j < grid.t_count; ++j) {
        for (int i = 0; i < grid.s_count; ++i, ++column) {
          const Ray ray = grid.RayAt(i, j, k, l);
          const double d1 = camera.image_distance_mm();
          const Eigen::Vector2d image_px =
              ImagePositionPx(camera.sensor, LandingPointMm(camera.lens, d1, grid.planes, ray));
          const double x = std::floor(image_px.x() + 0.5);
          const double y = std::floor(image_px.y() + 0.5);
          if (x < 0 || y < 0 || x >= kImageSide || y >= kImageSide) continue;
          const double weight =
              RelativeIrradiance(camera.lens, d1, grid.planes, ray) *
              ApertureTransmission(camera.psf, camera.blur_ratio(), camera.lens.aperture_radius_mm,
                                   ApertureCrossingMm(grid.planes, ray));
          h(static_cast<Eigen::Index>(y) * kImageSide + static_cast<Eigen::Index>(x), column) =
              weight;
        }
      }
    }
  }
  return h;
}

// Two grids: ST in the plane of focus (each view repeats the pixels), and ST 10 mm behind it (the
// views land beside each other, and some rays beside the sensor).
std::vector<Eigen::MatrixXd> ProjectionMatrices() {
  const Camera camera = SmallCamera();
  return {ProjectionMatrix(camera, DefaultGrid(camera, kViewSide, kViewSide)),
          ProjectionMatrix(camera, GridOnPlanes(camera, {0, 650}, kViewSide, kViewSide))};
}

// Section 3: "H has linearly independent columns", so that H^T H is invertible. It cannot be: H has
// fewer rows than columns.
TEST(SourceErrors, ProjectionMatrixHasDependentColumns) {
  const std::vector<Eigen::MatrixXd> matrices = ProjectionMatrices();
  ASSERT_FALSE(matrices[0].isApprox(matrices[1]));
  for (const Eigen::MatrixXd& h : matrices) {
    const Eigen::Index pixels = Eigen::Index{kImageSide} * kImageSide;
    const Eigen::Index rays = pixels * kViewSide * kViewSide;
    ASSERT_EQ(h.rows(), pixels);
    ASSERT_EQ(h.cols(), rays);
    const Eigen::Index rank = Eigen::FullPivLU<Eigen::MatrixXd>(h).rank();
    EXPECT_EQ(rank, pixels) << "every pixel is struck, so the rank is the most it can be";
    EXPECT_LT(rank, rays);
    const Eigen::MatrixXd normal = h.transpose() * h;
    EXPECT_LE(Eigen::FullPivLU<Eigen::MatrixXd>(normal).rank(), pixels);

    // A light field that is not 0 and gives a black image: two rays of one pixel against each
    // other.
    std::vector<Eigen::Index> struck;
    for (Eigen::Index column = 0; column < rays; ++column) {
      if (h(0, column) > 0) struck.push_back(column);
    }
    ASSERT_GE(struck.size(), 2U);
    Eigen::VectorXd light_field = Eigen::VectorXd::Zero(rays);
    light_field(struck[0]) = 1 / h(0, struck[0]);
    light_field(struck[1]) = -1 / h(0, struck[1]);
    EXPECT_LT((h * light_field).norm(), 1e-13 * light_field.norm());
  }
}

// Section 3: "each row of H is unique, so that the only vector solution to H x = 0 is 0".
TEST(SourceErrors, DistinctRowsDoNotMakeIndependentColumns) {
  Eigen::Matrix<double, 2, 3> counterexample;
  counterexample << 1, 0, 1,  //
      0, 1, 1;
  ASSERT_NE(counterexample.row(0), counterexample.row(1));
  EXPECT_TRUE((counterexample * Eigen::Vector3d(1, 1, -1)).isZero());

  // The columns are not independent either if there are enough rows.
  Eigen::Matrix<double, 4, 3> tall;
  tall << 1, 0, 1,  //
      0, 1, 1,      //
      1, 1, 2,      //
      2, 1, 3;
  EXPECT_TRUE((tall * Eigen::Vector3d(1, 1, -1)).isZero());

  // The matrix of the camera itself: its rows all differ, its columns depend.
  for (const Eigen::MatrixXd& h : ProjectionMatrices()) {
    std::set<std::vector<double>> rows;
    for (Eigen::Index y = 0; y < h.rows(); ++y) {
      const Eigen::VectorXd row = h.row(y);
      rows.insert(std::vector<double>(row.data(), row.data() + row.size()));
    }
    ASSERT_EQ(static_cast<Eigen::Index>(rows.size()), h.rows());
    EXPECT_LT(Eigen::FullPivLU<Eigen::MatrixXd>(h).rank(), h.cols());
  }
}

// [S9] measures beta from Ap. A ray leaves the rear principal plane at the height where it met Ap,
// so that its angle there needs D = d1 - rho.
TEST(SourceErrors, AngleBehindTheLensIsMeasuredFromTheWrongPlane) {
  const LightFieldPlanes planes{0, 640};
  const Ray ray{150, 40, 2, -1};
  const auto traced_cos_beta = [&](const MatrixLens& oracle) {
    const double u_slope = oracle.TraceSlope(ray.u_mm, (ray.u_mm - ray.s_mm) / 640)(1);
    const double v_slope = oracle.TraceSlope(ray.v_mm, (ray.v_mm - ray.t_mm) / 640)(1);
    return 1 / std::sqrt(1 + u_slope * u_slope + v_slope * v_slope);
  };
  for (const MatrixLens& oracle : MatrixLenses()) {
    SCOPED_TRACE(oracle.name());
    const ThickLens lens = oracle.AsThickLens(3);
    const double image_distance_mm = ImageDistanceMm(lens, 640);
    const double by_9 = CosBeta(lens, image_distance_mm, planes, ray);
    const double truth = traced_cos_beta(oracle);
    EXPECT_GT(std::abs(by_9 - truth), 1e-4);
    // If the planes are crossed, D is longer than d1, so that the ray of [S9] is too steep.
    // Otherwise it is too flat.
    EXPECT_EQ(by_9 < truth, lens.lens_thickness_mm < 0);
    // The formula lacks the rear principal plane.
    const double rear_distance_mm = image_distance_mm - lens.lens_thickness_mm;
    const Eigen::Vector2d across_mm =
        LandingPointMm(lens, image_distance_mm, planes, ray) - ApertureCrossingMm(planes, ray);
    EXPECT_NEAR(1 / std::sqrt(1 + across_mm.squaredNorm() / (rear_distance_mm * rear_distance_mm)),
                truth, 1e-12);
  }

  // It vanishes at rho = 0: a ball has both principal planes in its centre.
  const MatrixLens ball("ball", 1, {{10, 1.5, 20}, {-10, 1, 0}});
  const ThickLens lens = ball.AsThickLens(3);
  ASSERT_NEAR(lens.lens_thickness_mm, 0, 1e-12);
  EXPECT_NEAR(CosBeta(lens, ImageDistanceMm(lens, 640), planes, ray), traced_cos_beta(ball), 1e-12);
}

// [S23]: C_{k+1}^-1 = C_k^-1 + mu C_k^-1 D_k C_k^-1 with mu = 1/(1 + tr(C_k^-1 D_k)). Sherman and
// Morrison subtract.
TEST(SourceErrors, InverseOfARankOneUpdateHasTheWrongSign) {
  Eigen::Matrix3d c;
  c << 4, 1, 0,   //
      1, 3, 0.5,  //
      0, 0.5, 2;
  const Eigen::Matrix3d d = Eigen::Vector3d(1, -2, 0.5) * Eigen::RowVector3d(0.3, 1, 2);
  const Eigen::Matrix3d c_inverse = c.inverse();
  const double mu = 1 / (1 + (c_inverse * d).trace());
  const Eigen::Matrix3d correction = mu * c_inverse * d * c_inverse;
  EXPECT_TRUE(((c + d) * (c_inverse - correction)).isIdentity(1e-13));
  EXPECT_FALSE(((c + d) * (c_inverse + correction)).isIdentity(0.05));

  // The inverse of 1 + 1 is 1 - 1/2, not 1 + 1/2.
  const double by_23 = 1.0 + (1 / (1 + 1.0)) * 1.0;
  EXPECT_EQ(by_23, 1.5);
  EXPECT_EQ(1 / (1.0 + 1.0), 0.5);
}

}  // namespace
}  // namespace thicklens::model
