// Calibrations of sweeps whose light changes from frame to frame.
#include "thicklens/calib/frame_light.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "tests/calib/calibrated_sweep.h"
#include "tests/calib/simulated_sweep.h"

namespace thicklens::calib {
namespace {

using ::testing::Contains;
using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using namespace thicklens::testing;

SimulatedSweep WithLight(const std::function<void(model::SweepSimulationOptions*)>& change) {
  model::SweepSimulationOptions options = SweepCase("ii", 256, 4);
  change(&options);
  SimulatedSweep s = Simulate(options);
  GiveFloor(&s);
  return s;
}

void ExpectTruth(const Calibration& c, const SimulatedSweep& s) {
  ASSERT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
  EXPECT_NEAR(c.summary.focus_depth_mm->value, s.truth.focus_depth_mm,
              4 * c.summary.focus_depth_mm->sigma);
  EXPECT_NEAR(c.summary.blur_ratio->value, s.truth.blur_ratio, 4 * c.summary.blur_ratio->sigma);
}

TEST(FrameLight, ACleanSweepHasNoFindings) {
  const Calibration c = CalibrateWithoutMap(WithLight([](auto*) {}));
  EXPECT_FALSE(c.diagnostics.light.bands);
  EXPECT_FALSE(c.diagnostics.light.bands_removed);
  EXPECT_THAT(c.diagnostics.light.InWords(), IsEmpty());
}

TEST(FrameLight, BandsAreDividedOutAndNamed) {
  const Calibration clean = CalibrateWithoutMap(WithLight([](auto*) {}));
  for (const bool square_columns : {false, true}) {
    SCOPED_TRACE(square_columns);
    const SimulatedSweep s = WithLight([&](model::SweepSimulationOptions* options) {
      options->band_amplitude = square_columns ? 0.25 : 0.15;
      options->band_period_px = square_columns ? 31 : 24;
      options->bands_are_square = options->bands_are_columns = square_columns;
      if (square_columns) options->light_level = 0.4;
    });
    const Calibration c = CalibrateWithoutMap(s);
    ExpectTruth(c, s);
    EXPECT_TRUE(c.diagnostics.light.bands_removed);
    EXPECT_EQ(c.diagnostics.light.bands_are_columns, square_columns);
    EXPECT_EQ(c.summary.frames_rejected, clean.summary.frames_rejected);
    EXPECT_LT(c.summary.blur_ratio->sigma, 1.5 * clean.summary.blur_ratio->sigma);
    EXPECT_THAT(c.summary.warnings,
                Contains(HasSubstr(square_columns ? "whole columns brighten together by 2"
                                                  : "whole rows brighten together by 1")));
    EXPECT_THAT(c.summary.warnings, Each(Not(HasSubstr("could be registered"))));
  }
}

// Each frame is compared with its own mean.
TEST(FrameLight, ADriftOfTheExposureIsNamedAndChangesNothing) {
  const Calibration clean = CalibrateWithoutMap(WithLight([](auto*) {}));
  const SimulatedSweep s = WithLight([](model::SweepSimulationOptions* options) {
    options->light_level = 0.3;
    options->exposure_drift_stops = -1.5;
  });
  const Calibration c = CalibrateWithoutMap(s);
  ExpectTruth(c, s);
  ASSERT_TRUE(c.diagnostics.light.exposure_range_stops);
  // A lamp that moves away explains a part of the drift.
  EXPECT_NEAR(*c.diagnostics.light.exposure_range_stops, 1.5, 0.45);
  EXPECT_NEAR(std::abs(c.diagnostics.light.exposure_trend_stops), 1.5, 0.45);
  EXPECT_NEAR(c.summary.blur_ratio->value, clean.summary.blur_ratio->value,
              clean.summary.blur_ratio->sigma);
  EXPECT_THAT(c.summary.warnings, Contains(HasSubstr("set exposure and gain by hand")));
}

// A wrong transfer makes the fall-off of a lamp at the camera look like a change of the exposure.
TEST(FrameLight, AWrongTransferIsNoDriftOfTheExposure) {
  SimulatedSweep s = WithLight([](model::SweepSimulationOptions* options) {
    options->camera.sensor.transfer = model::TransferCurve::Linear();
  });
  s.sweep.camera.sensor.transfer = model::TransferCurve::Srgb();
  const Calibration c = CalibrateWithoutMap(s);
  ASSERT_TRUE(c.diagnostics.response.ContradictsTransfer());
  ASSERT_TRUE(c.diagnostics.light.exposure_range_stops);
  EXPECT_LT(*c.diagnostics.light.exposure_range_stops, 0.15);
  EXPECT_THAT(c.summary.warnings, Each(Not(HasSubstr("set exposure and gain by hand"))));
}

TEST(FrameLight, AChangeOfTheWhiteBalanceIsNamed) {
  SimulatedSweep s = WithLight([](auto*) {});
  const model::TransferCurve& transfer = s.sweep.camera.sensor.transfer;
  auto coloured = std::make_shared<std::vector<cv::Mat>>();
  const auto n = static_cast<double>(s.stored->size());
  for (std::size_t i = 0; i < s.stored->size(); ++i) {
    const cv::Mat& grey = (*s.stored)[i];
    const double part = static_cast<double>(i) / (n - 1);
    cv::Mat channels[3];
    for (int c = 0; c < 3; ++c) {
      const double gain = c == 0 ? 0.9 + 0.1 * part : c == 2 ? 1 - 0.05 * part : 0.95;
      channels[c] = grey.clone();
      for (auto& value : cv::Mat_<std::uint8_t>(channels[c]))
        value = cv::saturate_cast<std::uint8_t>(
            255 * transfer.Encode(gain * transfer.Decode(value / 255.0)));
    }
    cv::Mat frame;
    cv::merge(channels, 3, frame);
    coloured->push_back(frame);
  }
  s.stored = coloured;
  s.sweep.read_frame = [coloured](std::size_t i) { return (*coloured)[i]; };
  const Calibration c = CalibrateWithoutMap(s);
  ExpectTruth(c, s);
  ASSERT_TRUE(c.diagnostics.light.red_change && c.diagnostics.light.blue_change);
  EXPECT_NEAR(*c.diagnostics.light.red_change, 1 / 0.9 - 1, 0.01);
  EXPECT_NEAR(*c.diagnostics.light.blue_change, 1 / 0.95 - 1, 0.01);
  EXPECT_THAT(c.summary.warnings, Contains(HasSubstr("set the white balance by hand")));
  EXPECT_FALSE(c.diagnostics.light.ExposureChanges());
}

}  // namespace
}  // namespace thicklens::calib
