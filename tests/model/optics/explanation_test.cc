#include "thicklens/model/explanation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "support/special_numbers.h"
#include "support/test_cameras.h"
#include "thicklens/base/error.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;

using thicklens::testing::CentredSensor;
using thicklens::testing::kInfinity;
using thicklens::testing::TestCamera;
using thicklens::testing::ThickMacroLens;
using thicklens::testing::ThinLens;
constexpr double kPitchMm = 0.005;

// f1 = 50, f2 = 52, rho = 4 focused at 1000 mm: d1 = 4 + 52 * 1000/950.
Camera ThickCamera() {
  Camera camera;
  camera.name = "thick";
  camera.lens = {50, 52, 4, 10};
  camera.sensor.width_px = 601;
  camera.sensor.height_px = 801;
  camera.sensor.pixel_pitch_mm = kPitchMm;
  camera.sensor.principal_point_px = {300, 400};
  camera.calibration.emplace();
  camera.calibration->image_distance_mm = Estimate{4 + 52 * 1000 / 950.0, 0.001};
  camera.calibration->blur_ratio = Estimate{0.45, 0.009};
  camera.calibration->blur_floor_px = Estimate{0.5, 0};
  return camera;
}

TEST(InverselySpacedDepths, HaveEqualStepsOfInverseDepthAndExactEnds) {
  const auto depths = InverselySpacedDepthsMm({500, 2000}, 4);
  ASSERT_EQ(depths.size(), 4U);
  EXPECT_EQ(depths.front(), 500);
  EXPECT_EQ(depths.back(), 2000);
  EXPECT_NEAR(depths[1], 1 / 0.0015, 1e-9);
  EXPECT_NEAR(depths[2], 1000, 1e-9);
  const auto to_infinity = InverselySpacedDepthsMm({500, kInfinity}, 3);
  EXPECT_NEAR(to_infinity[1], 1000, 1e-9);
  EXPECT_EQ(to_infinity[2], kInfinity);
}

// The blur by hand: r K |1/z - 1/zf| with K = f1 zf/(zf - f1) = 50000/950.
TEST(ExplainCamera, GivesTheBlurOfTheClosedForm) {
  const Explanation known = ExplainCamera(ThickCamera(), {500, kInfinity}, 3);
  EXPECT_NEAR(known.focus_depth_mm, 1000, 1e-8);
  ASSERT_EQ(known.rows.size(), 3U);
  const double step_mm = 10 * (50000 / 950.0) * (1 / 1000.0);
  EXPECT_NEAR(known.rows[0].blur_radius_mm, step_mm, 1e-9);
  EXPECT_NEAR(known.rows[1].blur_radius_mm, 0, 1e-9);
  EXPECT_NEAR(known.rows[2].blur_radius_mm, step_mm, 1e-9);
  EXPECT_NEAR(known.rows[0].defocus_sigma_px, 0.45 * step_mm / kPitchMm, 1e-7);
  // c = [f1 D - (D - f2) z]/(f2 z), so dc/dD = (f1 - z)/(f2 z); at focus it is all there is.
  const Camera camera = ThickCamera();
  const double distance_sigma_mm = camera.calibration->image_distance_mm->sigma;
  const auto by_distance_px = [&](double depth_mm) {
    return 0.45 * 10 * std::abs(camera.lens.front_focal_length_mm - depth_mm) /
           (camera.lens.rear_focal_length_mm * depth_mm) * distance_sigma_mm / kPitchMm;
  };
  EXPECT_NEAR(known.rows[0].defocus_sigma_error_px,
              std::hypot(0.009 * step_mm / kPitchMm, by_distance_px(500)), 1e-5);
  EXPECT_NEAR(known.rows[1].defocus_sigma_error_px, by_distance_px(1000), 1e-5);
  EXPECT_NEAR(known.rows[1].sigma_px, 0.5, 1e-9);
  EXPECT_NEAR(known.rows[0].magnification, 50000 / 950.0 / 500, 1e-9);
  EXPECT_EQ(known.rows[2].magnification, 0);
}

