#include "calib/edges/edge_profile.h"

#include <gtest/gtest.h>

#include <cmath>
#include <tuple>

namespace thicklens::calib {
namespace {

constexpr double kPi = 3.14159265358979323846;

// The step blurred by a Gaussian and averaged over the box of the pixel and over the disc, computed
// as plain midpoint sums. The positions in the disc, projected on the normal, have a semicircle
// distribution.
double PlainLevel(double distance_px, double angle_rad, double gaussian_sigma_px,
                  double radius_px) {
  constexpr int kBox = 24, kDisc = 200;
  double sum = 0, weights = 0;
  for (int k = 0; k < (radius_px > 0 ? kDisc : 1); ++k) {
    const double phi = kPi * (k + 0.5) / kDisc;
    const double weight = radius_px > 0 ? std::pow(std::sin(phi), 2) : 1;
    const double centre = distance_px + (radius_px > 0 ? radius_px * std::cos(phi) : 0);
    double box = 0;
    for (int i = 0; i < kBox; ++i) {
      for (int j = 0; j < kBox; ++j) {
        const double d = centre + ((i + 0.5) / kBox - 0.5) * std::cos(angle_rad) +
                         ((j + 0.5) / kBox - 0.5) * std::sin(angle_rad);
        box += 0.5 * std::erfc(-d / (std::sqrt(2) * gaussian_sigma_px));
      }
    }
    sum += weight * box / (kBox * kBox);
    weights += weight;
  }
  return sum / weights;
}

class EdgeProfileOf : public ::testing::TestWithParam<std::tuple<double, double>> {};

TEST_P(EdgeProfileOf, GaussianIsThePlainAverage) {
  const auto [angle_rad, sigma_px] = GetParam();
  const EdgeProfile profile(model::Psf::kGaussian, sigma_px * sigma_px, 0, angle_rad);
  for (const double d : {-7.3, -2.0, -0.61, -0.2, 0.0, 0.35, 1.1, 4.9}) {
    EXPECT_NEAR(profile.At(d).level, PlainLevel(d, angle_rad, sigma_px, 0), 3e-4) << d;
  }
}

TEST_P(EdgeProfileOf, DiscIsThePlainAverageWithTheFloorInsideItsVariance) {
  const auto [angle_rad, sigma_px] = GetParam();
  const double floor_px = 0.3;
  const double radius_px = 2 * std::sqrt(sigma_px * sigma_px - floor_px * floor_px);
  const EdgeProfile profile(model::Psf::kDisc, sigma_px * sigma_px, floor_px, angle_rad);
  for (const double d : {-7.3, -2.0, -0.61, 0.0, 0.35, 1.1, 4.9}) {
    EXPECT_NEAR(profile.At(d).level, PlainLevel(d, angle_rad, floor_px, radius_px), 4e-4) << d;
  }
}

TEST_P(EdgeProfileOf, DerivativesAreDifferencesOfLevels) {
  const auto [angle_rad, sigma_px] = GetParam();
  for (const model::Psf psf : {model::Psf::kGaussian, model::Psf::kDisc}) {
    const double variance_px2 = sigma_px * sigma_px, step = 1e-3 * variance_px2;
    const EdgeProfile profile(psf, variance_px2, 0.3, angle_rad);
    const EdgeProfile less(psf, variance_px2 - step, 0.3, angle_rad);
    const EdgeProfile more(psf, variance_px2 + step, 0.3, angle_rad);
    for (const double d : {-3.1, -0.7, 0.1, 0.6, 1.9}) {
      EXPECT_NEAR(profile.At(d).slope,
                  (profile.At(d + 1e-3).level - profile.At(d - 1e-3).level) / 2e-3, 6e-3)
          << d;
      EXPECT_NEAR(profile.At(d).per_variance, (more.At(d).level - less.At(d).level) / (2 * step),
                  6e-3)
          << d;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(AnglesAndBlurs, EdgeProfileOf,
                         ::testing::Combine(::testing::Values(0.0, 1e-5, 0.09, kPi / 4, kPi / 2,
                                                              -2.8),
                                            ::testing::Values(0.4, 1.0, 5.0)));

TEST(EdgeProfile, EndsAtNoughtAndOne) {
  const EdgeProfile profile(model::Psf::kGaussian, 4, 0, 0.1);
  EXPECT_DOUBLE_EQ(profile.At(-1e3).level, 0);
  EXPECT_DOUBLE_EQ(profile.At(1e3).level, 1);
  EXPECT_NEAR(profile.At(-profile.reach_px() + 1e-9).level, 0, 1e-6);
  EXPECT_NEAR(profile.At(profile.reach_px() - 1e-9).level, 1, 1e-6);
}

TEST(EdgeProfile, DiscAndGaussianMeetAtTheFloor) {
  const double floor_px = 0.5;
  const EdgeProfile below(model::Psf::kDisc, 0.25 - 1e-6, floor_px, 0.1);
  const EdgeProfile above(model::Psf::kDisc, 0.25 + 1e-6, floor_px, 0.1);
  for (const double d : {-1.0, -0.4, 0.0, 0.3, 0.8}) {
    EXPECT_NEAR(below.At(d).level, above.At(d).level, 1e-5);
    EXPECT_NEAR(below.At(d).per_variance, above.At(d).per_variance, 1e-3);
  }
}

TEST(EdgeProfile, GoesOnStraightBelowNoBlur) {
  const EdgeProfile least(model::Psf::kGaussian, 0.02, 0, 0.1);
  const EdgeProfile negative(model::Psf::kGaussian, -0.03, 0, 0.1);
  for (const double d : {-0.6, -0.2, 0.5}) {
    EXPECT_NEAR(negative.At(d).level, least.At(d).level - 0.05 * least.At(d).per_variance, 1e-4);
  }
}

}  // namespace
}  // namespace thicklens::calib
