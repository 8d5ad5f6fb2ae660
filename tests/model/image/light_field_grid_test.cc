#include "thicklens/model/light_field_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "support/matrix_lens.h"
#include "support/test_cameras.h"
#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

using ::thicklens::testing::MatrixLens;
using ::thicklens::testing::MatrixLenses;
using thicklens::testing::TestCameraFocusedAt;
using thicklens::testing::TestSensor;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Camera CameraWith(const ThickLens& lens, double focus_depth_mm, Psf psf = Psf::kGaussian) {
  Camera camera = TestCameraFocusedAt(focus_depth_mm, "test-camera", lens,
                                      TestSensor(640, 480, 0.006, {317.25, 243.5}), {0.451, 0});
  camera.psf = psf;
  return camera;
}

Camera BenchCamera(double focus_depth_mm = 640) {
  return CameraWith({12.5, 12.8, 3.0, 4.46}, focus_depth_mm);
}

// Planes in front of, behind and around the aperture and a focus at 640 mm.
std::vector<LightFieldPlanes> SomePlanes() {
  return {{0, 640}, {0, 300}, {100, 540}, {100, 2000}, {500, -300}, {-50, 700}, {900, 150}};
}

std::vector<Ray> SomeRays() {
  std::mt19937 generator(4);
  std::uniform_real_distribution<double> position_mm(-30, 30);
  std::vector<Ray> rays(20);
  for (Ray& ray : rays) {
    ray = {position_mm(generator), position_mm(generator), position_mm(generator) / 4,
           position_mm(generator) / 4};
  }
  return rays;
}

double Tolerance(double value) { return 1e-10 * std::max(1.0, std::abs(value)); }

void ExpectNear(const Eigen::Vector2d& value, const Eigen::Vector2d& wanted) {
  EXPECT_NEAR(value.x(), wanted.x(), Tolerance(wanted.x()));
  EXPECT_NEAR(value.y(), wanted.y(), Tolerance(wanted.y()));
}

// Height of the ray on Ap, and its slope, computed only from two of its points.
double HeightOnAperture(double st_mm, double uv_mm, const LightFieldPlanes& planes) {
  return uv_mm + planes.uv_depth_mm * (uv_mm - st_mm) / planes.plane_spacing_mm;
}

Eigen::Vector2d Traced(const MatrixLens& oracle, double image_distance_mm,
                       const LightFieldPlanes& planes, const Ray& ray) {
  const auto axis = [&](double st_mm, double uv_mm) {
    const Eigen::Vector2d behind = oracle.TraceSlope(HeightOnAperture(st_mm, uv_mm, planes),
                                                     (uv_mm - st_mm) / planes.plane_spacing_mm);
    return behind(0) + behind(1) * image_distance_mm;
  };
  return {axis(ray.s_mm, ray.u_mm), axis(ray.t_mm, ray.v_mm)};
}

TEST(LandingPoint, AgreesWithTheMatrixTrace) {
  for (const MatrixLens& oracle : MatrixLenses()) {
    SCOPED_TRACE(oracle.name());
    const ThickLens lens = oracle.AsThickLens(3);
    for (const double focus_mm : {60.0, 640.0, 2e4, kInfinity}) {
      const double image_distance_mm = ImageDistanceMm(lens, focus_mm);
      for (const LightFieldPlanes& planes : SomePlanes()) {
        for (const Ray& ray : SomeRays()) {
          ExpectNear(LandingPointMm(lens, image_distance_mm, planes, ray),
                     Traced(oracle, image_distance_mm, planes, ray));
        }
      }
    }
  }
}

TEST(LandingPoint, BothFormsOfTheSourceAgree) {
  for (const MatrixLens& oracle : MatrixLenses()) {
    SCOPED_TRACE(oracle.name());
    const ThickLens lens = oracle.AsThickLens(3);
    for (const double focus_mm : {60.0, 640.0, 2e4}) {
      const double image_distance_mm = ImageDistanceMm(lens, focus_mm);
      for (const LightFieldPlanes& planes : SomePlanes()) {
        for (const Ray& ray : SomeRays()) {
          ExpectNear(LandingPointByNodalPointsMm(lens, image_distance_mm, planes, ray),
                     LandingPointMm(lens, image_distance_mm, planes, ray));
        }
      }
    }
  }
}

