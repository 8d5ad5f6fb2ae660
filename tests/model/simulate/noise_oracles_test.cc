// Noise of simulated images against its model, value by value: electrons of a Poisson
// distribution, a Gaussian of the reading, the transfer curve, rounding.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "support/blur_oracles.h"
#include "support/macro_scene.h"
#include "thicklens/model/scene_simulator.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::model {
namespace {

using thicklens::testing::GaussianShare;
using thicklens::testing::MacroScene;

struct Sensitivity {
  double full_well = 0, read_noise = 0;  // electrons; no full well: no noise of electrons
  double encoded_sigma = 0;              // of encoded values, in full scales
};

// Share of encoded values below `value` + 1/2, of 255, for one linear light.
double ShareUpTo(int value, double light, const Sensitivity& sensor, const TransferCurve& curve) {
  if (value >= 255) return 1;
  if (sensor.encoded_sigma > 0) {
    return GaussianShare((value + 0.5) / 255 - curve.Encode(light), sensor.encoded_sigma);
  }
  const double limit = sensor.full_well * curve.Decode((value + 0.5) / 255);  // electrons
  const double mean = sensor.full_well * light;
  double share = 0;
  const double reach = 9 * std::sqrt(mean) + 9;
  for (double k = std::max(0.0, std::floor(mean - reach)); k <= mean + reach; ++k) {
    share += std::exp(k * std::log(mean) - mean - std::lgamma(k + 1)) *
             (sensor.read_noise > 0 ? GaussianShare(limit - k, sensor.read_noise)
                                    : (k <= limit ? 1.0 : 0.0));
  }
  return share;
}

// Chi-square of encoded values over the classes in which at least 20 are expected, the rest in one:
// within 4.5 of its own standard deviations.
void ExpectDistribution(const std::vector<std::uint16_t>& values, double light,
                        const Sensitivity& sensor, const TransferCurve& curve) {
  std::vector<double> seen(256);
  for (const std::uint16_t value : values) ++seen[value];
  const auto count = static_cast<double>(values.size());
  double chi2 = 0, rest_seen = count, rest_expected = count, below = 0;
  int classes = 0;
  for (int value = 0; value < 256; ++value) {
    const double up_to = ShareUpTo(value, light, sensor, curve);
    const double expected = count * (up_to - below);
    below = up_to;
    if (expected < 20) continue;
    const double found = seen[static_cast<std::size_t>(value)];
    chi2 += std::pow(found - expected, 2) / expected;
    rest_seen -= found;
    rest_expected -= expected;
    ++classes;
  }
  if (rest_expected > 5) chi2 += std::pow(rest_seen - rest_expected, 2) / rest_expected;
  EXPECT_GE(classes, 3);
  EXPECT_LT(chi2, classes + 4.5 * std::sqrt(2.0 * classes) + 5) << classes << " classes";
  EXPECT_GT(chi2, classes - 4.5 * std::sqrt(2.0 * classes) - 5) << classes << " classes";
}

// The first is prime: no number of electrons lies halfway between two encoded values.
const std::vector<Sensitivity> kSensors = {{907, 0, 0}, {907, 7, 0}, {6000, 20, 0}, {0, 0, 0.012}};

TEST(NoiseOraclesTest, EncodedImagesOfScenesFollowTheirDistribution) {
  for (const TransferCurve& curve : {TransferCurve::Linear(), TransferCurve::Srgb()}) {
    for (const Sensitivity& sensor : kSensors) {
      for (const double light : {0.03, 0.4, 0.97}) {  // the last is cut off at full scale
        SCOPED_TRACE(curve.Name() + ", " + std::to_string(sensor.full_well) + " electrons, light " +
                     std::to_string(light));
        SceneSimulationOptions options = MacroScene::Options(
            MacroScene::Camera(16, 16, Psf::kGaussian), {MacroScene::Uniform(300, 0.5)},
            {Effect::kShotNoise, Effect::kReadNoise, Effect::kQuantisation, Effect::kTransferCurve},
            16);
        options.camera.sensor.transfer = curve;
        options.full_well_electrons = sensor.full_well;
        options.read_noise_electrons = sensor.read_noise;
        options.noise_sigma_grey_levels = 255 * sensor.encoded_sigma;
        const LinearImage flat{200, 200, 3, std::vector<float>(120000, static_cast<float>(light))};
        ExpectDistribution(SceneSimulator(options, {}).Store(flat).values, light, sensor, curve);
      }
    }
  }
}

// The right half of a frame of an edge is flat: level (1 + contrast).
TEST(NoiseOraclesTest, FramesOfSweepsFollowTheirDistribution) {
  for (const TransferCurve& curve : {TransferCurve::Linear(), TransferCurve::Gamma(2.2)}) {
    for (const Sensitivity& sensor : kSensors) {
      if (sensor.encoded_sigma > 0) continue;  // sweeps have none
      for (const double level : {0.05, 0.5}) {
        SCOPED_TRACE(curve.Name() + ", " + std::to_string(sensor.full_well) + " electrons, level " +
                     std::to_string(level));
        SweepSimulationOptions options;
        options.camera = MacroScene::Camera(400, 400, Psf::kGaussian);
        options.camera.sensor.transfer = curve;
        options.target.kind = TargetKind::kKnifeEdge;
        options.target.contrast = 0.5;
        options.target.edge_angle_deg = 0;
        options.first_depth_mm = MacroScene::kFocusMm;
        options.frame_count = 1;
        options.light_level = level;
        options.full_well_electrons = sensor.full_well;
        options.read_noise_electrons = sensor.read_noise;
        options.effects.without = {Effect::kFalloff};
        const SweepSimulator simulator(options, {});
        EXPECT_NEAR(simulator.RenderNoiseless(0).at(204, 100, 0), 1.5 * level, 1e-6);
        const EncodedImage frame = simulator.RenderFrame(0);
        std::vector<std::uint16_t> flat;
        for (std::size_t i = 0; i < frame.values.size(); ++i) {
          if (i % 400 > 203) flat.push_back(frame.values[i]);
        }
        ExpectDistribution(flat, 1.5 * level, sensor, curve);
      }
    }
  }
}

}  // namespace
}  // namespace thicklens::model
