// Calibrations of sweeps that an aberrated lens took.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "tests/calib/simulated_sweep.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/model/light_field.h"

namespace thicklens::calib {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using thicklens::testing::GiveFloor;
using thicklens::testing::Simulate;
using thicklens::testing::SimulatedSweep;
using thicklens::testing::SweepCase;

// Standard errors from the truth to the nearest end of the interval of a result; 0 inside.
double SigmasBeyond(const Result& result, double truth) {
  double low = result.value, high = result.value;
  if (result.systematic) {
    low = std::min(low, result.systematic->x());
    high = std::max(high, result.systematic->y());
  }
  return std::max({0.0, low - truth, truth - high}) / result.sigma;
}

Calibration Calibrated(const model::LensAberrations& aberrations, std::uint64_t seed) {
  model::SweepSimulationOptions options = SweepCase("ii", 0, seed);
  options.camera = model::CropCamera(options.camera, {96, 136, 320, 240});
  options.bits = 16;
  options.aberrations = aberrations;
  SimulatedSweep simulated = Simulate(options);
  GiveFloor(&simulated);
  return Calibrate(simulated.sweep, {});
}

// The distortion is reported, and kappa, which a barrel makes too small, has the truth within the
// interval and two standard errors.
TEST(AberratedLens, TheIntervalOfKappaCoversADistortion) {
  model::LensAberrations aberrations;
  aberrations.distortion = -0.04;
  const Calibration found = Calibrated(aberrations, 5);
  ASSERT_TRUE(found.summary.blur_ratio) << found.summary.reason;
  EXPECT_THAT(found.summary.warnings, Contains(HasSubstr("distorted images, -3.9")));
  const Result& ratio = *found.summary.blur_ratio;
  EXPECT_GT((0.45 - ratio.value) / ratio.sigma, 2.5) << "the distortion moves kappa";
  EXPECT_LE(SigmasBeyond(ratio, 0.45), 2);
  EXPECT_LT(ratio.systematic->y() - ratio.systematic->x(), 0.02);
  EXPECT_LE(SigmasBeyond(*found.summary.focus_depth_mm, 300), 2);
}

// The medial focus, and a blur ratio that one blur for all directions would make too small.
TEST(AberratedLens, AstigmatismIsFoundWithTheMedialFocus) {
  model::LensAberrations aberrations;
  aberrations.astigmatism_mm = -4;
  const Calibration found = Calibrated(aberrations, 6);
  ASSERT_TRUE(found.summary.blur_ratio) << found.summary.reason;
  EXPECT_LE(SigmasBeyond(*found.summary.blur_ratio, 0.45), 2);
  EXPECT_LE(SigmasBeyond(*found.summary.focus_depth_mm, 300), 2);
  EXPECT_NEAR(found.summary.focus_depth_mm->value, 300, 0.1);
  ASSERT_TRUE(found.diagnostics.field.astigmatism_mm);
  EXPECT_NEAR(found.diagnostics.field.astigmatism_mm->value, -4, 0.15);
}

}  // namespace
}  // namespace thicklens::calib
