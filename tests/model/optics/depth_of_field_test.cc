#include "thicklens/model/depth_of_field.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "support/error_message.h"
#include "support/special_numbers.h"
#include "support/test_cameras.h"
#include "thicklens/base/error.h"
#include "thicklens/model/explanation.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;

using thicklens::testing::CentredSensor;
using thicklens::testing::ErrorOf;
using thicklens::testing::kInfinity;
using thicklens::testing::TestCameraFocusedAt;
using thicklens::testing::ThickMacroLens;

constexpr double kPitchMm = 0.005;

Camera CameraAt(double focus_depth_mm, double sigma_mm = 0) {
  Camera camera = TestCameraFocusedAt(focus_depth_mm, "macro", ThickMacroLens(10),
                                      CentredSensor(640, 480, kPitchMm), {0.45, 0.01});
  camera.calibration->image_distance_mm->sigma = sigma_mm;
  return camera;
}

// The depth between `inside` and `outside` at which the blur radius is `radius_mm`, by bisection of
// the radius of a ray through the rim.
double DepthOfBlur(const Camera& camera, double inside_mm, double outside_mm, double radius_mm) {
  for (int i = 0; i < 200; ++i) {
    const double middle_mm = 2 / (1 / inside_mm + 1 / outside_mm);
    const bool sharp = BlurRadiusMm(camera.lens, camera.image_distance_mm(), middle_mm) < radius_mm;
    (sharp ? inside_mm : outside_mm) = middle_mm;
  }
  return inside_mm;
}

TEST(FocusLimits, AreWhereTheBlurRadiusIsHalfTheCircle) {
  for (const double focus_mm : {80.0, 400.0, 3000.0}) {
    for (const double circle_mm : {0.005, 0.03}) {
      const Camera camera = CameraAt(focus_mm);
      const FocusLimits limits = FocusLimitsOf(camera, circle_mm);
      EXPECT_NEAR(limits.near.depth_mm, DepthOfBlur(camera, focus_mm, 51, circle_mm / 2),
                  1e-9 * focus_mm);
      EXPECT_NEAR(limits.far.depth_mm, DepthOfBlur(camera, focus_mm, 1e7, circle_mm / 2),
                  1e-9 * focus_mm);
      EXPECT_DOUBLE_EQ(limits.circle_of_confusion_px, circle_mm / kPitchMm);
    }
  }
}

// The depth of focus is a displacement of the sensor: the image of the plane of focus has a blur
// disc of the circle's size at both of its ends.
TEST(FocusLimits, DepthOfFocusIsADisplacementOfTheSensor) {
  const double circle_mm = 0.02;
  const Camera camera = CameraAt(400);
  const FocusLimits limits = FocusLimitsOf(camera, circle_mm);
  for (const double side : {-0.5, 0.5}) {
    const double moved_mm = camera.image_distance_mm() + side * limits.depth_of_focus_mm.value;
    EXPECT_NEAR(2 * BlurRadiusMm(camera.lens, moved_mm, 400), circle_mm, 1e-12);
  }
}

TEST(FocusLimits, FarLimitReachesInfinityAtTheHyperfocalDepth) {
  const double circle_mm = 0.02;
  const double hyperfocal_mm = FocusLimitsOf(CameraAt(400), circle_mm).hyperfocal_mm;
  const FocusLimits nearer = FocusLimitsOf(CameraAt(0.999 * hyperfocal_mm), circle_mm);
  const FocusLimits farther = FocusLimitsOf(CameraAt(1.001 * hyperfocal_mm), circle_mm);
  EXPECT_TRUE(std::isfinite(nearer.far.depth_mm));
  EXPECT_EQ(farther.far.depth_mm, kInfinity);
  EXPECT_FALSE(farther.far.sigma_mm);
  EXPECT_FALSE(farther.depth_of_field_mm);
  EXPECT_NEAR(FocusLimitsOf(CameraAt(hyperfocal_mm), circle_mm).near.depth_mm, hyperfocal_mm / 2,
              1e-9 * hyperfocal_mm);
}

