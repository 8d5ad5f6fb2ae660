#include "calib/calibrate/zero_choice.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <random>
#include <vector>

#include "calib/fit/known_focus.h"
#include "support/test_cameras.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::calib {
namespace {

FocusSweep MacroBench() {
  FocusSweep sweep;
  sweep.camera.lens = {100, 103, 4, 17.86};
  sweep.camera.sensor.pixel_pitch_mm = 0.0043;
  sweep.camera.sensor.width_px = sweep.camera.sensor.height_px = 256;
  return sweep;
}

// A line grid of 0.1 mm, drawn at the magnification that the lens equation gives for a frame that
// is beside the plane of focus.
TEST(MagnificationOfPeriod, IsThatInThePlaneOfFocus) {
  FocusSweep sweep = MacroBench();
  sweep.target_period_mm = 0.1;
  const double zf = 190, d1_mm = model::ImageDistanceMm(sweep.camera.lens, zf);
  for (const double beyond_mm : {0.0, 3.0, -5.0}) {
    const double in_frame = -model::ChiefRayMagnification(sweep.camera.lens, d1_mm, zf + beyond_mm);
    const double period_px = in_frame * 0.1 / sweep.camera.sensor.pixel_pitch_mm;
    cv::Mat_<float> grey(256, 256);
    for (int y = 0; y < grey.rows; ++y) {
      for (int x = 0; x < grey.cols; ++x)
        grey(y, x) = static_cast<float>(0.5 + 0.3 * std::cos(2 * CV_PI * x / period_px));
    }
    const auto stated = MagnificationOfPeriod(sweep, grey, beyond_mm);
    ASSERT_TRUE(stated);
    const double truth = -model::ChiefRayMagnification(sweep.camera.lens, d1_mm, zf);
    EXPECT_NEAR(stated->value.value, truth, 1e-3 * truth) << beyond_mm;
    EXPECT_NEAR(model::FocusDepthOf(sweep.camera.lens, *stated).value, zf, 0.1) << beyond_mm;
    EXPECT_GE(stated->value.sigma, 0.0029 * truth) << "the stated length is not exact";
  }
}

TEST(MagnificationOfPeriod, IsAbsentWithoutAPeriod) {
  FocusSweep sweep = MacroBench();
  cv::Mat_<float> grey(256, 256);
  std::mt19937 random(1);
  for (float& value : grey) value = static_cast<float>(random() % 1000) / 1000;
  EXPECT_FALSE(MagnificationOfPeriod(sweep, grey, 0)) << "none is stated";
  sweep.target_period_mm = 0.1;
  EXPECT_FALSE(MagnificationOfPeriod(sweep, grey, 0)) << "noise has none";
}

TEST(MostPrecise, ComparesTheErrorsInDepth) {
  FocusSweep sweep = MacroBench();
  sweep.camera.statements["lens.front_focal_length_mm"].tolerance = 1e-3;
  using Kind = model::ConjugateKind;
  // In depth: 2 mm; 100 mm 0.01/1 = 1 mm; 100 mm 103 mm 0.05/103^2 = 0.05 mm.
  const std::vector<model::StatedConjugate> statements = {
      {Kind::kFocusDepth, {200, 2}, "depth"},
      {Kind::kMagnification, {1, 0.01}, "magnification"},
      {Kind::kTubeLength, {103, 0.05}, "tube"}};
  EXPECT_EQ(MostPrecise(sweep.camera, statements)->name, "tube");
  EXPECT_EQ(MostPrecise(sweep.camera, {statements[0], statements[1]})->name, "magnification");
  EXPECT_FALSE(MostPrecise(sweep.camera, {}));
}

// Blurs of a lens with the usual ratio, 0.45, from the lens equation.
TEST(UsualFocusDepth, IsWhereTheBlurHasTheUsualRatio) {
  const FocusSweep sweep = MacroBench();
  const double zf = 190, d1_mm = model::ImageDistanceMm(sweep.camera.lens, zf);
  std::vector<ScaleSample> samples;
  for (int i = -10; i <= 10; ++i) {
    const double z_mm = zf + 0.1 * i;
    ScaleSample sample;
    sample.reading_mm = z_mm - 50;
    sample.scale = zf / z_mm;
    const double sigma_px = 0.45 * model::BlurRadiusMm(sweep.camera.lens, d1_mm, z_mm) /
                            sweep.camera.sensor.pixel_pitch_mm;
    sample.registration.added_variance_px2 = sigma_px * sigma_px;
    samples.push_back(sample);
  }
  EXPECT_NEAR(UsualFocusDepth(sweep.camera, samples, zf - 50), zf, 0.5);
  EXPECT_DOUBLE_EQ(UsualFocusDepth(sweep.camera, {}, 0), 200);
}

}  // namespace
}  // namespace thicklens::calib