TEST(LandingPoint, NodalFormRefusesFocusAtInfinity) {
  const Camera camera = BenchCamera(kInfinity);
  EXPECT_THROW(
      LandingPointByNodalPointsMm(camera.lens, camera.image_distance_mm(), {0, 640}, {1, 1, 1, 1}),
      Error);
}

TEST(LandingPoint, ThinLensProjectsLikeAPinholeAtFocus) {
  const ThickLens thin{25, 25, 0, 5};
  const double image_distance_mm = ImageDistanceMm(thin, 500);
  const Ray ray{12, -7, 3, 2};  // ST in the plane of focus: where it meets Ap does not matter
  ExpectNear(LandingPointMm(thin, image_distance_mm, {0, 500}, ray),
             Eigen::Vector2d(12, -7) * -image_distance_mm / 500);
}

// A ray whose point lies on UV has a = (zl + d0 - z)/d0 = 1: nothing may divide by a - 1. Likewise
// a = 0 on ST.
TEST(LandingPoint, PointsOnThePlanesThemselves) {
  const MatrixLens oracle = MatrixLenses().front();
  const ThickLens lens = oracle.AsThickLens(3);
  const double image_distance_mm = ImageDistanceMm(lens, 640);
  for (const LightFieldPlanes& planes : {LightFieldPlanes{250, 150}, LightFieldPlanes{250, 390}}) {
    const Ray ray{5, -2, 1.5, 0.5};
    ExpectNear(PositionAtDepthMm(planes, ray, 250), {1.5, 0.5});
    ExpectNear(PositionAtDepthMm(planes, ray, 250 + planes.plane_spacing_mm), {5, -2});
    const Eigen::Vector2d aperture_mm = ApertureCrossingMm(planes, ray);
    ExpectNear(LandingPointMm(lens, image_distance_mm, planes, ray),
               {oracle.Landing(1.5, 250, aperture_mm.x(), image_distance_mm),
                oracle.Landing(0.5, 250, aperture_mm.y(), image_distance_mm)});
  }
}

TEST(LandingPoint, ScalingEveryLengthChangesNothingButTheUnit) {
  const ThickLens lens{12.5, 12.8, -3.0, 4.46};
  const double image_distance_mm = ImageDistanceMm(lens, 640);
  for (const double scale : {1e-3, 1e3}) {
    const ThickLens scaled{12.5 * scale, 12.8 * scale, -3.0 * scale, 4.46 * scale};
    for (const LightFieldPlanes& planes : SomePlanes()) {
      const LightFieldPlanes scaled_planes{planes.uv_depth_mm * scale,
                                           planes.plane_spacing_mm * scale};
      for (const Ray& ray : SomeRays()) {
        const Ray scaled_ray{ray.s_mm * scale, ray.t_mm * scale, ray.u_mm * scale,
                             ray.v_mm * scale};
        ExpectNear(
            LandingPointMm(scaled, image_distance_mm * scale, scaled_planes, scaled_ray) / scale,
            LandingPointMm(lens, image_distance_mm, planes, ray));
        EXPECT_NEAR(
            RelativeIrradiance(scaled, image_distance_mm * scale, scaled_planes, scaled_ray),
            RelativeIrradiance(lens, image_distance_mm, planes, ray), 1e-12);
      }
    }
  }
  // The image does not depend on the unit of length, because disparity and slope are in pixels.
  const Camera camera = BenchCamera();
  const LightFieldGrid grid = GridOnPlanes(camera, {100, 2000}, 7, 5);
  for (const double scale : {1e-3, 1e3}) {
    Camera scaled =
        CameraWith({12.5 * scale, 12.8 * scale, 3.0 * scale, 4.46 * scale}, 640 * scale);
    scaled.sensor.pixel_pitch_mm *= scale;
    const LightFieldGrid scaled_grid = GridOnPlanes(scaled, {100 * scale, 2000 * scale}, 7, 5);
    EXPECT_NEAR(scaled_grid.s_step_mm / scale, grid.s_step_mm, 1e-11 * grid.s_step_mm);
    EXPECT_NEAR(scaled_grid.u_step_mm / scale, grid.u_step_mm, 1e-11 * grid.u_step_mm);
    EXPECT_NEAR(SlopeOnGrid(scaled_grid, 700 * scale), SlopeOnGrid(grid, 700), 1e-10);
    EXPECT_NEAR(DisparityPx(scaled, 0.7 * scale, 300 * scale), DisparityPx(camera, 0.7, 300), 1e-9);
  }
}

