#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/model/scene.h"

namespace thicklens::model {
namespace {

constexpr int kEdgePx = 200;
constexpr std::size_t kCount = std::size_t{kEdgePx} * kEdgePx;
constexpr int kBits = 16;

LinearImage Flat(float light) { return {kEdgePx, kEdgePx, 1, std::vector<float>(kCount, light)}; }

struct Moments {
  double mean = 0, deviation = 0;  // in full scales
};

Moments MomentsOf(const EncodedImage& image) {
  double sum = 0, squares = 0;
  for (const std::uint16_t level : image.values) {
    const double value = level / image.full_scale();
    sum += value;
    squares += value * value;
  }
  const double mean = sum / static_cast<double>(image.values.size());
  return {mean, std::sqrt(squares / static_cast<double>(image.values.size()) - mean * mean)};
}

// In the dark, sRGB is 12.92 times as steep as linear light, and near white its slope is less than
// 1. Noise added to the light would differ by that factor.
TEST(ToEncodedWithNoise, AddsTheSameToDarkAndBright) {
  constexpr double kSigma = 1.0 / 255;
  for (const double stored : {0.04, 0.5, 0.95}) {
    const auto light = static_cast<float>(TransferCurve::Srgb().Decode(stored));
    const Moments moments =
        MomentsOf(ToEncodedWithNoise(Flat(light), TransferCurve::Srgb(), kBits, kSigma, 7));
    // Five standard errors of 40 000 draws.
    EXPECT_NEAR(moments.mean, stored, 5 * kSigma / kEdgePx);
    EXPECT_NEAR(moments.deviation, kSigma, 5 * kSigma / (kEdgePx * std::sqrt(2.0)));
  }
}

// Rounded once, with the noise in it: a level that a value is rounded to first would show.
TEST(ToEncodedWithNoise, RoundsAfterTheNoiseIsAdded) {
  constexpr double kLevel = 100.4;
  constexpr double kSigma = 0.3 / 255;
  const Moments moments = MomentsOf(ToEncodedWithNoise(Flat(static_cast<float>(kLevel / 255)),
                                                       TransferCurve::Linear(), 8, kSigma, 7));
  // P(level + noise >= 100.5) = P(N >= 1/3), and never beyond 101.5, so the mean is 100 + 0.3694.
  EXPECT_NEAR(moments.mean * 255, 100 + 0.36944, 5 * 0.4827 / kEdgePx);
}

TEST(ToEncodedWithNoise, WithoutNoiseIsToEncoded) {
  LinearImage image = Flat(0);
  for (std::size_t i = 0; i < kCount; ++i)
    image.values[i] = static_cast<float>(i) / kCount * 1.2F - 0.1F;
  EXPECT_EQ(ToEncodedWithNoise(image, TransferCurve::Srgb(), 8, 0, 5).values,
            ToEncoded(image, TransferCurve::Srgb(), 8).values);
}

TEST(ToEncodedWithNoise, TheSeedAloneDecides) {
  const auto drawn = [](std::uint64_t seed) {
    return ToEncodedWithNoise(Flat(0.5F), TransferCurve::Srgb(), kBits, 0.01, seed).values;
  };
  EXPECT_EQ(drawn(1), drawn(1));
  EXPECT_NE(drawn(1), drawn(2));
  EXPECT_NE(drawn(1), drawn(1 + (std::uint64_t{1} << 32)));
}

TEST(ToEncodedWithNoise, StaysWithinTheScaleAndRefusesNonsense) {
  const EncodedImage dark = ToEncodedWithNoise(Flat(0), TransferCurve::Srgb(), 8, 0.1, 1);
  EXPECT_NEAR(MomentsOf(dark).mean, 0.1 * std::sqrt(1 / (2 * M_PI)), 0.002);  // half is cut off
  EXPECT_THROW(ToEncodedWithNoise(Flat(0), TransferCurve::Srgb(), 8, -1, 1), Error);
  EXPECT_THROW(ToEncodedWithNoise(Flat(0), TransferCurve::Srgb(), 8, std::nan(""), 1), Error);
  EXPECT_THROW(ToEncodedWithNoise(Flat(0), TransferCurve::Srgb(), 12, 0.1, 1), Error);
}

}  // namespace
}  // namespace thicklens::model
