// The samples of an aperture carry the calibrated blur, whatever the weights of their rays are.
#include "thicklens/estimator/aperture_blur.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "estimator/views/ray_irradiance.h"
#include "support/test_cameras.h"
#include "thicklens/base/error.h"

namespace thicklens::estimator {
namespace {

using model::ApertureShape;
using thicklens::testing::CentredSensor;
using thicklens::testing::TestCameraFocusedAt;
using thicklens::testing::WideLens;

model::Camera WideCamera() {
  // Its corners are 16 degrees off the axis.
  return TestCameraFocusedAt(400, "wide", WideLens(12.5 / 2.8), CentredSensor(61, 41, 0.09),
                             {0.47, 0});
}

// The moments about the centroid of the rays of the point on the axis in focus, computed
// independently from the weights in H.
Eigen::Vector2d SigmaOnAxis(const model::LightFieldGrid& grid, const model::Camera& camera,
                            const Eigen::ArrayXXd& weights) {
  const double zf_mm = camera.focus_depth_mm();
  double sum = 0;
  Eigen::Vector2d first(0, 0), second(0, 0);
  for (int l = 0; l < grid.v_count; ++l) {
    for (int k = 0; k < grid.u_count; ++k) {
      const model::Ray view = grid.RayAt(0, 0, k, l);
      // Through (0, 0) at zf.
      const double share = (zf_mm - grid.planes.uv_depth_mm) / grid.planes.plane_spacing_mm;
      const Eigen::Vector2d st = -(1 - share) / share * Eigen::Vector2d(view.u_mm, view.v_mm);
      const Eigen::Vector2d at =
          model::ApertureCrossingMm(grid.planes, {st.x(), st.y(), view.u_mm, view.v_mm});
      sum += weights(l, k);
      first += weights(l, k) * at;
      second += weights(l, k) * at.cwiseAbs2();
    }
  }
  return (second / sum - (first / sum).cwiseAbs2()).cwiseSqrt();
}

TEST(ApertureBlur, OnTheAxisIsTheCalibratedOne) {
  const model::Camera camera = WideCamera();
  const double calibrated_mm = 0.47 * camera.lens.aperture_radius_mm;
  for (const ApertureShape shape : {ApertureShape::kGaussian, ApertureShape::kDisc}) {
    for (const auto& [u_count, v_count] :
         {std::pair{2, 2}, std::pair{3, 5}, std::pair{7, 7}, std::pair{8, 1}}) {
      for (const model::LightFieldPlanes& planes :
           {model::LightFieldPlanes{0, 400}, model::LightFieldPlanes{0, 900},
            model::LightFieldPlanes{100, 500}, model::LightFieldPlanes{-50, 250}}) {
        SCOPED_TRACE(model::ApertureShapeName(shape) + " " + std::to_string(u_count) + "x" +
                     std::to_string(v_count) + ", zl " + std::to_string(planes.uv_depth_mm));
        const Eigen::ArrayXXd weights = model::ApertureWeights(shape, u_count, v_count);
        const model::LightFieldGrid grid = model::GridOnPlanes(
            camera, planes,
            model::SampleAperture(weights, camera.blur_ratio(), camera.lens.aperture_radius_mm));
        for (const model::Camera* falloff : {static_cast<const model::Camera*>(nullptr), &camera}) {
          const ApertureBlur blur = MeasureApertureBlur(grid, camera, weights, falloff);
          EXPECT_NEAR(blur.calibrated_sigma_mm, calibrated_mm, 1e-12);
          EXPECT_NEAR(blur.sigma_mm.x() / calibrated_mm, 1, 1e-10);
          EXPECT_NEAR(blur.sigma_mm.y() / calibrated_mm, v_count > 1 ? 1 : 0, 1e-10);
        }
        EXPECT_NEAR(SigmaOnAxis(grid, camera, weights).x() / calibrated_mm, 1, 1e-10);
      }
    }
  }
}

// The fall-off of a pixel's rays does not change the weights at the principal point; elsewhere
// [S12] changes them.
TEST(ApertureBlur, FallOffLeavesTheAxisAlone) {
  const model::Camera camera = WideCamera();
  const Eigen::ArrayXXd weights = model::ApertureWeights(ApertureShape::kGaussian, 5, 5);
  const model::LightFieldGrid grid = model::GridOnPlanes(
      camera, {0, 400},
      model::SampleAperture(weights, camera.blur_ratio(), camera.lens.aperture_radius_mm));
  double corner = 0;
  for (int l = 0; l < 5; ++l) {
    for (int k = 0; k < 5; ++k) {
      const std::vector<float> falloff = RelativeFalloff(grid, camera, weights, k, l);
      EXPECT_NEAR(falloff[20 * 61 + 30], 1, 1e-6);
      corner += weights(l, k) * falloff[0];
    }
  }
  EXPECT_LT(corner, 0.95);
}

// Off the axis, the far side of the aperture loses more light. The reported change is compared with
// an independent sum over the rays at the corner sample.
TEST(ApertureBlur, InTheCornersIsReported) {
  const model::Camera camera = WideCamera();
  const Eigen::ArrayXXd weights = model::ApertureWeights(ApertureShape::kGaussian, 7, 7);
  const model::LightFieldGrid grid = model::GridOnPlanes(
      camera, {0, 400},
      model::SampleAperture(weights, camera.blur_ratio(), camera.lens.aperture_radius_mm));
  EXPECT_TRUE(MeasureApertureBlur(grid, camera, weights, nullptr).corner_change.isZero(1e-12));
  const ApertureBlur blur = MeasureApertureBlur(grid, camera, weights, &camera);
  // The sum is computed independently, from the irradiance of the rays at the corner sample with ST
  // in the plane of focus.
  double sum = 0, first = 0, second = 0;
  for (int l = 0; l < 7; ++l) {
    for (int k = 0; k < 7; ++k) {
      const model::Ray ray = grid.RayAt(0, 0, k, l);
      const auto irradiance = [&](double s_mm, double t_mm) {
        return model::RelativeIrradiance(camera.lens, camera.image_distance_mm(), grid.planes,
                                         {s_mm, t_mm, ray.u_mm, ray.v_mm});
      };
      const double weight = weights(l, k) * irradiance(ray.s_mm, ray.t_mm) / irradiance(0, 0);
      sum += weight;
      first += weight * ray.u_mm;
      second += weight * ray.u_mm * ray.u_mm;
    }
  }
  const double corner_mm = std::sqrt(second / sum - std::pow(first / sum, 2));
  EXPECT_NEAR(blur.corner_change.x(), corner_mm / blur.sigma_mm.x() - 1, 1e-9);
  EXPECT_GT(std::abs(blur.corner_change.x()), 1e-4);
  EXPECT_LT(std::abs(blur.corner_change.x()), 0.05);
}

// Views that lie on one side: the blur is measured from their own middle.
TEST(ApertureBlur, IsAboutTheCentroid) {
  const model::Camera camera = WideCamera();
  Eigen::ArrayXXd weights = Eigen::ArrayXXd::Zero(3, 5);
  weights.block(0, 2, 3, 3).setConstant(1.0 / 9);
  const model::ApertureSamples samples =
      model::SampleAperture(weights, camera.blur_ratio(), camera.lens.aperture_radius_mm);
  const model::LightFieldGrid grid = model::GridOnPlanes(camera, {0, 400}, samples);
  const ApertureBlur blur = MeasureApertureBlur(grid, camera, weights, &camera);
  EXPECT_NEAR(blur.sigma_mm.x() / blur.calibrated_sigma_mm, 1, 1e-10);
  EXPECT_NEAR(samples.u_step_mm, samples.v_step_mm, 1e-12);
}

TEST(ApertureBlur, OfOtherWeightsThanTheGridsThrows) {
  const model::Camera camera = WideCamera();
  const model::LightFieldGrid grid = model::DefaultGrid(camera, 3, 3);
  EXPECT_THROW(MeasureApertureBlur(grid, camera, Eigen::ArrayXXd::Ones(3, 4), nullptr), Error);
  EXPECT_THROW(MeasureApertureBlur(grid, camera, Eigen::ArrayXXd::Zero(3, 3), nullptr), Error);
}

}  // namespace
}  // namespace thicklens::estimator