TEST(LandingPoint, RefusesImpossiblePlanesAndNan) {
  const ThickLens lens = BenchCamera().lens;
  const Ray ray{1, 1, 1, 1};
  EXPECT_THROW(ProjectionOf(lens, 16, {0, 0}), Error);
  EXPECT_THROW(ProjectionOf(lens, 16, {kNan, 640}), Error);
  EXPECT_THROW(ProjectionOf(lens, 16, {0, kInfinity}), Error);
  EXPECT_THROW(ProjectionOf(lens, kNan, {0, 640}), Error);
  EXPECT_THROW(LandingPointMm(lens, 16, {0, kNan}, ray), Error);
  EXPECT_THROW(CosAlpha({0, 0}, ray), Error);
  EXPECT_THROW(PositionAtDepthMm({0, 640}, ray, kInfinity), Error);
  EXPECT_THROW(PositionAtDepthMm({0, 640}, ray, kNan), Error);
}

TEST(Image, IsTheScenesWayUp) {
  const Camera camera = BenchCamera();
  const double image_distance_mm = camera.image_distance_mm();
  const LightFieldPlanes planes{0, 640};
  const auto image_of = [&](const Ray& ray) {
    return ImagePositionPx(camera.sensor,
                           LandingPointMm(camera.lens, image_distance_mm, planes, ray));
  };
  ExpectNear(image_of({0, 0, 0, 0}), camera.sensor.principal_point_px);
  // A point of the scene to the right and below appears to the right and below.
  const Eigen::Vector2d right_below = image_of({10, 4, 0, 0});
  const double focal_scale_px = DefocusScaleMm(camera.lens, image_distance_mm) / 0.006;
  ExpectNear(right_below,
             camera.sensor.principal_point_px + focal_scale_px * Eigen::Vector2d(10, 4) / 640);
}

TEST(Irradiance, CosAlphaIsTheSourcesForPlanesInFrontOfTheAperture) {
  for (const LightFieldPlanes& planes : SomePlanes()) {
    if (!(planes.uv_depth_mm > 0)) continue;
    for (const Ray& ray : SomeRays()) {
      const double a_u = HeightOnAperture(ray.s_mm, ray.u_mm, planes);
      const double a_v = HeightOnAperture(ray.t_mm, ray.v_mm, planes);
      const double by_8 =
          planes.uv_depth_mm / std::sqrt(std::pow(a_u - ray.u_mm, 2) + std::pow(a_v - ray.v_mm, 2) +
                                         std::pow(planes.uv_depth_mm, 2));
      EXPECT_NEAR(CosAlpha(planes, ray), by_8, 1e-13);
    }
  }
}

TEST(Irradiance, CosAlphaIsFiniteWithUvOnTheAperture) {
  // A ray that falls 3 sideways and 4 down on 12 forward: cos = 12/13.
  EXPECT_NEAR(CosAlpha({0, 12}, {0, 0, 3, 4}), 12.0 / 13, 1e-15);
  EXPECT_EQ(CosAlpha({0, 640}, {2, 2, 2, 2}), 1);
  EXPECT_NEAR(CosAlpha({0, 640}, {10, 0, -5, 3}), CosAlpha({1e-9, 640}, {10, 0, -5, 3}), 1e-12);
}

TEST(Irradiance, AxialRayHasAllOfIt) {
  const Camera camera = BenchCamera();
  EXPECT_EQ(RelativeIrradiance(camera.lens, camera.image_distance_mm(), {0, 640}, {0, 0, 0, 0}), 1);
}

