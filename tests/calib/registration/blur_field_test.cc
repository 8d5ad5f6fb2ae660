// The effect on the image scale of a blur that changes over the field.
#include "calib/registration/blur_field.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "calib/registration/scale_tracking.h"
#include "tests/calib/simulated_sweep.h"
#include "thicklens/model/light_field.h"

namespace thicklens::calib {
namespace {

using testing::Simulate;
using testing::SimulatedSweep;
using testing::SweepCase;

// Tiles of a field with constants, slopes, curvature b and astigmatism d, and independent errors.
std::vector<TileBlur> Tiles(double b, double d, double sigma_px2, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, 1);
  std::vector<TileBlur> tiles;
  for (int j = -1; j <= 2; ++j) {
    for (int i = -2; i <= 1; ++i) {
      TileBlur tile;
      tile.centre_px = {40.0 * i + 7, 30.0 * j - 4};
      const double x = tile.centre_px.x(), y = tile.centre_px.y(), r2 = x * x + y * y;
      const double mean = 3 + 0.01 * x - 0.02 * y + b * r2;
      tile.added_px2 = {mean + 0.4 + d * (x * x - y * y), mean - 0.4 - d * (x * x - y * y),
                        0.3 + 2 * d * x * y};
      for (double& value : tile.added_px2) value += sigma_px2 * normal(random);
      tile.information = Eigen::Matrix3d::Identity() / (sigma_px2 * sigma_px2 + 1e-12);
      tiles.push_back(tile);
    }
  }
  return tiles;
}

TEST(BlurField, IsFoundWithConstantsAndSlopesBeside) {
  const auto field = FitBlurField(Tiles(2e-4, -5e-5, 0, 1));
  ASSERT_TRUE(field);
  EXPECT_NEAR(field->curvature.value, 2e-4, 1e-10);
  EXPECT_NEAR(field->astigmatism.value, -5e-5, 1e-10);
  EXPECT_FALSE(FitBlurField({}));
}

TEST(BlurField, ErrorsAreThoseOfTheScatterWithItsMarginForOverlap) {
  constexpr int kSweeps = 2000;
  double curvature = 0, astigmatism = 0;
  for (std::uint32_t seed = 1; seed <= kSweeps; ++seed) {
    const auto field = FitBlurField(Tiles(2e-4, -5e-5, 0.2, seed));
    ASSERT_TRUE(field);
    curvature += std::pow((field->curvature.value - 2e-4) / field->curvature.sigma, 2) / kSweeps;
    astigmatism +=
        std::pow((field->astigmatism.value + 5e-5) / field->astigmatism.sigma, 2) / kSweeps;
  }
  // The variances have a factor of 1.5 for tiles that overlap, which these do not.
  EXPECT_NEAR(curvature, 1 / 1.5, 0.1);
  EXPECT_NEAR(astigmatism, 1 / 1.5, 0.1);
}

// Exact registrations of a lens whose blur curves in proportion to the change of scale.
TEST(BlurField, AFactorForAllFramesIsFoundWithWhatItLeavesOpen) {
  constexpr double kCurvature = 0.015, kExponent = -2;
  std::vector<ScaleSample> samples;
  std::vector<BlurOverField> blurs;
  std::vector<double> before;
  for (int i = 0; i < 21; ++i) {
    const double scale = 0.96 + 0.004 * i, change = scale - 1;
    BlurOverField blur;
    blur.field = BlurField{{kCurvature * change, 1e-6}, {0, 1e-6}};
    blur.texture = {-2.5, TexturePower::Exponent{kExponent, -2.5}};
    ScaleSample sample;
    sample.scale = sample.registration.scale = scale;
    samples.push_back(sample);
    blurs.push_back(blur);
    before.push_back(scale * (1 + StretchByBlur(kCurvature * change, 0, kExponent)));
  }
  const auto found = BlurPerScale(blurs, samples);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->curvature.value, kCurvature, 1e-9);
  const BlurField factors = SeenFactors(*found);
  EXPECT_EQ(factors.curvature.value, found->curvature.value);
  EXPECT_EQ(factors.astigmatism.value, 0);
  StateStretchByBlur(factors, blurs, before, &samples);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    // 15 % of a stretch of 2 b (s - 1).
    EXPECT_NEAR(samples[i].shared_stretch_sigma, 0.15 * 2 * kCurvature, 0.02 * kCurvature);
    ASSERT_TRUE(samples[i].registration.stretch_by_blur);
    EXPECT_NEAR(samples[i].registration.stretch_by_blur->value,
                -2 * kCurvature * (samples[i].scale - 1), 1e-9);
  }
  EXPECT_FALSE(BlurPerScale(std::vector<BlurOverField>(samples.size()), samples))
      << "nothing is known of these";
}

