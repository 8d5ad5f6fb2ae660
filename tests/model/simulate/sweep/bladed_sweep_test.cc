// Simulated sweeps through apertures of blades.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>

#include "support/error_message.h"
#include "support/test_cameras.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;
using thicklens::testing::ErrorOf;
using thicklens::testing::TestCameraFocusedAt;
using thicklens::testing::TestSensor;

constexpr double kBladesFocusMm = 300, kBladesPitchMm = 0.02, kBladesRadiusMm = 8.9;

SweepSimulationOptions OfBlades(int blades, double first_depth_mm) {
  SweepSimulationOptions options;
  options.camera = TestCameraFocusedAt(kBladesFocusMm, "bladed", {50, 50, 0, kBladesRadiusMm},
                                       TestSensor(96, 96, kBladesPitchMm, {47.5, 47.5}),
                                       {std::sqrt(5.0 / 24), 0});
  options.camera.psf = Psf::kDisc;
  options.camera.calibration->blur_floor_px = Estimate{0, 0};
  options.target.kind = TargetKind::kPinholes;
  options.target.feature_size_mm = 0.13;
  options.target.spacing_mm = 4.5;
  options.target.contrast = 1;
  options.first_depth_mm = first_depth_mm;
  options.frame_count = 1;
  options.lamp_falloff = false;
  options.pupil_law = PupilLaw::kUniform;
  options.effects.base = EffectSelectionOptions::Base::kGiven;
  options.effects.given = {Effect::kDefocus, Effect::kMagnification, Effect::kApertureShape};
  options.aperture.blades = blades;
  return options;
}

// Light at a place, bilinear.
double At(const LinearImage& image, double x, double y) {
  const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
  const auto value = [&](int dx, int dy) {
    return static_cast<double>(
        image.values[static_cast<std::size_t>((j + dy) * image.width_px + i + dx)]);
  };
  const double u = x - i, v = y - j;
  return (1 - v) * ((1 - u) * value(0, 0) + u * value(1, 0)) +
         v * ((1 - u) * value(0, 1) + u * value(1, 1));
}

// The brightest small neighbourhood of a sharp frame is a pinhole.
Eigen::Vector2d PinholeOf(SweepSimulationOptions options) {
  options.effects.given.Remove(Effect::kDefocus);
  const LinearImage image = SweepSimulator(options, {}).RenderNoiseless(0);
  double most = 0;
  Eigen::Vector2d at(0, 0);
  for (int y = 30; y < 66; ++y) {
    for (int x = 30; x < 66; ++x) {
      const double light = image.values[static_cast<std::size_t>(y * 96 + x)];
      if (light > most) {
        most = light;
        at = {x, y};
      }
    }
  }
  return at;
}

// A point beyond the plane of focus shows the outline, a nearer one the outline turned by half a
// turn: a triangle with a corner to the right has light there and none at the same distance to the
// left.
TEST(BladedSweep, APointShowsTheOutline) {
  for (const double depth_mm : {330.0, 275.0}) {
    const SweepSimulationOptions options = OfBlades(3, depth_mm);
    const LinearImage image = SweepSimulator(options, {}).RenderNoiseless(0);
    const Eigen::Vector2d pinhole = PinholeOf(options);
    const double k_mm = 50 * kBladesFocusMm / (kBladesFocusMm - 50);
    const double sigma_px = std::sqrt(5.0 / 24) * kBladesRadiusMm * k_mm / kBladesPitchMm *
                            std::abs(1 / depth_mm - 1 / kBladesFocusMm);
    // sigma of a triangle in a circle of radius R: R/sqrt(8).
    const double corner_px = std::sqrt(8.0) * sigma_px;
    ASSERT_GT(corner_px, 8);
    const double side = depth_mm > kBladesFocusMm ? 1 : -1;
    const double inside = At(image, pinhole.x() + side * 0.7 * corner_px, pinhole.y());
    const double outside = At(image, pinhole.x() - side * 0.7 * corner_px, pinhole.y());
    const double middle = At(image, pinhole.x(), pinhole.y());
    EXPECT_NEAR(inside / middle, 1, 0.35) << depth_mm;
    EXPECT_LT(outside, 0.3 * inside) << depth_mm;
  }
}

// A round outline, or one that is left out, gives the frames of the disc bit for bit.
TEST(BladedSweep, ARoundApertureIsTheDisc) {
  SweepSimulationOptions options = OfBlades(0, 320);
  const LinearImage disc = SweepSimulator(options, {}).RenderNoiseless(0);
  options.aperture.blades = 7;
  options.aperture.roundness = 1;
  EXPECT_EQ(SweepSimulator(options, {}).RenderNoiseless(0).values, disc.values);
  options.aperture.roundness = 0;
  EXPECT_NE(SweepSimulator(options, {}).RenderNoiseless(0).values, disc.values);
  EXPECT_EQ(SweepSimulator(options, {}).truth().aperture.blades, 7);
  options.effects.given.Remove(Effect::kApertureShape);
  const LinearImage left_out = SweepSimulator(options, {}).RenderNoiseless(0);
  options.aperture = {};
  EXPECT_EQ(left_out.values, SweepSimulator(options, {}).RenderNoiseless(0).values);
}

TEST(BladedSweep, RefusesWhatItDoesNotSimulate) {
  const auto why = [](SweepSimulationOptions options) {
    return ErrorOf([&] { const SweepSimulator simulator(options, {}); });
  };
  SweepSimulationOptions options = OfBlades(6, 320);
  options.camera.psf = Psf::kGaussian;
  EXPECT_THAT(why(options), HasSubstr("psf: disc"));
  options = OfBlades(6, 320);
  options.pupil_law.reset();
  EXPECT_THAT(why(options), HasSubstr("pupil_law must be stated as uniform"));
  options = OfBlades(6, 320);
  options.target.kind = TargetKind::kKnifeEdge;
  EXPECT_THAT(why(options), HasSubstr("the target must be no edge"));
  options = OfBlades(6, 320);
  options.aberrations.astigmatism_mm = 2;
  EXPECT_THAT(why(options), HasSubstr("neither field curvature nor astigmatism"));
}

}  // namespace
}  // namespace thicklens::model