// For a thin lens in one medium the chief ray is not deflected: alpha = beta, so the fall-off is
// cos^4.
TEST(Irradiance, ChiefRayOfAThinLensFallsByTheFourthPower) {
  const ThickLens thin{25, 25, 0, 5};
  const double image_distance_mm = ImageDistanceMm(thin, 500);
  const double cosine = 1 / std::sqrt(1 + 0.3 * 0.3 + 0.1 * 0.1);
  EXPECT_NEAR(RelativeIrradiance(thin, image_distance_mm, {0, 500}, {150, 50, 0, 0}),
              std::pow(cosine, 4), 1e-12);
}

TEST(Transmission, SecondMomentIsTheBlurRatioForBothShapes) {
  const double radius_mm = 4.46;
  const double ratio = 0.37;
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    SCOPED_TRACE(PsfName(psf));
    const double step_mm = 0.02;
    double sum = 0;
    double u_moment = 0;
    double v_moment = 0;
    for (int i = -600; i < 600; ++i) {
      for (int j = -600; j < 600; ++j) {
        const double u = (i + 0.5) * step_mm;
        const double v = (j + 0.5) * step_mm;
        const double weight = ApertureTransmission(psf, ratio, radius_mm, {u, v});
        sum += weight;
        u_moment += weight * u * u;
        v_moment += weight * v * v;
      }
    }
    const double tolerance_mm = psf == Psf::kDisc ? 2e-3 : 1e-6;  // the disc's rim is jagged
    EXPECT_NEAR(std::sqrt(u_moment / sum), ratio * radius_mm, tolerance_mm);
    EXPECT_NEAR(std::sqrt(v_moment / sum), ratio * radius_mm, tolerance_mm);
  }
}

TEST(Transmission, DiscAndPinhole) {
  EXPECT_EQ(ApertureTransmission(Psf::kDisc, 0.5, 4, {0, 3.999}), 1);
  EXPECT_EQ(ApertureTransmission(Psf::kDisc, 0.5, 4, {0, 4.001}), 0);
  EXPECT_EQ(ApertureTransmission(Psf::kGaussian, 0, 4, {0, 0}), 1);
  EXPECT_EQ(ApertureTransmission(Psf::kGaussian, 0, 4, {0, 1e-9}), 0);
  EXPECT_NEAR(ApertureTransmission(Psf::kGaussian, 0.5, 4, {2, 0}), std::exp(-0.5), 1e-15);
  EXPECT_THROW(ApertureTransmission(Psf::kGaussian, kNan, 4, {0, 0}), Error);
  EXPECT_THROW(ApertureTransmission(Psf::kDisc, -1, 4, {0, 0}), Error);
}

// The sampling claims that the image of a point out of focus through the weighted samples has
// exactly the standard deviation kappa r_defocus. The landing points are those of the matrix trace.
TEST(Samples, CarryTheCalibratedBlurForEveryNumberOfViews) {
  const double ratio = 0.451;
  const double radius_mm = 4.46;
  const double depth_mm = 300;
  const MatrixLens oracle = MatrixLenses()[4];
  const ThickLens lens = oracle.AsThickLens(radius_mm);
  const double image_distance_mm = ImageDistanceMm(lens, 640);
  const double wanted_mm = ratio * BlurRadiusMm(lens, image_distance_mm, depth_mm);
  ASSERT_GT(wanted_mm, 0.01);
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    SCOPED_TRACE(PsfName(psf));
    for (int u_count = 2; u_count <= 25; ++u_count) {
      for (const int v_count : {1, 2, 7, u_count}) {
        const ApertureSamples samples = SampleAperture(psf, ratio, radius_mm, u_count, v_count);
        EXPECT_NEAR(samples.weights.sum(), 1, 1e-14);
        Eigen::Array2d mean_mm = Eigen::Array2d::Zero();
        Eigen::Array2d squares_mm2 = Eigen::Array2d::Zero();
        for (int j = 0; j < v_count; ++j) {
          for (int i = 0; i < u_count; ++i) {
            const Eigen::Array2d landing_mm(
                oracle.Landing(0, depth_mm, samples.u_offset(i) * samples.u_step_mm,
                               image_distance_mm),
                oracle.Landing(0, depth_mm, samples.v_offset(j) * samples.v_step_mm,
                               image_distance_mm));
            mean_mm += samples.weights(j, i) * landing_mm;
            squares_mm2 += samples.weights(j, i) * landing_mm.square();
          }
        }
        EXPECT_NEAR(mean_mm.x(), 0, 1e-13);
        EXPECT_NEAR(mean_mm.y(), 0, 1e-13);
        EXPECT_NEAR(std::sqrt(squares_mm2.x()), wanted_mm, 1e-10) << u_count << "x" << v_count;
        const double wanted_down_mm = v_count == 1 ? 0 : wanted_mm;
        EXPECT_NEAR(std::sqrt(squares_mm2.y()), wanted_down_mm, 1e-10) << u_count << "x" << v_count;
      }
    }
  }
}