// Frames that a program aligned, or of a telecentric lens: all blurs curve, and the scales are
// noise.
std::vector<ScaleSample> AlignedSamples(double scale_sigma, double curvature,
                                        std::vector<BlurOverField>* blurs) {
  std::mt19937 random(9);
  std::normal_distribution<double> normal(0, 1);
  std::vector<ScaleSample> samples;
  for (int i = 0; i < 21; ++i) {
    ScaleSample sample;
    sample.scale = 1 + 1e-4 * normal(random);
    sample.registration.scale = sample.scale;
    sample.registration.scale_sigma = scale_sigma;
    samples.push_back(sample);
    BlurOverField blur;
    blur.field = BlurField{{curvature + 1e-3 * normal(random), 1e-3}, {0, 1e-3}};
    blur.texture = {-2.5, TexturePower::Exponent{-2, -2.5}};
    blurs->push_back(blur);
  }
  return samples;
}

TEST(BlurField, ScalesThatAreNoiseHaveNoFactor) {
  std::vector<BlurOverField> blurs;
  const std::vector<ScaleSample> samples = AlignedSamples(1e-4, 0.02, &blurs);
  EXPECT_FALSE(BlurPerScale(blurs, samples));
}

TEST(BlurField, AFactorWithinItsErrorIsAnErrorAlone) {
  std::vector<BlurOverField> blurs;
  std::vector<ScaleSample> samples = AlignedSamples(1e-6, 0, &blurs);
  const auto found = BlurPerScale(blurs, samples);
  ASSERT_TRUE(found);
  const BlurField factors = SeenFactors(*found);
  EXPECT_EQ(factors.curvature.value, 0);
  EXPECT_NEAR(factors.curvature.sigma, std::hypot(found->curvature.value, found->curvature.sigma),
              1e-12);
  StateStretchByBlur(factors, blurs, {}, &samples);
  for (const ScaleSample& sample : samples) {
    EXPECT_GT(sample.shared_stretch_sigma, 0);
    EXPECT_FALSE(sample.registration.stretch_by_blur);
  }
}

// Slope of ln(measured scale/true scale) against the change of the scale, from frames of a lens
// with a curved field, and the largest slope that the samples admit as their own error.
struct Slope {
  double left = 0, taken_out = 0, sigma = 0;
};
Slope SlopeOf(double curvature_mm, model::TargetKind target, std::uint64_t seed) {
  model::SweepSimulationOptions options = SweepCase("ii", 0, seed);
  options.camera = model::CropCamera(options.camera, {128, 160, 256, 192});
  options.bits = 16;
  options.frame_count = 11;
  options.first_depth_mm = 290.4;
  options.step_mm = 2;
  options.target.kind = target;
  options.aberrations.field_curvature_mm = curvature_mm;
  const SimulatedSweep s = Simulate(options);
  std::vector<std::size_t> frames;
  for (std::size_t i = 0; i < 11; ++i) frames.push_back(i);
  constexpr std::size_t kReference = 5;
  const auto samples = TrackScale(
      s.sweep, [&](std::size_t i) { return LinearGrey((*s.stored)[i], s.sweep, i); }, frames,
      kReference, 0.0, 1, [] {});
  Slope slope;
  double xx = 0;
  for (const ScaleSample& sample : samples) {
    const double scale = s.TrueScale(sample.frame, kReference), change = scale - 1;
    slope.left += change * (sample.scale / scale - 1);
    if (sample.registration.stretch_by_blur)
      slope.taken_out += change * sample.registration.stretch_by_blur->value;
    slope.sigma = std::max(slope.sigma, sample.shared_stretch_sigma);
    xx += change * change;
  }
  slope.left /= xx;
  slope.taken_out /= xx;
  return slope;
}

// The simulator spreads the light of each point by the blur of its place. Two textures whose power
// decreases differently are displaced by different amounts.
TEST(BlurField, SlowScalesOfACurvedFieldAreExplained) {
  for (const auto target : {model::TargetKind::kDeadLeaves, model::TargetKind::kWhiteNoise}) {
    const Slope up = SlopeOf(4, target, 3), down = SlopeOf(-4, target, 3);
    // The common error of both is that of the registrations without a curvature.
    const double left = 0.5 * (up.left - down.left);
    const double taken_out = 0.5 * (up.taken_out - down.taken_out);
    EXPECT_LT(taken_out, -0.01) << TargetKindName(target);
    // 0.28 of white noise remain, and less of other textures.
    EXPECT_LT(std::abs(left), 0.35 * std::abs(taken_out)) << TargetKindName(target);
    EXPECT_LT(std::abs(left), 2.5 * up.sigma) << TargetKindName(target);
  }
}

TEST(BlurField, TakesNothingOutOfAFlatField) {
  const Slope flat = SlopeOf(0, model::TargetKind::kDeadLeaves, 4);
  EXPECT_LT(std::abs(flat.taken_out), 4 * flat.sigma);
  EXPECT_LT(flat.sigma, 1e-3) << "0.3 mm of the zero at 300 mm";
}

}  // namespace
}  // namespace thicklens::calib
