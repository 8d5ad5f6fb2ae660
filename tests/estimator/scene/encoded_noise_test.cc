// The noise of encoded values, found again in images that were made with a known one.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <optional>
#include <random>

#include "thicklens/estimator/scene_solver.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::estimator {
namespace {

constexpr int kSize = 160;

enum class Texture { kFlat, kSlope, kWaves, kSquares };

model::LinearImage MakeImage(Texture texture, int channels) {
  model::LinearImage image{kSize, kSize, channels, {}};
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      double light = 0.3;
      if (texture == Texture::kSlope) light = 0.05 + 0.5 * (x + y) / (2.0 * kSize);
      if (texture == Texture::kWaves) light = 0.3 + 0.1 * std::sin(x / 4.0) * std::cos(y / 5.0);
      if (texture == Texture::kSquares) light = (x / 20 + y / 20) % 2 == 0 ? 0.1 : 0.5;
      for (int c = 0; c < channels; ++c) {
        image.values.push_back(static_cast<float>(light * (1 - 0.2 * c)));
      }
    }
  }
  return image;
}

// Noise in 1/255 that is found in the image stored with noise and rounding.
double Found(const model::LinearImage& image, const model::TransferCurve& transfer,
             double sigma_grey_levels, int bits = 8) {
  const model::EncodedImage stored =
      model::ToEncodedWithNoise(image, transfer, bits, sigma_grey_levels / 255, 5);
  return 255 * EncodedNoiseSigma(model::ToLinear(stored, transfer), transfer).value_or(-1);
}

// The variances of noise and of rounding (1/12) add. If a quarter of the blocks is without edges,
// the texture does not affect the estimate.
TEST(EncodedNoise, IsFoundInManyTextures) {
  for (const Texture texture :
       {Texture::kFlat, Texture::kSlope, Texture::kWaves, Texture::kSquares}) {
    for (const int channels : {1, 3}) {
      for (const double sigma : {1.0, 2.5, 6.0}) {
        const double expected = std::sqrt(sigma * sigma + 1.0 / 12);
        EXPECT_NEAR(Found(MakeImage(texture, channels), model::TransferCurve::Srgb(), sigma),
                    expected, 0.08 * expected)
            << static_cast<int>(texture) << " " << channels;
      }
    }
  }
}

TEST(EncodedNoise, IsThatOfEncodedValuesForEveryCurve) {
  for (const auto& transfer : {model::TransferCurve::Linear(), model::TransferCurve::Gamma(2.2)}) {
    EXPECT_NEAR(Found(MakeImage(Texture::kSlope, 3), transfer, 3), 3.02, 0.25);
  }
}

TEST(EncodedNoise, WithoutNoiseThereIsOnlyRounding) {
  // About 1/sqrt(12); a slope rounds its neighbours alike or against each other.
  EXPECT_NEAR(Found(MakeImage(Texture::kSlope, 1), model::TransferCurve::Srgb(), 0), 0.29, 0.15);
  EXPECT_LT(Found(MakeImage(Texture::kSlope, 1), model::TransferCurve::Srgb(), 0, 16), 0.01);
}

// Clipping hides noise: black and white blocks do not count.
TEST(EncodedNoise, IsAbsentWhereNothingTellsIt) {
  model::LinearImage image = MakeImage(Texture::kFlat, 1);
  for (float& value : image.values) value = 0.001F;
  EXPECT_FALSE(EncodedNoiseSigma(image, model::TransferCurve::Srgb()).has_value());
  for (float& value : image.values) value = 1;
  EXPECT_FALSE(EncodedNoiseSigma(image, model::TransferCurve::Srgb()).has_value());
  const model::LinearImage small{15, 40, 1, std::vector<float>(600, 0.3F)};
  EXPECT_FALSE(EncodedNoiseSigma(small, model::TransferCurve::Srgb()).has_value());
  // Half of the image is clipped.
  image = MakeImage(Texture::kFlat, 1);
  for (std::size_t i = 0; i < image.values.size() / 2; ++i) image.values[i] = 0;
  EXPECT_NEAR(Found(image, model::TransferCurve::Srgb(), 2), 2.02, 0.16);
}

// A quarter of the blocks decides: fine texture in the others is not taken for noise.
TEST(EncodedNoise, TextureInMostBlocksIsNotNoise) {
  model::LinearImage image = MakeImage(Texture::kFlat, 1);
  std::mt19937 engine(2);
  std::uniform_real_distribution<float> uniform(0.1F, 0.6F);
  for (std::size_t i = 0; i < image.values.size() * 6 / 10; ++i) image.values[i] = uniform(engine);
  EXPECT_NEAR(Found(image, model::TransferCurve::Srgb(), 1.5), 1.53, 0.15);
}

}  // namespace
}  // namespace thicklens::estimator