TEST(Samples, StepAtSevenViews) {
  const ApertureSamples samples = SampleAperture(Psf::kGaussian, 0.5, 4, 7, 7);
  EXPECT_NEAR(samples.u_step_mm / (0.5 * 4), 0.648, 5e-4);
  EXPECT_NEAR(samples.u_step_mm, samples.v_step_mm, 1e-14);
  // The spacing 4 kappa r/U of a first guess would be 12 % less.
  EXPECT_NEAR((4.0 / 7) / (samples.u_step_mm / (0.5 * 4)), 0.88, 5e-3);
}

TEST(Samples, OneViewHasNoStep) {
  const ApertureSamples one = SampleAperture(Psf::kDisc, 0.5, 4, 1, 1);
  EXPECT_EQ(one.u_step_mm, 0);
  EXPECT_EQ(one.v_step_mm, 0);
  EXPECT_EQ(one.weights(0, 0), 1);
}

TEST(Samples, DiscLeavesTheCornersOut) {
  const ApertureSamples samples = SampleAperture(Psf::kDisc, 0.5, 4, 7, 5);
  EXPECT_EQ(samples.weights.rows(), 5);
  EXPECT_EQ(samples.weights.cols(), 7);
  EXPECT_EQ(samples.weights(0, 0), 0);
  EXPECT_GT(samples.weights(0, 3), 0);
  EXPECT_GT(samples.weights(2, 0), 0);
  EXPECT_EQ(samples.weights(0, 3), samples.weights(2, 0));
}

TEST(Samples, RefusesImpossibleNumbers) {
  EXPECT_THROW(SampleAperture(Psf::kGaussian, 0.5, 4, 0, 7), Error);
  EXPECT_THROW(SampleAperture(Psf::kGaussian, 0.5, 4, 7, -1), Error);
  EXPECT_THROW(SampleAperture(Psf::kGaussian, -0.5, 4, 7, 7), Error);
  EXPECT_THROW(SampleAperture(Psf::kGaussian, kNan, 4, 7, 7), Error);
  EXPECT_THROW(SampleAperture(Psf::kGaussian, 0.5, kNan, 7, 7), Error);
}

TEST(DefaultGrid, OneRayAPixelInEveryView) {
  const Camera camera = BenchCamera();
  const LightFieldGrid grid = DefaultGrid(camera, 7, 5);
  std::string why;
  EXPECT_TRUE(grid.IsValid(&why)) << why;
  EXPECT_EQ(grid.s_count, 640);
  EXPECT_EQ(grid.t_count, 480);
  EXPECT_EQ(grid.u_count, 7);
  EXPECT_EQ(grid.v_count, 5);
  EXPECT_EQ(grid.planes.uv_depth_mm, 0);
  EXPECT_NEAR(grid.planes.plane_spacing_mm, 640, 1e-8);
  const ApertureSamples samples = SampleAperture(camera.psf, 0.451, 4.46, 7, 5);
  EXPECT_NEAR(grid.u_step_mm, samples.u_step_mm, 1e-14);
  EXPECT_NEAR(grid.v_step_mm, samples.v_step_mm, 1e-14);
  EXPECT_NEAR(ProjectionOf(camera.lens, camera.image_distance_mm(), grid.planes).q, 0, 1e-13);
  for (const int k : {0, 3, 6}) {
    for (const int i : {0, 111, 639}) {
      const int j = 479 - i / 2;
      const Ray ray = grid.RayAt(i, j, k, 4);
      const Eigen::Vector2d image_px = ImagePositionPx(
          camera.sensor, LandingPointMm(camera.lens, camera.image_distance_mm(), grid.planes, ray));
      EXPECT_NEAR(image_px.x(), i, 1e-8);
      EXPECT_NEAR(image_px.y(), j, 1e-8);
    }
  }
}