// The predicted errors are the scatter of the limits of cameras whose d1 scatters.
TEST(FocusLimits, ErrorsAreTheScatterOfDrawnCameras) {
  constexpr int kDraws = 4000;
  const double sigma_mm = 0.01, circle_mm = 0.02;
  const Camera camera = CameraAt(400, sigma_mm);
  const FocusLimits limits = FocusLimitsOf(camera, circle_mm);
  std::mt19937 draws(7);
  std::normal_distribution<double> normal;
  double near2 = 0, far2 = 0, field2 = 0, focus2 = 0;
  for (int i = 0; i < kDraws; ++i) {
    Camera drawn = camera;
    drawn.calibration->image_distance_mm->value += sigma_mm * normal(draws);
    const FocusLimits other = FocusLimitsOf(drawn, circle_mm);
    near2 += std::pow(other.near.depth_mm - limits.near.depth_mm, 2);
    far2 += std::pow(other.far.depth_mm - limits.far.depth_mm, 2);
    field2 += std::pow(other.depth_of_field_mm->value - limits.depth_of_field_mm->value, 2);
    focus2 += std::pow(other.depth_of_focus_mm.value - limits.depth_of_focus_mm.value, 2);
  }
  EXPECT_NEAR(std::sqrt(near2 / kDraws) / *limits.near.sigma_mm, 1, 0.05);
  EXPECT_NEAR(std::sqrt(far2 / kDraws) / *limits.far.sigma_mm, 1, 0.05);
  EXPECT_NEAR(std::sqrt(field2 / kDraws) / limits.depth_of_field_mm->sigma, 1, 0.05);
  EXPECT_NEAR(std::sqrt(focus2 / kDraws) / limits.depth_of_focus_mm.sigma, 1, 0.05);
  EXPECT_LT(limits.near.interval_mm.x(), limits.near.depth_mm);
  EXPECT_GT(limits.far.interval_mm.y(), limits.far.depth_mm);
}

TEST(FocusLimits, FarLimitMayBeAtInfinityWithinItsError) {
  const double circle_mm = 0.02;
  const double hyperfocal_mm = FocusLimitsOf(CameraAt(400), circle_mm).hyperfocal_mm;
  const FocusLimits limits = FocusLimitsOf(CameraAt(0.999 * hyperfocal_mm, 0.01), circle_mm);
  EXPECT_TRUE(std::isfinite(limits.far.interval_mm.x()));
  EXPECT_EQ(limits.far.interval_mm.y(), kInfinity);
}

// `thicklens explain` lists the depth of field for radii of the blur.
TEST(FocusLimits, AgreeWithTheRowsOfAnExplanation) {
  const Camera camera = CameraAt(400);
  for (const DepthOfFieldRow& row : ExplainCamera(camera, {300, 600}, 3).depth_of_field) {
    const FocusLimits limits = FocusLimitsOf(camera, 2 * row.blur_radius_px * kPitchMm);
    EXPECT_NEAR(limits.near.depth_mm, row.near_mm, 1e-9);
    EXPECT_NEAR(limits.far.depth_mm, row.far_mm, 1e-9);
    EXPECT_NEAR(limits.blur_sigma_px.value, 0.45 * row.blur_radius_px, 1e-12);
    EXPECT_NEAR(limits.blur_sigma_px.sigma, 0.01 * row.blur_radius_px, 1e-12);
  }
}

TEST(FocusLimits, ToleranceOfTheHyperfocalDepthIsThatOfTheLens) {
  Camera camera = CameraAt(400);
  EXPECT_EQ(FocusLimitsOf(camera, 0.02).hyperfocal_tolerance_mm, 0);
  camera.statements["lens.front_focal_length_mm"].tolerance = 0.1;
  Camera longer = camera;
  longer.lens.front_focal_length_mm += 0.1;
  EXPECT_NEAR(FocusLimitsOf(camera, 0.02).hyperfocal_tolerance_mm,
              FocusLimitsOf(longer, 0.02).hyperfocal_mm - FocusLimitsOf(camera, 0.02).hyperfocal_mm,
              1e-9);
  camera.statements.clear();
  camera.statements["lens.aperture_radius_mm"].tolerance = 0.2;
  Camera wider = camera;
  wider.lens.aperture_radius_mm += 0.2;
  EXPECT_NEAR(FocusLimitsOf(camera, 0.02).hyperfocal_tolerance_mm,
              FocusLimitsOf(wider, 0.02).hyperfocal_mm - FocusLimitsOf(camera, 0.02).hyperfocal_mm,
              1e-9);
}

TEST(FocusLimits, RefuseACircleThatIsNone) {
  for (const double circle_mm : {0.0, -1.0, 20.0, std::nan("")}) {
    EXPECT_THAT(ErrorOf([&] { FocusLimitsOf(CameraAt(400), circle_mm); }),
                HasSubstr("circle of confusion: a diameter > 0 and below that of the aperture"));
  }
}

}  // namespace
}  // namespace thicklens::model
