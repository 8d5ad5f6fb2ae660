// The noise of stored values, found again in pictures that were made with a known one.
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

model::LinearPicture MakePicture(Texture texture, int channels) {
  model::LinearPicture picture{kSize, kSize, channels, {}};
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      double light = 0.3;
      if (texture == Texture::kSlope) light = 0.05 + 0.5 * (x + y) / (2.0 * kSize);
      if (texture == Texture::kWaves) light = 0.3 + 0.1 * std::sin(x / 4.0) * std::cos(y / 5.0);
      if (texture == Texture::kSquares) light = (x / 20 + y / 20) % 2 == 0 ? 0.1 : 0.5;
      for (int c = 0; c < channels; ++c) {
        picture.values.push_back(static_cast<float>(light * (1 - 0.2 * c)));
      }
    }
  }
  return picture;
}

// Noise in 1/255 that is found in the picture stored with noise and rounding.
double Found(const model::LinearPicture& picture, const model::TransferCurve& transfer,
             double sigma_grey_levels, int bits = 8) {
  const model::StoredPicture stored =
      model::ToStoredWithNoise(picture, transfer, bits, sigma_grey_levels / 255, 5);
  return 255 * StoredNoiseSigma(model::ToLinear(stored, transfer), transfer).value_or(-1);
}

// The variances of noise and of rounding (1/12) add. If a quarter of the blocks is without edges,
// the texture does not affect the estimate.
TEST(StoredNoise, IsFoundInManyTextures) {
  for (const Texture texture :
       {Texture::kFlat, Texture::kSlope, Texture::kWaves, Texture::kSquares}) {
    for (const int channels : {1, 3}) {
      for (const double sigma : {1.0, 2.5, 6.0}) {
        const double expected = std::sqrt(sigma * sigma + 1.0 / 12);
        EXPECT_NEAR(Found(MakePicture(texture, channels), model::TransferCurve::Srgb(), sigma),
                    expected, 0.08 * expected)
            << static_cast<int>(texture) << " " << channels;
      }
    }
  }
}

TEST(StoredNoise, IsThatOfStoredValuesForEveryCurve) {
  for (const auto& transfer : {model::TransferCurve::Linear(), model::TransferCurve::Gamma(2.2)}) {
    EXPECT_NEAR(Found(MakePicture(Texture::kSlope, 3), transfer, 3), 3.02, 0.25);
  }
}

TEST(StoredNoise, WithoutNoiseThereIsOnlyRounding) {
  // About 1/sqrt(12); a slope rounds its neighbours alike or against each other.
  EXPECT_NEAR(Found(MakePicture(Texture::kSlope, 1), model::TransferCurve::Srgb(), 0), 0.29, 0.15);
  EXPECT_LT(Found(MakePicture(Texture::kSlope, 1), model::TransferCurve::Srgb(), 0, 16), 0.01);
}

// Clipping hides noise: black and white blocks do not count.
TEST(StoredNoise, IsAbsentWhereNothingTellsIt) {
  model::LinearPicture picture = MakePicture(Texture::kFlat, 1);
  for (float& value : picture.values) value = 0.001F;
  EXPECT_FALSE(StoredNoiseSigma(picture, model::TransferCurve::Srgb()).has_value());
  for (float& value : picture.values) value = 1;
  EXPECT_FALSE(StoredNoiseSigma(picture, model::TransferCurve::Srgb()).has_value());
  const model::LinearPicture small{15, 40, 1, std::vector<float>(600, 0.3F)};
  EXPECT_FALSE(StoredNoiseSigma(small, model::TransferCurve::Srgb()).has_value());
  // Half of the picture is clipped.
  picture = MakePicture(Texture::kFlat, 1);
  for (std::size_t i = 0; i < picture.values.size() / 2; ++i) picture.values[i] = 0;
  EXPECT_NEAR(Found(picture, model::TransferCurve::Srgb(), 2), 2.02, 0.16);
}

// A quarter of the blocks decides: fine texture in the others is not taken for noise.
TEST(StoredNoise, TextureInMostBlocksIsNotNoise) {
  model::LinearPicture picture = MakePicture(Texture::kFlat, 1);
  std::mt19937 engine(2);
  std::uniform_real_distribution<float> uniform(0.1F, 0.6F);
  for (std::size_t i = 0; i < picture.values.size() * 6 / 10; ++i)
    picture.values[i] = uniform(engine);
  EXPECT_NEAR(Found(picture, model::TransferCurve::Srgb(), 1.5), 1.53, 0.15);
}

}  // namespace
}  // namespace thicklens::estimator