TEST(DefaultGrid, NeedsACalibrationAndAFiniteFocus) {
  Camera camera = BenchCamera(kInfinity);
  EXPECT_THROW(DefaultGrid(camera, 7, 7), Error);
  camera = BenchCamera();
  camera.calibration->blur_ratio.reset();
  EXPECT_THROW(DefaultGrid(camera, 7, 7), Error);
  camera = BenchCamera();
  camera.calibration.reset();
  EXPECT_THROW(DefaultGrid(camera, 7, 7), Error);
}

TEST(GridOnPlanes, ViewsCrossTheApertureInTheSamples) {
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    const Camera camera = CameraWith({12.5, 12.8, 3.0, 4.46}, 640, psf);
    const ApertureSamples samples = SampleAperture(psf, 0.451, 4.46, 6, 7);
    for (const LightFieldPlanes& planes : SomePlanes()) {
      if (!(planes.uv_depth_mm < 640)) continue;
      const LightFieldGrid grid = GridOnPlanes(camera, planes, 6, 7);
      for (int k = 0; k + 1 < 6; ++k) {
        // The rays of the point on the axis in focus: their intersections with ST follow from (0,
        // 0) at zf.
        const auto crossing_mm = [&](int view) {
          Ray ray = grid.RayAt(0, 0, view, view);
          const double share = (640 - planes.uv_depth_mm) / planes.plane_spacing_mm;
          ray.s_mm = ray.u_mm * (share - 1) / share;
          ray.t_mm = ray.v_mm * (share - 1) / share;
          return ApertureCrossingMm(planes, ray);
        };
        const Eigen::Vector2d step_mm = crossing_mm(k + 1) - crossing_mm(k);
        EXPECT_TRUE(step_mm.isApprox(ApertureStepsMm(grid, camera), 1e-12));
        EXPECT_NEAR(step_mm.x(), samples.u_step_mm, 1e-11);
        EXPECT_NEAR(step_mm.y(), samples.v_step_mm, 1e-11);
      }
      // One s-step is one pixel.
      const auto image_of = [&](int i) {
        return ImagePositionPx(camera.sensor,
                               LandingPointMm(camera.lens, camera.image_distance_mm(), planes,
                                              grid.RayAt(i, 0, 2, 2)));
      };
      EXPECT_NEAR(std::abs(image_of(41).x() - image_of(40).x()), 1, 1e-10);
    }
  }
}

TEST(GridOnPlanes, RefusesPlanesThatCannotBe) {
  const Camera camera = BenchCamera();
  EXPECT_THROW(GridOnPlanes(camera, {camera.focus_depth_mm(), 100}, 7, 7), Error);
  EXPECT_THROW(GridOnPlanes(camera, {900, 150}, 7, 7), Error);
  EXPECT_THROW(GridOnPlanes(camera, {300, -300}, 7, 7), Error);
  EXPECT_THROW(GridOnPlanes(camera, {-300, 200}, 7, 7), Error);
  EXPECT_THROW(GridOnPlanes(camera, {0, 0}, 7, 7), Error);
  EXPECT_THROW(GridOnPlanes(camera, {kNan, 640}, 7, 7), Error);
  EXPECT_THROW(GridOnPlanes(camera, {0, kNan}, 7, 7), Error);
  EXPECT_THROW(GridOnPlanes(camera, {0, 640}, 0, 7), Error);
  // A focus at infinity has grids on finite planes.
  EXPECT_NO_THROW(GridOnPlanes(BenchCamera(kInfinity), {0, 1000}, 7, 7));
}

