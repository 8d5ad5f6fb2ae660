// Data that a measurement of the blur copies from its task: places, scales, expectations.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "calib/fit/blur_measurement.h"
#include "support/test_cameras.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::calib {
namespace {

using model::SweepTarget;
using ::testing::ElementsAre;

// A task whose frames need not be read: no frame is registered, and edges are not searched.
struct Unread {
  FocusSweep sweep;
  FrameStore store{sweep};
  BlurTask task{sweep, store};

  explicit Unread(std::size_t count) {
    sweep.target = SweepTarget::kTexture;
    sweep.camera.lens = testing::WideLens(4.4643);
    sweep.camera.sensor.pixel_pitch_mm = 0.006;
    sweep.camera.sensor.width_px = 640;
    sweep.camera.sensor.height_px = 480;
    sweep.camera.sensor.principal_point_px = {310, 250};
    for (std::size_t i = 0; i < count; ++i) {
      sweep.frames.push_back({"frame", 300 + 10.0 * static_cast<double>(i)});
      task.frames.push_back(i);
    }
    task.reference = 3;
    task.offset_mm = {40, 0.5};
    task.reading_sigma_mm = 0.07;
    task.reading_sigma_is_known = false;
    task.start_focus_depth_mm = 380;
  }
  void Register(std::size_t frame, double scale) {
    ScaleSample sample;
    sample.frame = frame;
    sample.scale = scale;
    sample.registration.scale_sigma = 0.001 * static_cast<double>(1 + frame);
    task.scales.push_back(sample);
  }
};

TEST(MeasureBlur, TheFitsSetUpIsTheTasks) {
  Unread u(6);
  u.sweep.direction = model::BenchDirection::kAway;
  const BlurFitSetup setup = MeasureBlur(u.task).setup;
  EXPECT_EQ(setup.lens.front_focal_length_mm, 12.5);
  EXPECT_EQ(setup.pixel_pitch_mm, 0.006);
  EXPECT_EQ(setup.offset_mm.value, 40);
  EXPECT_EQ(setup.offset_mm.sigma, 0.5);
  EXPECT_EQ(setup.reading_sigma_mm, 0.07);
  EXPECT_FALSE(setup.reading_sigma_is_known);
  EXPECT_EQ(setup.direction, model::BenchDirection::kAway);
  ASSERT_EQ(setup.frames.size(), 6U);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(setup.frames[i].reading_mm, u.sweep.frames[i].reading_mm);
    // z_reference/z, z = 40 + reading.
    EXPECT_NEAR(setup.frames[i].scale, 370 / (340 + 10.0 * static_cast<double>(i)), 1e-12);
    EXPECT_FALSE(setup.frames[i].scale_sigma);
  }
}

TEST(MeasureBlur, ARegisteredScaleCountsMoreThanTheReadingsUnlessItCannotBeRight) {
  Unread u(6);
  u.Register(0, 370.0 / 340 * 1.04);
  u.Register(1, 370.0 / 350 * 1.06);
  u.Register(2, 370.0 / 360 * 0.96);
  u.Register(4, 370.0 / 380 * 0.94);
  const BlurFitSetup setup = MeasureBlur(u.task).setup;
  EXPECT_NEAR(setup.frames[0].scale, 370.0 / 340 * 1.04, 1e-12);
  EXPECT_NEAR(setup.frames[1].scale, 370.0 / 350, 1e-12);
  EXPECT_NEAR(setup.frames[2].scale, 370.0 / 360 * 0.96, 1e-12);
  EXPECT_NEAR(setup.frames[4].scale, 370.0 / 380, 1e-12);
  for (const FitFrame& frame : setup.frames) EXPECT_FALSE(frame.scale_sigma);
}

// Only then do the scales determine the errors of the readings. The scale of the reference is 1
// whatever its reading is.
TEST(MeasureBlur, ScalesThatFollowTheReadingsKeepTheirErrors) {
  Unread u(6);
  for (const std::size_t i : {1U, 3U, 4U})
    u.Register(i, 370 / (340 + 10.0 * static_cast<double>(i)));
  u.task.scale_follows_readings = true;
  const BlurFitSetup setup = MeasureBlur(u.task).setup;
  for (std::size_t i = 0; i < 6; ++i)
    EXPECT_EQ(setup.frames[i].scale_sigma.has_value(), i == 1 || i == 4);
  EXPECT_EQ(setup.frames[1].scale_sigma, 0.002);
}

