#include "calib/spectrum/texture_spectrum.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <opencv2/core.hpp>
#include <vector>

#include "calib/spectrum/frame_spectrum.h"
#include "support/error_message.h"
#include "tests/calib/simulated_sweep.h"

namespace thicklens::calib {
namespace {

using thicklens::testing::SweepCase;

constexpr double kPi = 3.14159265358979323846;

Texture Leaves() { return {model::TargetKind::kDeadLeaves, 0.6, 0.2, 30}; }

// The integral of a density over all frequencies, by its own sum in steps of the logarithm.
double Integral(const TextureSpectrum& spectrum, double lowest, double highest) {
  constexpr int kSteps = 4000;
  const double step = std::log(highest / lowest) / kSteps;
  double sum = spectrum.DensityMm2(lowest) * kPi * lowest * lowest;
  for (int i = 0; i < kSteps; ++i) {
    const double f = lowest * std::exp((i + 0.5) * step);
    sum += spectrum.DensityMm2(f) * 2 * kPi * f * f * step;
  }
  return sum;
}

TEST(TextureSpectrum, IntegralIsTheVarianceOfTheLight) {
  // Grey of a leaf: uniform within the contrast, of variance contrast^2/3.
  EXPECT_NEAR(Integral(TextureSpectrum(Leaves()), 1e-4, 200) / (0.36 / 3), 1, 0.03);
  Texture noise = {model::TargetKind::kWhiteNoise, 0.2, 0.3, 30};
  // A tenth of the standard deviation: the limit of tanh matters by 2 %.
  EXPECT_NEAR(Integral(TextureSpectrum(noise), 1e-4, 1 / 0.3) / 0.01, 0.98, 0.01);
  noise.kind = model::TargetKind::kPinkNoise;
  EXPECT_NEAR(Integral(TextureSpectrum(noise), 1e-4, 1 / 0.3) / 0.01, 0.98, 0.01);
  EXPECT_EQ(TextureSpectrum(noise).DensityMm2(1.01 / 0.3), 0);
}

// At large frequencies only the edges of the leaves count: the power falls as the third power.
TEST(TextureSpectrum, OfLeavesFallsAsThatOfEdges) {
  const TextureSpectrum spectrum(Leaves());
  EXPECT_NEAR(std::log2(spectrum.DensityMm2(20) / spectrum.DensityMm2(40)), 3, 0.3);
}

TEST(TextureSpectrum, IsInProportionToTheSquareOfTheContrast) {
  Texture twice = Leaves();
  twice.contrast = 0.3;
  for (const double f : {0.05, 0.5, 3.0}) {
    EXPECT_NEAR(TextureSpectrum(Leaves()).DensityMm2(f) / TextureSpectrum(twice).DensityMm2(f), 4,
                1e-9);
  }
}

// The simulator draws the textures; its frames without noise are the oracle.
TEST(TextureSpectrum, IsThatOfSimulatedTargets) {
  for (const model::TargetKind kind :
       {model::TargetKind::kDeadLeaves, model::TargetKind::kWhiteNoise,
        model::TargetKind::kPinkNoise}) {
    SCOPED_TRACE(model::TargetKindName(kind));
    constexpr int kSizePx = 192;
    constexpr double kFeaturePx = 3;
    model::SweepSimulationOptions options = SweepCase("iii", kSizePx, 1);
    options.camera.calibration->blur_floor_px = model::Estimate{0.01, 0};
    options.target.kind = kind;
    const double zf = options.camera.focus_depth_mm();
    const double f1 = options.camera.lens.front_focal_length_mm;
    const double px_mm = options.camera.sensor.pixel_pitch_mm * (zf - f1) / f1;
    options.target.feature_size_mm = kFeaturePx * px_mm;
    options.first_depth_mm = zf;
    options.step_mm = 1e-3;
    options.frame_count = 1;
    const TextureSpectrum spectrum(
        {kind, options.target.contrast, options.target.feature_size_mm, kSizePx * px_mm});
    constexpr int kRings = 4, kSeeds = 10;
    std::vector<double> measured(kRings, 0), expected(kRings, 0);
    const TargetWindow window{{0, 0}, {180, 180}};
    const std::vector<Mode> modes = ModesBetween(window, 0.03, 0.3);
    for (int seed = 1; seed <= kSeeds; ++seed) {
      options.seed = static_cast<std::uint64_t>(seed);
      const model::LinearImage light = model::SweepSimulator(options, {}).RenderNoiseless(0);
      const cv::Mat grey(light.height_px, light.width_px, CV_32F,
                         const_cast<float*>(light.values.data()));  // NOLINT: only read
      const auto found =
          MeasureSpectrum(grey, {95.5, 95.5}, FramePlace(), window, modes, modes.size());
      ASSERT_TRUE(found);
      for (std::size_t k = 0; k < modes.size(); ++k) {
        const double nu = ModeFrequency(modes[k], window).norm();
        const auto ring = static_cast<std::size_t>(
            std::min(kRings - 1.0, std::log(nu / 0.03) / std::log(10.0) * kRings));
        measured[ring] += std::norm(found->values[static_cast<Eigen::Index>(k)]);
        expected[ring] += spectrum.DensityMm2(nu / px_mm) / (px_mm * px_mm) * 2.25 / (180 * 180);
      }
    }
    // Few large leaves, or few long waves, hold most of the variance: the power of a field varies
    // by a quarter from texture to texture, that of white noise by the number of modes alone.
    const double within = kind == model::TargetKind::kWhiteNoise ? 0.1 : 0.24;
    for (int ring = 0; ring < kRings; ++ring) {
      const auto r = static_cast<std::size_t>(ring);
      EXPECT_NEAR(measured[r] / expected[r], 1, ring == 0 ? 0.35 : within) << "ring " << ring;
    }
  }
}

TEST(TextureSpectrum, RefusesTargetsWithoutARandomTexture) {
  EXPECT_FALSE(HasSpectrum(model::TargetKind::kCheckerboard));
  EXPECT_TRUE(HasSpectrum(model::TargetKind::kPinkNoise));
  EXPECT_THROW(TextureSpectrum({model::TargetKind::kKnifeEdge, 0.6, 0.2, 30}), Error);
  EXPECT_THROW(TextureSpectrum({model::TargetKind::kDeadLeaves, 0.6, 0, 30}), Error);
}

}  // namespace
}  // namespace thicklens::calib