// Both of them against the tracing of one fixed scene point, found on the grid view by view.
TEST(Slope, KeepsARayOnItsScenePoint) {
  for (const LightFieldPlanes& planes : SomePlanes()) {
    if (!(planes.uv_depth_mm < 640)) continue;
    const LightFieldGrid grid = GridOnPlanes(BenchCamera(), planes, 7, 7);
    for (const double depth_mm : {60.0, 300.0, 640.0, 5000.0}) {
      if (std::abs(depth_mm - planes.uv_depth_mm) < 1) continue;
      const double slope = SlopeOnGrid(grid, depth_mm);
      Ray first = grid.RayAt(100, 0, 2, 0);
      Ray second = grid.RayAt(100, 0, 3, 0);
      second.s_mm += slope * grid.s_step_mm;
      EXPECT_NEAR(PositionAtDepthMm(planes, first, depth_mm).x(),
                  PositionAtDepthMm(planes, second, depth_mm).x(), 1e-9);
    }
  }
}

TEST(Slope, OfTheDefaultGridIsMinusTheDisparity) {
  const Camera camera = BenchCamera();
  const LightFieldGrid grid = DefaultGrid(camera, 7, 7);
  for (const double depth_mm : {100.0, 400.0, 640.0, 3000.0, kInfinity}) {
    EXPECT_NEAR(SlopeOnGrid(grid, depth_mm), -DisparityPx(camera, grid.u_step_mm, depth_mm), 1e-9);
  }
}

TEST(Slope, IsInfiniteOnTheUvPlaneAndSaysSo) {
  const LightFieldGrid grid = GridOnPlanes(BenchCamera(), {250, 390}, 7, 7);
  EXPECT_THROW(SlopeOnGrid(grid, 250), Error);
  EXPECT_THROW(SlopeOnGrid(grid, kNan), Error);
  EXPECT_THROW(SlopeOnGrid(grid, -5), Error);
  EXPECT_TRUE(std::isfinite(SlopeOnGrid(grid, 250.0000001)));
  EXPECT_NEAR(SlopeOnGrid(grid, kInfinity), grid.u_step_mm / grid.s_step_mm, 1e-12);
}

// Near points move left as the view moves right: the point at x in the centre view is at x - a d.
TEST(Disparity, IsTheShiftBetweenViews) {
  const MatrixLens oracle = MatrixLenses()[5];
  const Camera camera = CameraWith(oracle.AsThickLens(4.46), 640);
  const double step_mm = 0.7;
  for (const double depth_mm : {100.0, 400.0, 640.0, 3000.0}) {
    const double disparity_px = DisparityPx(camera, step_mm, depth_mm);
    for (const int a : {-3, 1, 2}) {
      const auto image_x = [&](double aperture_mm) {
        const double landing_mm =
            oracle.Landing(20, depth_mm, aperture_mm, camera.image_distance_mm());
        return ImagePositionPx(camera.sensor, {landing_mm, 0}).x();
      };
      EXPECT_NEAR(image_x(a * step_mm), image_x(0) - a * disparity_px, 1e-8);
    }
  }
  EXPECT_GT(DisparityPx(camera, step_mm, 100), 0);
  EXPECT_NEAR(DisparityPx(camera, step_mm, 640), 0, 1e-9);
  EXPECT_LT(DisparityPx(camera, step_mm, kInfinity), 0);
  EXPECT_THROW(DisparityPx(camera, step_mm, kNan), Error);
}

