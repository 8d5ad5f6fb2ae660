#include "thicklens/model/quantised_levels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <random>
#include <vector>

#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

const std::vector<TransferCurve>& Curves() {
  static const std::vector<TransferCurve> curves = {TransferCurve::Linear(), TransferCurve::Srgb(),
                                                    TransferCurve::Gamma(2.2),
                                                    TransferCurve::Gamma(0.45)};
  return curves;
}

// There are two ways to store the values. The first one is the definition.
void ExpectTheSame(const std::vector<float>& light, const TransferCurve& curve, int bits) {
  const LinearImage image{static_cast<int>(light.size()), 1, 1, light};
  const EncodedImage expected = ToEncoded(image, curve, bits);
  const EncodedImage stored = ToEncoded(image, QuantisedLevels(curve, bits));
  ASSERT_EQ(stored.values.size(), expected.values.size());
  EXPECT_EQ(stored.bits, bits);
  for (std::size_t i = 0; i < light.size(); ++i) {
    ASSERT_EQ(stored.values[i], expected.values[i])
        << curve.Name() << " at " << bits << " bits, light " << light[i];
  }
}

// The levels change between two floats; these are all of both sides, and their neighbours.
TEST(QuantisedLevels, ChangeWhereTheCurveRoundsToTheNext) {
  for (const TransferCurve& curve : Curves()) {
    for (const int bits : {8, 16}) {
      const double full_scale = bits == 8 ? 255 : 65535;
      std::vector<float> light;
      for (double level = 0.5; level < full_scale; ++level) {
        auto at = static_cast<float>(curve.Decode(level / full_scale));
        for (int i = 0; i < 3; ++i) at = std::nextafter(at, 0.0F);
        for (int i = 0; i < 7; ++i) {
          light.push_back(at);
          at = std::nextafter(at, 2.0F);
        }
      }
      ExpectTheSame(light, curve, bits);
    }
  }
}

TEST(QuantisedLevels, AnyLightHasItsStoredLevel) {
  std::mt19937 random(5);
  std::vector<float> light = {0,
                              -0.0F,
                              1,
                              std::nextafter(1.0F, 0.0F),
                              1.5F,
                              -0.2F,
                              kNan,
                              kInfinity,
                              -kInfinity,
                              std::numeric_limits<float>::min(),
                              std::numeric_limits<float>::denorm_min()};
  // The values are spread evenly over the octaves and, in the second distribution, over [0, 1.01].
  std::uniform_real_distribution<float> octaves(-45, 1), even(0, 1.01F);
  for (int i = 0; i < 100000; ++i) {
    light.push_back(std::exp2(octaves(random)));
    light.push_back(even(random));
  }
  for (const TransferCurve& curve : Curves()) {
    for (const int bits : {8, 16}) ExpectTheSame(light, curve, bits);
  }
}

TEST(QuantisedLevels, RefusesOtherBits) {
  EXPECT_THROW(QuantisedLevels(TransferCurve::Srgb(), 12), Error);
}

TEST(QuantisedLevels, RefusesAnImageOfTheWrongSize) {
  const LinearImage image{3, 1, 1, {0, 1}};
  EXPECT_THROW(ToEncoded(image, QuantisedLevels(TransferCurve::Srgb(), 8)), Error);
}

}  // namespace
}  // namespace thicklens::model
