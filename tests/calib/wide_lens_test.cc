// Fall-off weighs the rays of an aperture: of a wide one the blur that is seen is narrower, and the
// picture is seen from in front of it. A calibration finds the aperture's own kappa all the same.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <string>

#include "blur_prediction.h"
#include "simulated_sweep.h"
#include "thicklens/calib/calibrate.h"

namespace thicklens::calib {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using namespace thicklens::testing;

constexpr double kRatio = 0.55;  // not the one that a calibration starts with

// Case iii, f/1.4: kappa as it is seen would be 3.1 % less of a Gaussian, 1.1 % of a disc, and the
// bench zero .9 mm off.
SimulatedSweep Wide(model::Psf psf, std::uint64_t seed, bool falloff = true) {
  model::SweepSimulationOptions options = SweepCase("iii", 160, seed);
  options.camera.psf = psf;
  options.camera.calibration->blur_ratio = model::Estimate{kRatio, 0};
  if (!falloff) options.effects.without = {model::Effect::kFalloff};
  SimulatedSweep s = Simulate(options);
  GiveDrawnFloor(&s, seed);
  return s;
}

Calibration Calibrated(const SimulatedSweep& s) {
  CalibrationOptions how;
  how.map_field = false;
  return Calibrate(s.sweep, how);
}

double Pull(const std::optional<Result>& result, double truth) {
  return result ? (result->value - truth) / result->sigma : std::nan("");
}

// Seeded: eight pulls of each, whose squares have the mean 1; all below three.
TEST(WideLens, FallOffIsReckonedWith) {
  double focus = 0, ratio = 0;
  for (const model::Psf psf : {model::Psf::kGaussian, model::Psf::kDisc}) {
    for (const bool offset_is_known : {true, false}) {
      for (const std::uint64_t seed : {71U, 72U}) {
        SCOPED_TRACE(PsfName(psf) + (offset_is_known ? ", zero given, " : ", zero not given, ") +
                     std::to_string(seed));
        SimulatedSweep s = Wide(psf, seed);
        if (!offset_is_known) s.sweep.offset_mm.reset();
        const Calibration c = Calibrated(s);
        ASSERT_EQ(c.outcome, Outcome::kOk) << c.reason;
        EXPECT_LT(std::abs(Pull(c.image_distance_mm, s.truth.image_distance_mm)), 3);
        EXPECT_LT(std::abs(Pull(c.blur_ratio, kRatio)), 3);
        EXPECT_LT(c.blur_ratio->sigma, 0.005 * kRatio);
        EXPECT_NEAR(c.scale.offset_mm.value, s.truth.bench_offset_mm, 3 * c.scale.offset_mm.sigma);
        focus += std::pow(Pull(c.focus_depth_mm, s.truth.focus_depth_mm), 2);
        ratio += std::pow(Pull(c.blur_ratio, kRatio), 2);
        EXPECT_EQ(c.blur.better_psf, psf);
        EXPECT_THAT(c.warnings, Not(Contains(HasSubstr("the blur is a"))));
        EXPECT_THAT(c.warnings, Not(Contains(HasSubstr("bench zero"))));
      }
    }
  }
  EXPECT_LT(focus / 8, 2.5);
  EXPECT_LT(ratio / 8, 2.5);
}

// And it is there to be reckoned with: of frames without it kappa comes out too large by as much.
TEST(WideLens, FramesWithoutFallOffShowAWiderAperture) {
  for (const model::Psf psf : {model::Psf::kGaussian, model::Psf::kDisc}) {
    const SimulatedSweep s = Wide(psf, 73, false);
    const Calibration c = Calibrated(s);
    ASSERT_TRUE(c.blur_ratio) << c.reason;
    EXPECT_GT(Pull(c.blur_ratio, kRatio), 6);
    const double seen = std::sqrt(
        model::SeeBlurRatio(s.sweep.camera.lens, psf, c.blur_ratio->value, c.focus_depth_mm->value)
            .squared);
    EXPECT_NEAR(seen, kRatio, 4 * c.blur_ratio->sigma);
  }
}

TEST(WideLens, SlopesOfThePredictionAreThoseOfItsValues) {
  BlurFitSetup setup;
  setup.lens = {12.5, 12.8, 3, 12.5 / 2.8};
  setup.pixel_pitch_mm = 0.006;
  setup.weighed_psf = model::Psf::kGaussian;
  const Eigen::Vector4d at(60, 0.5, 0.25, 0);
  const BlurPrediction prediction = PredictBlur(setup, at, 52, 1.1);
  for (const int k : {kFocusDepth, kBlurRatio, kFloorVariance}) {
    Eigen::Vector4d step = Eigen::Vector4d::Zero();
    step[k] = 1e-4;
    const double slope = (PredictBlur(setup, at + step, 52, 1.1).value -
                          PredictBlur(setup, at - step, 52, 1.1).value) /
                         2e-4;
    EXPECT_NEAR(prediction.by_global[k] / slope, 1, 1e-6) << k;
  }
  BlurFitSetup even = setup;
  even.weighed_psf.reset();
  EXPECT_GT(PredictBlur(even, at, 52, 1.1).value, 1.02 * prediction.value);
}

}  // namespace
}  // namespace thicklens::calib
