#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "thicklens/calib/calibrate.h"

namespace thicklens::calib {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

// All numbers are different, so that a test notices if two are exchanged.
Calibration Found() {
  Calibration c;
  c.summary.outcome = Outcome::kOk;
  c.summary.image_distance_mm = Result{16.2, 0.01, Eigen::Vector2d(16, 16.5)};
  c.summary.focus_depth_mm = Result{400, 0.2, std::nullopt};
  c.summary.blur_ratio = Result{0.45, 0.03, std::nullopt};
  c.summary.blur_floor_px = Result{0.5, 0.04, std::nullopt};
  c.summary.bench_offset_mm = Result{30, 0.05, std::nullopt};
  c.diagnostics.covariance_order = {"image_distance_mm", "blur_ratio", "blur_floor_px",
                                    "bench_offset_mm"};
  c.diagnostics.covariance = Eigen::Vector4d(1, 2, 3, 4).asDiagonal();
  c.diagnostics.blur.chi2_per_dof = 1.25;
  c.diagnostics.blur.family = model::Psf::kDisc;
  c.diagnostics.blur.band = 0.75;
  c.diagnostics.paper_recipe.image_distance_mm = 17.1;
  c.diagnostics.paper_recipe.blur_ratio = 2.5;
  c.diagnostics.paper_recipe.focus_depth_mm = 380;
  c.summary.frames_used = 2;
  c.frames.resize(4);
  c.frames[0].image = "/bench/day 1/a.png";
  c.frames[0].rejection = "dark: mean 1";
  c.frames[1].image = "/bench/day 1/b.png";
  c.frames[2].image = "c.png";
  c.frames[2].not_in_fit = "blurred too strongly";
  c.frames[3].image = "../d.png";
  c.frames[3].rejection = "blank";
  return c;
}

void ExpectEstimate(const std::optional<model::Estimate>& found, double value, double sigma) {
  ASSERT_TRUE(found);
  EXPECT_EQ(found->value, value);
  EXPECT_EQ(found->sigma, sigma);
}

void ExpectFrames(const model::Evidence& evidence) {
  EXPECT_EQ(evidence.frames_used, 2);
  ASSERT_EQ(evidence.frames_rejected.size(), 2U);
  EXPECT_EQ(evidence.frames_rejected[0].image, "a.png");
  EXPECT_EQ(evidence.frames_rejected[0].reason, "dark");  // without its numbers
  EXPECT_EQ(evidence.frames_rejected[1].image, "d.png");
  EXPECT_EQ(evidence.frames_rejected[1].reason, "blank");
}

TEST(CalibratedCamera, TheJointFitHasEveryResultInItsPlace) {
  const model::Camera camera = CalibratedCamera({}, Found(), false);
  ASSERT_TRUE(camera.calibration);
  const model::CameraCalibration& c = *camera.calibration;
  ExpectEstimate(c.image_distance_mm, 16.2, 0.01);
  ExpectEstimate(c.blur_ratio, 0.45, 0.03);
  ExpectEstimate(c.blur_floor_px, 0.5, 0.04);
  ExpectEstimate(c.bench_offset_mm, 30, 0.05);
  ExpectEstimate(c.evidence.focus_depth_mm, 400, 0.2);
  EXPECT_EQ(c.evidence.method, "joint-blur-fit");
  EXPECT_EQ(c.evidence.chi2_per_dof, 1.25);
  EXPECT_EQ(c.evidence.blur_family, "disc");
  EXPECT_EQ(c.evidence.blur_band, 0.75);
  EXPECT_THAT(c.covariance_order,
              ElementsAre("image_distance_mm", "blur_ratio", "blur_floor_px", "bench_offset_mm"));
  EXPECT_EQ(c.covariance(2, 2), 3);
  ExpectFrames(c.evidence);
}

// The recipe has no errors and does not determine a floor.
TEST(CalibratedCamera, TheSourcesRecipeHasItsOwnNumbersAlone) {
  const model::Camera camera = CalibratedCamera({}, Found(), true);
  const model::CameraCalibration& c = *camera.calibration;
  ExpectEstimate(c.image_distance_mm, 17.1, 0);
  ExpectEstimate(c.blur_ratio, 2.5, 0);
  ExpectEstimate(c.evidence.focus_depth_mm, 380, 0);
  ExpectEstimate(c.bench_offset_mm, 30, 0.05);
  EXPECT_FALSE(c.blur_floor_px);
  EXPECT_EQ(c.evidence.method, "source-recipe");
  EXPECT_EQ(c.evidence.blur_family, "");
  EXPECT_FALSE(c.evidence.chi2_per_dof);
  EXPECT_THAT(c.covariance_order, IsEmpty());
  EXPECT_EQ(c.covariance.size(), 0);
  ExpectFrames(c.evidence);
}

TEST(CalibratedCamera, WhatIsUndeterminedIsNotWritten) {
  const std::string names[] = {"image_distance_mm", "blur_ratio", "blur_floor_px"};
  for (const std::string& name : names) {
    Calibration found = Found();
    found.diagnostics.blur.undetermined = {name};
    const model::CameraCalibration c = *CalibratedCamera({}, found, false).calibration;
    EXPECT_EQ(c.image_distance_mm.has_value(), name != "image_distance_mm");
    EXPECT_EQ(c.blur_ratio.has_value(), name != "blur_ratio");
    EXPECT_EQ(c.blur_floor_px.has_value(), name != "blur_floor_px");
  }
}

TEST(CalibratedCamera, WhatIsNotThereIsNotWritten) {
  Calibration found = Found();
  found.summary.blur_floor_px.reset();
  found.summary.bench_offset_mm.reset();
  const model::CameraCalibration c = *CalibratedCamera({}, found, false).calibration;
  EXPECT_FALSE(c.blur_floor_px);
  EXPECT_FALSE(c.bench_offset_mm);
}

TEST(CalibratedCamera, AnOlderCalibrationIsReplacedAndTheRestKept) {
  model::Camera camera;
  camera.name = "bench camera";
  camera.lens = {12.5, 12.8, 3, 4.4};
  camera.statements["lens.lens_thickness_mm"] = {0.1, true};
  camera.calibration = model::CameraCalibration{};
  camera.calibration->blur_floor_px = model::Estimate{9, 9};
  const model::Camera result = CalibratedCamera(camera, Found(), true);
  EXPECT_FALSE(result.calibration->blur_floor_px);
  EXPECT_EQ(result.name, "bench camera");
  EXPECT_EQ(result.lens.lens_thickness_mm, 3);
  EXPECT_EQ(result.statements.size(), 1U);
}

}  // namespace
}  // namespace thicklens::calib