TEST(ApertureWeights, AreThoseOfTheNamedShape) {
  for (const ApertureShape shape :
       {ApertureShape::kUniform, ApertureShape::kGaussian, ApertureShape::kDisc}) {
    EXPECT_EQ(ApertureShapeFromName(ApertureShapeName(shape)), shape);
    const Eigen::ArrayXXd weights = ApertureWeights(shape, 5, 4);
    EXPECT_EQ(weights.rows(), 4);
    EXPECT_EQ(weights.cols(), 5);
    EXPECT_NEAR(weights.sum(), 1, 1e-15);
    EXPECT_NEAR((weights - weights.rowwise().reverse()).abs().maxCoeff(), 0, 1e-16);
  }
  EXPECT_NEAR(ApertureWeights(ApertureShape::kUniform, 3, 3)(0, 1), 1.0 / 9, 1e-15);
  const Eigen::ArrayXXd gaussian = ApertureWeights(ApertureShape::kGaussian, 7, 1);
  EXPECT_NEAR(gaussian(0, 0) / gaussian(0, 3), std::exp(-std::pow(12.0 / 7, 2) / 2), 1e-15);
  EXPECT_EQ(ApertureWeights(ApertureShape::kDisc, 7, 7)(0, 0), 0);
  EXPECT_THROW(ApertureWeights(ApertureShape::kDisc, 0, 7), Error);
  EXPECT_THROW(ApertureShapeFromName("square"), Error);
}

TEST(SampleAperture, AnyWeightsCarryTheCalibratedBlur) {
  Eigen::ArrayXXd weights = ApertureWeights(ApertureShape::kUniform, 5, 3);
  weights(0, 0) = 0;  // a view that does not contribute to the photograph
  weights /= weights.sum();
  const ApertureSamples samples = SampleAperture(weights, 0.45, 4);
  // The offsets are about their own middle, which the missing view moves.
  double middle = 0, moment = 0;
  for (int j = 0; j < 3; ++j) {
    for (int i = 0; i < 5; ++i) {
      middle += weights(j, i) * samples.u_offset(i) * samples.u_step_mm;
      moment += weights(j, i) * std::pow(samples.u_offset(i) * samples.u_step_mm, 2);
    }
  }
  EXPECT_GT(std::abs(middle), 0.1);
  EXPECT_NEAR(std::sqrt(moment - middle * middle), 0.45 * 4, 1e-12);
  EXPECT_THROW(SampleAperture(weights * 2, 0.45, 4), Error);
  EXPECT_THROW(SampleAperture(-weights, 0.45, 4), Error);
  EXPECT_THROW(SampleAperture(Eigen::ArrayXXd(), 0.45, 4), Error);
}

TEST(GridIsValid, NamesFieldAndValue) {
  const LightFieldGrid good = DefaultGrid(BenchCamera(), 7, 7);
  std::string why;
  EXPECT_TRUE(good.IsValid(nullptr));
  const auto expect_refusal = [&](const std::string& named,
                                  const std::function<void(LightFieldGrid&)>& spoil) {
    LightFieldGrid grid = good;
    spoil(grid);
    why.clear();
    EXPECT_FALSE(grid.IsValid(&why)) << named;
    EXPECT_NE(why.find(named), std::string::npos) << why;
    EXPECT_FALSE(grid.IsValid(nullptr));
  };
  expect_refusal("s_count is 0", [](LightFieldGrid& g) { g.s_count = 0; });
  expect_refusal("v_count is -2", [](LightFieldGrid& g) { g.v_count = -2; });
  expect_refusal("plane_spacing_mm", [](LightFieldGrid& g) { g.planes.plane_spacing_mm = 0; });
  expect_refusal("uv_depth_mm", [](LightFieldGrid& g) { g.planes.uv_depth_mm = kNan; });
  expect_refusal("ST plane", [](LightFieldGrid& g) { g.planes.uv_depth_mm = -1000; });
  expect_refusal("s_step_mm is 0", [](LightFieldGrid& g) { g.s_step_mm = 0; });
  expect_refusal("t_step_mm is nan", [](LightFieldGrid& g) { g.t_step_mm = kNan; });
  expect_refusal("u_step_mm is inf", [](LightFieldGrid& g) { g.u_step_mm = kInfinity; });
  expect_refusal("v_step_mm is nan", [](LightFieldGrid& g) { g.v_step_mm = kNan; });
  expect_refusal("st_origin_index", [](LightFieldGrid& g) { g.st_origin_index.x() = kNan; });
}

}  // namespace
}  // namespace thicklens::model
