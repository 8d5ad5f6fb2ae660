#include "thicklens/model/encoded_values.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "support/error_message.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;
using thicklens::testing::ErrorOf;

TEST(EncodedValuesOf, DividesByFullScaleAndLeavesAlphaOut) {
  const EncodedValues narrow = EncodedValuesOf(EncodedImage{1, 1, 4, 8, {255, 51, 0, 7}});
  EXPECT_EQ(narrow.channels, 3);
  EXPECT_THAT(narrow.values, ::testing::ElementsAre(1.0F, 0.2F, 0.0F));
  const EncodedValues wide = EncodedValuesOf(EncodedImage{2, 1, 1, 16, {65535, 13107}});
  EXPECT_THAT(wide.values, ::testing::ElementsAre(1.0F, 0.2F));
  EXPECT_THAT(ErrorOf([] {
                EncodedValuesOf(EncodedImage{1, 1, 2, 8, {1, 2}});
              }),
              HasSubstr("2 channels"));
}

TEST(EncodedValuesOf, EncodesAndClipsWithoutRounding) {
  const LinearImage light{4, 1, 1, {-0.5F, 0.25F, 0.3F, 7.0F}};
  const EncodedValues stored = EncodedValuesOf(light, TransferCurve::Gamma(2));
  EXPECT_EQ(stored.values[0], 0);
  EXPECT_NEAR(stored.values[1], 0.5, 1e-7);
  EXPECT_NEAR(stored.values[2], std::sqrt(0.3), 1e-7);
  EXPECT_EQ(stored.values[3], 1);
  const LinearImage broken{1, 1, 1, {std::numeric_limits<float>::quiet_NaN()}};
  EXPECT_THAT(ErrorOf([&] { EncodedValuesOf(broken, TransferCurve::Srgb()); }), HasSubstr("NaN"));
}

}  // namespace
}  // namespace thicklens::model
