#include "calib/registration/expected_scale.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "calib/registration/scale_tracking.h"
#include "calib/spectrum/texture_spectrum.h"
#include "tests/calib/simulated_sweep.h"

namespace thicklens::calib {
namespace {

using thicklens::testing::Simulate;
using thicklens::testing::SweepCase;

constexpr int kSizePx = 128;
constexpr std::size_t kReference = 4;

struct Scene {
  model::SweepSimulationOptions options = SweepCase("iii", kSizePx, 1);
  std::vector<ExpectedFrame> frames;
  ExpectedField field;

  Scene() {
    options.target.kind = model::TargetKind::kWhiteNoise;
    options.first_depth_mm = 360;
    options.step_mm = 10;
    options.frame_count = 9;
    options.lamp_falloff = false;
    options.flicker = 0;
    const double zf = options.camera.focus_depth_mm();
    const double f1 = options.camera.lens.front_focal_length_mm;
    const double px_mm = options.camera.sensor.pixel_pitch_mm * (zf - f1) / f1;
    options.target.feature_size_mm = 3 * px_mm;
    const TextureSpectrum spectrum({options.target.kind, options.target.contrast,
                                    options.target.feature_size_mm, kSizePx * px_mm});
    field.size_px = {kSizePx, kSizePx};
    field.centre_px = options.camera.sensor.principal_point_px;
    field.texture_px2 = [spectrum, px_mm](double f) {
      return spectrum.DensityMm2(f / px_mm) / (px_mm * px_mm);
    };
    const auto simulated = Simulate(options);
    for (const auto& frame : simulated.truth.frames) {
      ExpectedFrame expected;
      expected.reading_mm = frame.depth_mm;
      expected.scale = simulated.truth.frames[kReference].depth_mm / frame.depth_mm;
      expected.variance_px2 = frame.blur_sigma_px * frame.blur_sigma_px;
      // Shot noise of 10000 electrons at the level of the light.
      expected.relative_noise = std::sqrt(options.light_level / 10000) / options.light_level;
      frames.push_back(expected);
    }
  }
};

TEST(ExpectScales, ErrorsAreThoseThatTheRegistrationStates) {
  Scene scene;
  const ExpectedScales expected = ExpectScales(scene.frames, kReference, scene.field);
  ASSERT_EQ(expected.samples.size(), scene.frames.size());
  std::vector<double> sums(scene.frames.size(), 0);
  constexpr int kSeeds = 4;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    scene.options.seed = static_cast<std::uint64_t>(seed);
    const auto simulated = Simulate(scene.options);
    std::vector<std::size_t> all;
    for (std::size_t i = 0; i < scene.frames.size(); ++i) all.push_back(i);
    const auto grey = [&](std::size_t i) {
      return LinearGrey(simulated.sweep.read_frame(i), simulated.sweep, i);
    };
    for (const ScaleSample& sample :
         TrackScale(simulated.sweep, grey, all, kReference, 0.0, 1, [] {}))
      sums[sample.frame] += sample.registration.scale_sigma / kSeeds;
  }
  double ratio = 0;
  for (const ScaleSample& sample : expected.samples) {
    if (sample.frame == kReference) continue;
    EXPECT_NEAR(std::log(sums[sample.frame] / sample.registration.scale_sigma), 0, std::log(1.6))
        << "frame " << sample.frame;
    ratio += sums[sample.frame] / sample.registration.scale_sigma / 8;
  }
  EXPECT_NEAR(ratio, 1, 0.25);
}

TEST(ExpectScales, TwiceTheNoiseGivesTwiceTheError) {
  Scene scene;
  for (ExpectedFrame& frame : scene.frames) frame.relative_noise *= 2;
  const ExpectedScales once = ExpectScales(scene.frames, kReference, scene.field);
  for (ExpectedFrame& frame : scene.frames) frame.relative_noise *= 2;
  const ExpectedScales twice = ExpectScales(scene.frames, kReference, scene.field);
  for (std::size_t i = 1; i < once.samples.size(); ++i)
    EXPECT_NEAR(twice.own_sigmas[i] / once.own_sigmas[i], 2, 0.35) << i;
  EXPECT_GT(twice.OffsetScatterMm(0), 1.6 * once.OffsetScatterMm(0));
}

// Exact scales: the offset has the error of a straight line through the readings, and its
// extrapolation to zero.
TEST(ExpectScales, OffsetHasTheErrorOfALine) {
  ExpectedScales exact;
  const double reference_mm = 400;
  for (int i = 0; i < 9; ++i) {
    ScaleSample sample;
    sample.reading_mm = i == 0 ? reference_mm : 355 + 10.0 * i;
    sample.scale = reference_mm / sample.reading_mm;
    exact.samples.push_back(sample);
    exact.own_sigmas.push_back(0);
    exact.by_distortion.push_back(0);
  }
  double mean = 0, squares = 0;
  for (const ScaleSample& sample : exact.samples) mean += sample.reading_mm / 9;
  for (const ScaleSample& sample : exact.samples) squares += std::pow(sample.reading_mm - mean, 2);
  const double sigma_mm = 0.1;
  EXPECT_NEAR(exact.OffsetScatterMm(sigma_mm),
              sigma_mm * std::sqrt(1.0 / 9 + mean * mean / squares), 1e-6);
}

TEST(ExpectScales, LeavesOutFramesThatShareTooLittle) {
  Scene scene;
  scene.frames[0].scale = 5;
  const ExpectedScales expected = ExpectScales(scene.frames, kReference, scene.field);
  for (const ScaleSample& sample : expected.samples) EXPECT_NE(sample.frame, 0U);
}

}  // namespace
}  // namespace thicklens::calib