TEST(MeasureBlur, ATelecentricLensHasOneScale) {
  Unread u(6);
  u.task.law = BlurModel::kTelecentric;
  u.Register(5, 1.001);
  const BlurFitSetup setup = MeasureBlur(u.task).setup;
  EXPECT_EQ(setup.law, BlurModel::kTelecentric);
  EXPECT_EQ(setup.frames[0].scale, 1);
  EXPECT_EQ(setup.frames[5].scale, 1.001);
}

TEST(MeasureBlur, TheFloorThatIsAssumedIsTheOneThatIsKnown) {
  Unread u(6);
  EXPECT_EQ(MeasureBlur(u.task).assumed_floor_px2, 0.25);
  u.sweep.floor.from_px = 0.2;
  u.sweep.floor.to_px = 0.8;
  EXPECT_NEAR(MeasureBlur(u.task).assumed_floor_px2, 0.5 * (0.04 + 0.64), 1e-12);
  u.sweep.floor.given_px = model::Estimate{0.7, 0.1};
  EXPECT_NEAR(MeasureBlur(u.task).assumed_floor_px2, 0.49, 1e-12);
}

// The input of the spectral blur estimator for every frame, computed by hand.
TEST(MeasureBlur, TheSpectralMeterGetsTheExpectedBlur) {
  Unread u(4);  // too few to be measured
  u.sweep.roi = {100, 80, 320, 200};
  u.sweep.floor.given_px = model::Estimate{0.6, 0};
  u.task.pixel_noise = 0.004;
  for (const std::size_t i : {1U, 3U}) u.Register(i, 370 / (340 + 10.0 * static_cast<double>(i)));
  u.task.scales[0].registration.shift_px = {1, 2};
  u.task.scales[0].registration.rotation_rad = 0.01;
  const BlurEvidence evidence = MeasureBlur(u.task);
  const SpectralEstimatorSetup& estimator = evidence.spectral;
  EXPECT_EQ(estimator.origin_px, Eigen::Vector2d(210, 170));
  EXPECT_EQ(estimator.size_px, Eigen::Vector2d(320, 200));
  ASSERT_EQ(estimator.frames.size(), 2U);
  EXPECT_EQ(estimator.reference, 1U);
  EXPECT_EQ(estimator.frames[0].frame, 1U);
  EXPECT_THAT(evidence.fit_index, ElementsAre(1U, 3U));
  EXPECT_EQ(estimator.frames[0].place.shift_px, Eigen::Vector2d(1, 2));
  EXPECT_EQ(estimator.frames[0].rotation_rad, 0.01);
  EXPECT_EQ(estimator.frames[0].pixel_noise, 0.004);
  // (S0 + (kappa r_defocus/p)^2)/scale^2 with kappa 0.45, at 350 mm, in focus at 380.
  const double radius_mm = model::BlurRadiusMm(
      u.sweep.camera.lens, model::ImageDistanceMm(u.sweep.camera.lens, 380), 350);
  const double scale = 370.0 / 350;
  EXPECT_NEAR(estimator.frames[0].expected_variance_px2,
              (0.36 + std::pow(0.45 * radius_mm / 0.006, 2)) / (scale * scale), 1e-9);
  EXPECT_EQ(estimator.modes_per_ring, 200);
  EXPECT_EQ(MeasureBlur(Unread(400).task).spectral.modes_per_ring, 75);
  EXPECT_EQ(MeasureBlur(Unread(2000).task).spectral.modes_per_ring, 24);
}

TEST(MeasureBlur, WithoutARegionTheWholeSensorIsSeen) {
  Unread u(4);
  const BlurEvidence evidence = MeasureBlur(u.task);
  EXPECT_EQ(evidence.spectral.size_px, Eigen::Vector2d(640, 480));
  EXPECT_EQ(evidence.spectral.origin_px, Eigen::Vector2d(310, 250));
}

TEST(SpectralOptions, ADiscsBandStaysBelowItsFirstZero) {
  const RelativeBlurOptions gaussian = SpectralOptions(model::Psf::kGaussian, 0.3, 1);
  EXPECT_EQ(gaussian.band, 2);
  EXPECT_EQ(gaussian.floor_variance_px2, 0.3);
  EXPECT_EQ(gaussian.psf, model::Psf::kGaussian);
  const RelativeBlurOptions half = SpectralOptions(model::Psf::kDisc, 0.3, 0.5);
  EXPECT_EQ(half.band, 0.5);
  EXPECT_EQ(half.psf, model::Psf::kDisc);
}

}  // namespace
}  // namespace thicklens::calib