// An infinite depth must be the limit of finite ones.
TEST(ExplainCamera, InfinityIsTheLimitOfFarPoints) {
  const Explanation far = ExplainCamera(ThickCamera(), {500, 1e12}, 2);
  const Explanation infinite = ExplainCamera(ThickCamera(), {500, kInfinity}, 2);
  EXPECT_NEAR(far.rows[1].blur_radius_mm, infinite.rows[1].blur_radius_mm, 1e-8);
  EXPECT_NEAR(far.rows[1].thin_blur_radius_px, infinite.rows[1].thin_blur_radius_px, 1e-5);
}

TEST(ExplainCamera, DepthOfFieldEndsWhereTheBlurReachesItsLimit) {
  const Explanation known = ExplainCamera(ThickCamera(), {500, 2000}, 2);
  ASSERT_EQ(known.depth_of_field.size(), 2U);
  for (const DepthOfFieldRow& field : known.depth_of_field) {
    const Explanation ends = ExplainCamera(ThickCamera(), {field.near_mm, field.far_mm}, 2);
    EXPECT_NEAR(ends.rows[0].blur_radius_px, field.blur_radius_px, 1e-6);
    EXPECT_NEAR(ends.rows[1].blur_radius_px, field.blur_radius_px, 1e-6);
  }
}

// The thin lens at the same d1: 1/zf' = 1/f1 - 1/d1, scale d1/z against f1 D/(f2 z).
TEST(ExplainCamera, ComparesWithTheThinLensAtTheSameImageDistance) {
  const Explanation known = ExplainCamera(ThickCamera(), {500, 2000}, 2);
  const double d1_mm = 4 + 52 * 1000 / 950.0;
  const double ratio = d1_mm / (50000 / 950.0);
  EXPECT_FALSE(known.thin.same_lens);
  ASSERT_TRUE(known.thin.focus_depth_mm);
  EXPECT_NEAR(*known.thin.focus_depth_mm, 1 / (1 / 50.0 - 1 / d1_mm), 1e-7);
  EXPECT_NEAR(known.thin.scale_ratio, ratio, 1e-12);
  EXPECT_NEAR(known.thin.corner_shift_px, (ratio - 1) * 500, 1e-9);
  EXPECT_NEAR(known.rows[0].thin_blur_radius_px,
              10 * std::abs(d1_mm / 500 - (d1_mm / 50 - 1)) / kPitchMm, 1e-7);
}

TEST(ExplainCamera, SaysWhereTheThinLensHasNoPlaneOfFocus) {
  Camera camera = ThickCamera();
  camera.lens = {50, 50, -4, 10};  // d1 of infinity is 46, less than f1
  camera.calibration->image_distance_mm->value = 46.5;
  const Explanation known = ExplainCamera(camera, {500, 2000}, 2);
  EXPECT_FALSE(known.thin.focus_depth_mm);
}

// The depth at which the two lenses differ by the limit follows from their formulas.
TEST(ExplainCamera, SaysAtWhichDepthsThinIsAsGoodAsThick) {
  Camera camera = ThickCamera();
  // If rho = K (1 - f2/f1), the thick lens and its thin equivalent agree; here rho is 0.01 mm
  // larger.
  camera.lens = {50, 50.01, 50000 / 950.0 * (1 - 50.01 / 50) + 0.01, 10};
  camera.calibration->image_distance_mm->value = ImageDistanceMm(camera.lens, 1000);
  const ThickLens thin = ThinLensEquivalent(camera.lens);
  const double d1_mm = camera.image_distance_mm();
  const auto apart_px = [&](double depth_mm) {
    return 10 / kPitchMm *
           std::abs(DefocusPerAperture(camera.lens, d1_mm, depth_mm) -
                    DefocusPerAperture(thin, d1_mm, depth_mm));
  };
  const Explanation known = ExplainCamera(camera, {500, 2000}, 2);
  const double up_to_mm = known.thin.alike_up_to_mm;
  EXPECT_NEAR(apart_px(up_to_mm), 0.1, 1e-6);
  EXPECT_LT(apart_px(0.9 * up_to_mm), 0.1);
  EXPECT_GT(apart_px(1.1 * up_to_mm), 0.1);
  camera.lens.lens_thickness_mm -= 0.009;
  camera.calibration->image_distance_mm->value -= 0.009;
  EXPECT_EQ(ExplainCamera(camera, {500, 2000}, 2).thin.alike_up_to_mm, kInfinity);
}

