#ifndef THICKLENS_TESTS_SUPPORT_SAMPLE_MOMENTS_H_
#define THICKLENS_TESTS_SUPPORT_SAMPLE_MOMENTS_H_

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace thicklens::testing {

// Mean and unbiased variance of a sample.
struct Moments {
  double mean = 0;
  double variance = 0;
};
inline Moments MomentsOf(const std::vector<double>& values) {
  Moments moments;
  for (const double value : values) moments.mean += value / static_cast<double>(values.size());
  for (const double value : values) {
    moments.variance += std::pow(value - moments.mean, 2) / static_cast<double>(values.size() - 1);
  }
  return moments;
}

// Expects that the moments of n normal draws differ from the true ones by at most 4.5 of their own
// standard deviations.
inline void ExpectMoments(const std::vector<double>& values, double mean, double variance) {
  const auto n = static_cast<double>(values.size());
  const Moments found = MomentsOf(values);
  EXPECT_NEAR(found.mean, mean, 4.5 * std::sqrt(variance / n));
  EXPECT_NEAR(found.variance / variance, 1, 4.5 * std::sqrt(2 / n));
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_SUPPORT_SAMPLE_MOMENTS_H_
