#include "model/base/random_draws.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "support/sample_moments.h"

namespace thicklens::model {
namespace {

using thicklens::testing::ExpectMoments;

TEST(RandomDrawsTest, PoissonFollowsItsDistribution) {
  for (const double mean : {0.3, 4.0, 9.9, 10.1, 45.0, 700.0}) {
    RandomDraws draws(11, RandomDraws::Purpose::kSensor, 5);
    constexpr int kDraws = 200000;
    const int size = static_cast<int>(mean + 10 * std::sqrt(mean) + 20);
    std::vector<double> seen(static_cast<std::size_t>(size));
    for (int i = 0; i < kDraws; ++i) {
      const double k = draws.Poisson(mean);
      ASSERT_EQ(k, std::floor(k));
      ASSERT_GE(k, 0);
      ++seen[static_cast<std::size_t>(std::min<double>(k, size - 1))];
    }
    // Chi-square over the counts with at least 20 expected, the rest in one class.
    double chi2 = 0, rest_seen = kDraws, rest_expected = kDraws;
    int classes = 0;
    for (int k = 0; k < size; ++k) {
      const double expected = kDraws * std::exp(k * std::log(mean) - mean - std::lgamma(k + 1.0));
      if (expected < 20) continue;
      const double found = seen[static_cast<std::size_t>(k)];
      chi2 += std::pow(found - expected, 2) / expected;
      rest_seen -= found;
      rest_expected -= expected;
      ++classes;
    }
    if (rest_expected > 5) chi2 += std::pow(rest_seen - rest_expected, 2) / rest_expected;
    EXPECT_LT(chi2, classes + 4.5 * std::sqrt(2.0 * classes) + 5) << "mean " << mean;
    EXPECT_GT(chi2, classes - 4.5 * std::sqrt(2.0 * classes) - 5) << "mean " << mean;
  }
  RandomDraws draws(11, RandomDraws::Purpose::kSensor, 5);
  EXPECT_EQ(draws.Poisson(0), 0);
  EXPECT_EQ(draws.Poisson(-1), 0);
}

TEST(RandomDrawsTest, NormalHasItsMomentsAndTails) {
  RandomDraws draws(12, RandomDraws::Purpose::kSensor, 0);
  std::vector<double> values(200000);
  for (double& value : values) value = draws.Normal();
  ExpectMoments(values, 0, 1);
  double fourth = 0;
  int beyond_two = 0;
  for (const double value : values) {
    fourth += std::pow(value, 4) / 200000;
    beyond_two += std::abs(value) > 2;
  }
  EXPECT_NEAR(fourth, 3, 4.5 * std::sqrt(96.0 / 200000));
  EXPECT_NEAR(beyond_two / 200000.0, 0.0455, 0.0021);
}

}  // namespace
}  // namespace thicklens::model
