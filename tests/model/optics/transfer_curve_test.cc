#include "thicklens/model/transfer_curve.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "support/error_message.h"
#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

TEST(TransferCurve, NamesRoundTrip) {
  for (const char* name : {"linear", "srgb", "gamma-2.2", "gamma-2.19921875", "gamma-1.8"}) {
    EXPECT_EQ(TransferCurve::FromName(name).Name(), name);
  }
  EXPECT_EQ(TransferCurve::FromName("linear"), TransferCurve::Linear());
  EXPECT_EQ(TransferCurve::FromName("srgb"), TransferCurve::Srgb());
  EXPECT_EQ(TransferCurve::FromName("gamma-2.2"), TransferCurve::Gamma(2.2));
  EXPECT_EQ(TransferCurve(), TransferCurve::Srgb());
  EXPECT_FALSE(TransferCurve::Gamma(2.2) == TransferCurve::Gamma(1.8));
}

TEST(TransferCurve, UnknownNameListsThePossibleOnes) {
  for (const char* name : {"", "sRGB", "gamma", "gamma-", "gamma-2.2x", "rec709", "gamma-0",
                           "gamma--2", "gamma-nan", "gamma-11", "gamma-2,2"}) {
    try {
      TransferCurve::FromName(name);
      ADD_FAILURE() << name;
    } catch (const Error& error) {
      const std::string message = error.what();
      for (const char* known : {"linear", "srgb", "gamma-2.2"}) {
        EXPECT_NE(message.find(known), std::string::npos) << message;
      }
    }
  }
}

TEST(TransferCurve, AnExponentIsFiniteAndPositive) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const double gamma : {0.0, -1.0, kInfinity, std::numeric_limits<double>::quiet_NaN()}) {
    const std::string message = testing::ErrorOf([gamma] { TransferCurve::Gamma(gamma); });
    EXPECT_EQ(message.rfind("gamma: a finite number > 0 is expected, found ", 0), 0U) << message;
  }
  EXPECT_EQ(testing::ErrorOf([] { TransferCurve::Gamma(-1.5); }),
            "gamma: a finite number > 0 is expected, found -1.5");
}

// Tabulated values of the standard, computed elsewhere.
TEST(TransferCurve, KnownValues) {
  EXPECT_NEAR(TransferCurve::Srgb().Decode(0.5), 0.21404114, 1e-8);
  EXPECT_NEAR(TransferCurve::Srgb().Decode(128.0 / 255), 0.21586050, 1e-8);
  EXPECT_NEAR(TransferCurve::Srgb().Encode(0.18), 0.46135613, 1e-7);
  EXPECT_NEAR(TransferCurve::Srgb().Encode(0.002), 0.02584, 1e-12);
  EXPECT_NEAR(TransferCurve::Gamma(2.2).Decode(0.5), 0.21763764, 1e-8);
  EXPECT_EQ(TransferCurve::Linear().Encode(0.3), 0.3);
  EXPECT_EQ(TransferCurve::Linear().Decode(-7), -7);
  for (const TransferCurve& curve :
       {TransferCurve::Linear(), TransferCurve::Srgb(), TransferCurve::Gamma(2.2)}) {
    EXPECT_EQ(curve.Encode(0), 0);
    EXPECT_EQ(curve.Decode(0), 0);
    EXPECT_NEAR(curve.Encode(1), 1, 1e-15);
    EXPECT_NEAR(curve.Decode(1), 1, 1e-15);
  }
}

TEST(TransferCurve, EncodeAndDecodeAreInverseAndOdd) {
  for (const TransferCurve& curve :
       {TransferCurve::Linear(), TransferCurve::Srgb(), TransferCurve::Gamma(2.2)}) {
    SCOPED_TRACE(curve.Name());
    double last = -std::numeric_limits<double>::infinity();
    for (int i = -2000; i <= 2000; ++i) {
      const double light = i / 1000.0;
      const double stored = curve.Encode(light);
      // The two pieces of the standard meet to 1e-7 only.
      EXPECT_NEAR(curve.Decode(stored), light, 1e-7);
      EXPECT_EQ(curve.Encode(-light), -stored);
      EXPECT_EQ(curve.Decode(-light), -curve.Decode(light));
      EXPECT_GT(stored, last);
      last = stored;
    }
    EXPECT_TRUE(std::isnan(curve.Encode(std::nan(""))));
  }
}

}  // namespace
}  // namespace thicklens::model
