#include "thicklens/estimator/falloff_evidence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <random>
#include <string>
#include <vector>

#include "estimator/views/ray_irradiance.h"
#include "support/error_message.h"
#include "support/test_cameras.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::estimator {
namespace {

using ::testing::HasSubstr;
using thicklens::testing::ErrorOf;
using Verdict = FalloffEvidence::Verdict;

constexpr int kW = 80, kH = 60;
constexpr double kPi = 3.14159265358979323846;

// A camera whose corners are `half_diagonal_mm` from the axis, 5.8 mm behind the aperture.
EstimateInput InputOf(double half_diagonal_mm) {
  EstimateInput input;
  model::ThickLens lens;
  lens.front_focal_length_mm = lens.rear_focal_length_mm = 5.7;
  lens.lens_thickness_mm = 0;
  lens.aperture_radius_mm = 0.3;
  model::Sensor sensor;
  sensor.width_px = kW;
  sensor.height_px = kH;
  sensor.pixel_pitch_mm = half_diagonal_mm / std::hypot(kW / 2.0, kH / 2.0);
  sensor.principal_point_px = {(kW - 1) / 2.0, (kH - 1) / 2.0};
  const model::Camera camera =
      thicklens::testing::TestCamera("wide", lens, sensor, {5.8, 0.001}, {0.5, 0.001});
  input.weights = model::ApertureWeights(model::ApertureShape::kGaussian, 3, 3);
  input.camera = camera;
  input.grid = model::GridOnPlanes(
      camera, {0, camera.focus_depth_mm()},
      model::SampleAperture(input.weights, camera.blur_ratio(), camera.lens.aperture_radius_mm));
  input.image = {kW, kH, 1, {}};
  input.disparity = {kW, kH, std::vector<float>(kW * kH, 0.0F), {1, 1}};
  return input;
}

// The logarithm of the light of a scene: a sum of cosine waves whose power falls with
// |f|^-exponent.
std::vector<double> RandomScene(double spread, double exponent, unsigned seed) {
  std::vector<double> scene(kW * kH, 0.0);
  std::mt19937 engine(seed);
  std::normal_distribution<double> normal(0, 1);
  double variance = 0;
  constexpr int kModes = 14;
  const auto waves = [](int mode, int count) {
    std::vector<double> wave;
    for (int x = 0; x < count; ++x) wave.push_back(std::cos(kPi * mode * (x + 0.5) / count));
    return wave;
  };
  for (int j = 0; j < kModes; ++j) {
    const std::vector<double> down = waves(j, kH);
    for (int i = 0; i < kModes; ++i) {
      const std::vector<double> across = waves(i, kW);
      const double frequency = std::hypot(1.0 * i, 1.0 * j * kW / kH);
      const double amplitude = normal(engine);
      if (i + j == 0) continue;
      const double size = std::pow(frequency, -exponent / 2);
      variance += size * size / (i == 0 || j == 0 ? 2 : 4);
      for (int y = 0; y < kH; ++y) {
        for (int x = 0; x < kW; ++x) {
          scene[static_cast<std::size_t>(y * kW + x)] += amplitude * size *
                                                         across[static_cast<std::size_t>(x)] *
                                                         down[static_cast<std::size_t>(y)];
        }
      }
    }
  }
  for (double& value : scene) value *= spread / std::sqrt(variance);
  return scene;
}

// The photograph of the scene, with a power of the camera's fall-off.
void Take(const std::vector<double>& scene, double power, EstimateInput* input) {
  const std::vector<float> falloff =
      FalloffOfImage(*input->grid, *input->camera, input->weights, kW, kH);
  input->image.values.clear();
  for (std::size_t i = 0; i < scene.size(); ++i) {
    input->image.values.push_back(static_cast<float>(
        0.3 * std::exp(scene[i]) * std::pow(static_cast<double>(falloff[i]), power)));
  }
}

TEST(FalloffEvidence, KnowsItsErrorOverManyScenes) {
  EstimateInput input = InputOf(5);
  for (const double exponent : {1.8, 3.0}) {
    for (const double power : {0.0, 1.0}) {
      double squares = 0, normalised = 0, sigmas = 0;
      constexpr int kScenes = 20;
      int wrong = 0;
      for (int i = 0; i < kScenes; ++i) {
        Take(RandomScene(0.3, exponent, static_cast<unsigned>(i)), power, &input);
        const FalloffEvidence evidence = TestFalloff(input, 1);
        squares += std::pow(evidence.share - power, 2);
        normalised += std::pow((evidence.share - power) / evidence.sigma, 2);
        sigmas += evidence.sigma * evidence.sigma;
        wrong += evidence.verdict == (power == 0 ? Verdict::kShown : Verdict::kNotShown) ? 1 : 0;
      }
      // The stated error is that of the scatter, or a little above it.
      EXPECT_LT(normalised / kScenes, 1.7) << exponent << ", " << power;
      EXPECT_GT(normalised / kScenes, 0.3) << exponent << ", " << power;
      EXPECT_LE(wrong, 1) << exponent << ", " << power;
      EXPECT_GT(squares, 0);
    }
  }
}

TEST(FalloffEvidence, DecidesWhereTheSceneIsEven) {
  EstimateInput input = InputOf(5);
  for (unsigned seed = 0; seed < 4; ++seed) {
    const std::vector<double> scene = RandomScene(0.05, 2, seed);
    Take(scene, 1, &input);
    const FalloffEvidence shown = TestFalloff(input, 1);
    EXPECT_EQ(shown.verdict, Verdict::kShown) << shown.message;
    EXPECT_NEAR(shown.share, 1, 4 * shown.sigma);
    EXPECT_NEAR(1 / shown.darkest, 3, 0.2);  // (1 + (5/5.8)^2)^2 at the corner
    Take(scene, 0, &input);
    const FalloffEvidence corrected = TestFalloff(input, 1);
    EXPECT_EQ(corrected.verdict, Verdict::kNotShown) << corrected.message;
    EXPECT_THAT(corrected.message, HasSubstr("it was corrected"));
    Take(scene, 0.5, &input);
    EXPECT_EQ(TestFalloff(input, 1).verdict, Verdict::kUndecided);
    EXPECT_THAT(TestFalloff(input, 1).message, HasSubstr("neither all of it nor none"));
  }
}

TEST(FalloffEvidence, IsUndecidedWhereTheSceneHidesIt) {
  EstimateInput input = InputOf(2);  // corners a quarter darker
  int undecided = 0;
  for (unsigned seed = 0; seed < 12; ++seed) {
    Take(RandomScene(0.5, 2.4, seed), seed % 2, &input);
    undecided += TestFalloff(input, 1).verdict == Verdict::kUndecided ? 1 : 0;
  }
  EXPECT_GE(undecided, 11);
}

TEST(FalloffEvidence, OfLessThanATenthIsNotLookedFor) {
  EstimateInput input = InputOf(1);
  Take(RandomScene(0.01, 2, 1), 1, &input);
  EXPECT_EQ(TestFalloff(input, 1).verdict, Verdict::kUndecided);
  EXPECT_THAT(TestFalloff(input, 1).message, HasSubstr("too small"));
}

TEST(FalloffEvidence, LeavesOutClippedAndBlackParts) {
  EstimateInput input = InputOf(5);
  Take(RandomScene(0.05, 2, 3), 1, &input);
  // A bright window in one corner, clipped, and a black border below.
  input.clipped.assign(input.image.values.size(), 0);
  for (int y = 0; y < kH; ++y) {
    for (int x = 0; x < kW; ++x) {
      const auto i = static_cast<std::size_t>(y * kW + x);
      if (x > 55 && y < 20) {
        input.image.values[i] = 1;
        input.clipped[i] = 1;
      }
      if (y >= 54) input.image.values[i] = 0.0005F;
    }
  }
  const FalloffEvidence evidence = TestFalloff(input, 1);
  EXPECT_EQ(evidence.verdict, Verdict::kShown) << evidence.message;
  EXPECT_LT(evidence.blocks, 12 * 9 - 20);
  std::fill(input.clipped.begin(), input.clipped.end(), std::uint8_t{1});
  EXPECT_EQ(TestFalloff(input, 1).verdict, Verdict::kUndecided);
  EXPECT_THAT(TestFalloff(input, 1).message, HasSubstr("neither clipped nor black"));
}

TEST(FalloffEvidence, DoesNotDependOnThreadsOrExposure) {
  EstimateInput input = InputOf(4);
  Take(RandomScene(0.2, 2, 9), 1, &input);
  const FalloffEvidence one = TestFalloff(input, 1), two = TestFalloff(input, 2);
  EXPECT_EQ(one.share, two.share);
  EXPECT_EQ(one.sigma, two.sigma);
  for (float& value : input.image.values) value *= 0.25F;
  EXPECT_NEAR(TestFalloff(input, 1).share, one.share, 1e-5);
  input.camera.reset();
  input.grid.reset();
  EXPECT_THAT(ErrorOf([&] { TestFalloff(input, 1); }), HasSubstr("no camera"));
}

}  // namespace
}  // namespace thicklens::estimator
