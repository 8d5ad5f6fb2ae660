#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "support/special_numbers.h"
#include "thicklens/base/error.h"
#include "thicklens/model/thick_lens.h"
#include "tools/report/explain_table.h"

namespace thicklens::tools {
namespace {

using ::testing::HasSubstr;

using thicklens::testing::kInfinity;
constexpr double kPitchMm = 0.005;

// f1 = 50, f2 = 52, rho = 4 focused at 1000 mm: d1 = 4 + 52 * 1000/950.
model::Camera ThickCamera() {
  model::Camera camera;
  camera.name = "thick";
  camera.lens = {50, 52, 4, 10};
  camera.sensor.width_px = 601;
  camera.sensor.height_px = 801;
  camera.sensor.pixel_pitch_mm = kPitchMm;
  camera.sensor.principal_point_px = {300, 400};
  camera.calibration.emplace();
  camera.calibration->image_distance_mm = model::Estimate{4 + 52 * 1000 / 950.0, 0.001};
  camera.calibration->blur_ratio = model::Estimate{0.45, 0.009};
  camera.calibration->blur_floor_px = model::Estimate{0.5, 0};
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
  const model::Camera camera = ThickCamera();
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
  model::Camera camera = ThickCamera();
  camera.lens = {50, 50, -4, 10};  // d1 of infinity is 46, less than f1
  camera.calibration->image_distance_mm->value = 46.5;
  const Explanation known = ExplainCamera(camera, {500, 2000}, 2);
  EXPECT_FALSE(known.thin.focus_depth_mm);
  EXPECT_THAT(ExplanationText(known), HasSubstr("nowhere"));
  EXPECT_TRUE(ExplanationJson(known)["thin_counterpart"]["focus_depth_mm"].is_null());
}

// Where both lenses part by the limit, by their own formulas.
TEST(ExplainCamera, SaysAtWhichDepthsThinIsAsGoodAsThick) {
  model::Camera camera = ThickCamera();
  // With rho = K (1 - f2/f1) both lenses are the same but for that; 0.01 mm are more.
  camera.lens = {50, 50.01, 50000 / 950.0 * (1 - 50.01 / 50) + 0.01, 10};
  camera.calibration->image_distance_mm->value = model::ImageDistanceMm(camera.lens, 1000);
  const model::ThickLens thin = model::ThinCounterpart(camera.lens);
  const double d1_mm = camera.image_distance_mm();
  const auto apart_px = [&](double depth_mm) {
    return 10 / kPitchMm *
           std::abs(model::DefocusPerAperture(camera.lens, d1_mm, depth_mm) -
                    model::DefocusPerAperture(thin, d1_mm, depth_mm));
  };
  const Explanation known = ExplainCamera(camera, {500, 2000}, 2);
  const double up_to_mm = known.thin.alike_up_to_mm;
  EXPECT_NEAR(apart_px(up_to_mm), 0.1, 1e-6);
  EXPECT_LT(apart_px(0.9 * up_to_mm), 0.1);
  EXPECT_GT(apart_px(1.1 * up_to_mm), 0.1);
  EXPECT_THAT(ExplanationText(known), HasSubstr("within 0.1 px of that of thick up to"));
  camera.lens.lens_thickness_mm -= 0.009;
  camera.calibration->image_distance_mm->value -= 0.009;
  EXPECT_EQ(ExplainCamera(camera, {500, 2000}, 2).thin.alike_up_to_mm, kInfinity);
}

TEST(ExplainCamera, HyperfocalDistanceBlursInfinityByOnePixel) {
  model::Camera camera = ThickCamera();
  const Explanation known = ExplainCamera(camera, {500, kInfinity}, 2);
  EXPECT_NEAR(known.working_f_number, (camera.image_distance_mm() - 4) / 20, 1e-12);
  camera.calibration->image_distance_mm->value =
      model::ImageDistanceMm(camera.lens, known.hyperfocal_mm);
  EXPECT_NEAR(ExplainCamera(camera, {500, kInfinity}, 2).rows[1].blur_radius_px, 1, 1e-9);
}

TEST(ExplainCamera, KnowsAThinLens) {
  model::Camera camera = ThickCamera();
  camera.lens = {50, 50, 0, 10};
  const Explanation known = ExplainCamera(camera, {500, 2000}, 2);
  EXPECT_TRUE(known.thin.same_lens);
  EXPECT_EQ(known.thin.scale_ratio, 1);
  EXPECT_EQ(known.rows[0].thin_blur_radius_px, known.rows[0].blur_radius_px);
}

TEST(ExplainCamera, NamesWhatIsMissing) {
  model::Camera camera = ThickCamera();
  camera.calibration->blur_ratio.reset();
  try {
    ExplainCamera(camera, {500, 2000}, 2);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("calibration.blur_ratio is missing"));
  }
}

TEST(ExplanationText, ShowsErrorsOnlyWhereThereAreSome) {
  model::Camera camera = ThickCamera();
  EXPECT_THAT(ExplanationText(ExplainCamera(camera, {500, 2000}, 3)), HasSubstr("0.45 +- 0.009"));
  camera.calibration->blur_ratio->sigma = 0;
  camera.calibration->image_distance_mm->sigma = 0;
  EXPECT_THAT(ExplanationText(ExplainCamera(camera, {500, 2000}, 3)),
              ::testing::Not(HasSubstr("+-")));
}

TEST(ExplanationJson, HasNullForInfinity) {
  const auto json = ExplanationJson(ExplainCamera(ThickCamera(), {500, kInfinity}, 3));
  EXPECT_EQ(json["status"], "ok");
  EXPECT_EQ(json["depths"].size(), 3U);
  EXPECT_EQ(json["depths"][0]["depth_mm"], 500);
  EXPECT_TRUE(json["depths"][2]["depth_mm"].is_null());
  EXPECT_GT(json["depths"][2]["blur_radius_mm"], 0);
}

}  // namespace
}  // namespace thicklens::tools