TEST(ExplainCamera, HyperfocalDistanceBlursInfinityByOnePixel) {
  Camera camera = ThickCamera();
  const Explanation known = ExplainCamera(camera, {500, kInfinity}, 2);
  EXPECT_NEAR(known.working_f_number, (camera.image_distance_mm() - 4) / 20, 1e-12);
  camera.calibration->image_distance_mm->value = ImageDistanceMm(camera.lens, known.hyperfocal_mm);
  EXPECT_NEAR(ExplainCamera(camera, {500, kInfinity}, 2).rows[1].blur_radius_px, 1, 1e-9);
}

TEST(ExplainCamera, KnowsAThinLens) {
  Camera camera = ThickCamera();
  camera.lens = {50, 50, 0, 10};
  const Explanation known = ExplainCamera(camera, {500, 2000}, 2);
  EXPECT_TRUE(known.thin.same_lens);
  EXPECT_EQ(known.thin.scale_ratio, 1);
  EXPECT_EQ(known.rows[0].thin_blur_radius_px, known.rows[0].blur_radius_px);
}

TEST(ExplainCamera, NamesWhatIsMissing) {
  Camera camera = ThickCamera();
  camera.calibration->blur_ratio.reset();
  try {
    ExplainCamera(camera, {500, 2000}, 2);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("is not calibrated yet: blur_ratio is missing"));
  }
  camera.calibration.reset();
  camera.source = "c.yaml";
  for (const bool asks_for_ratio : {false, true}) {
    try {
      asks_for_ratio ? camera.blur_ratio() : camera.image_distance_mm();
      FAIL();
    } catch (const Error& error) {
      EXPECT_STREQ(error.what(),
                   "c.yaml is not calibrated yet: image_distance_mm and blur_ratio are missing; "
                   "run thicklens calibrate");
    }
  }
}

// The band's width against the scatter over cameras that are drawn as their covariance says.
TEST(BlurBandTest, IsTheScatterOfWhatTheCovarianceAllows) {
  Camera camera;
  camera.lens = {50, 52, 4, 10};
  camera.sensor.pixel_pitch_mm = 0.005;
  camera.sensor.width_px = camera.sensor.height_px = 100;
  const double distance_mm = 4 + 52 * 1000 / 950.0, ratio = 0.45;
  const double distance_sd = 0.002, ratio_sd = 0.004;
  for (const double correlation : {-0.8, 0.0, 0.6}) {
    SCOPED_TRACE(correlation);
    camera.calibration.emplace();
    camera.calibration->image_distance_mm = Estimate{distance_mm, distance_sd};
    camera.calibration->blur_ratio = Estimate{ratio, ratio_sd};
    camera.calibration->covariance_order = {"image_distance_mm", "blur_ratio"};
    const double shared = correlation * distance_sd * ratio_sd;
    camera.calibration->covariance.resize(2, 2);
    camera.calibration->covariance << distance_sd * distance_sd, shared, shared,
        ratio_sd * ratio_sd;
    const Explanation known = ExplainCamera(camera, {600, 3000}, 4);  // none of them in focus
    std::mt19937 engine(7);
    std::normal_distribution<double> normal;
    constexpr int kDraws = 4000;
    std::vector<double> sums(known.rows.size()), squares(known.rows.size());
    for (int i = 0; i < kDraws; ++i) {
      const double first = normal(engine);
      const double second =
          correlation * first + std::sqrt(1 - correlation * correlation) * normal(engine);
      for (std::size_t row = 0; row < known.rows.size(); ++row) {
        const double sigma_px =
            (ratio + ratio_sd * second) *
            BlurRadiusMm(camera.lens, distance_mm + distance_sd * first, known.rows[row].depth_mm) /
            camera.sensor.pixel_pitch_mm;
        sums[row] += sigma_px;
        squares[row] += sigma_px * sigma_px;
      }
    }
    for (std::size_t row = 0; row < known.rows.size(); ++row) {
      const double mean = sums[row] / kDraws;
      const double sd = std::sqrt(squares[row] / kDraws - mean * mean);
      // The scatter of 4000 draws has a standard error of 1.1 %.
      EXPECT_NEAR(known.rows[row].defocus_sigma_error_px / sd, 1, 0.045)
          << known.rows[row].depth_mm;
    }
  }
}

}  // namespace
}  // namespace thicklens::model
