// What fall-off makes of an aperture, against sums over its rays.
#include "thicklens/model/weighed_aperture.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <string>

namespace thicklens::model {
namespace {

const ThickLens kWide = {12.5, 12.8, 3, 12.5 / 2.8};

struct Sums {
  double variance_ratio = 0, mean_per_landing = 0;
};

// (12), written out once more, over a grid of rays; the mean from two landings beside the axis.
Sums SumOf(Psf psf, double sigma_mm, double zf_mm, double d1_mm, double k_mm) {
  constexpr int kSide = 801;
  constexpr double kLandingMm = 0.01;
  const double reach = psf == Psf::kDisc ? 2 : 7;
  const auto moments = [&](double landing_mm) {
    double sum = 0, first = 0, second = 0;
    for (int i = 0; i < kSide; ++i) {
      for (int j = 0; j < kSide; ++j) {
        const Eigen::Vector2d unit =
            reach * Eigen::Vector2d((2 * i + 1.0) / kSide - 1, (2 * j + 1.0) / kSide - 1);
        if (psf == Psf::kDisc && unit.norm() > 2) continue;
        const Eigen::Vector2d at = sigma_mm * unit, landing(landing_mm, 0);
        const double alpha = std::atan((landing / k_mm - at / zf_mm).norm());
        const double beta = std::atan((landing + at).norm() / d1_mm);
        const double weight = (psf == Psf::kDisc ? 1 : std::exp(-unit.squaredNorm() / 2)) *
                              std::cos(alpha) * std::pow(std::cos(beta), 3);
        sum += weight;
        first += weight * at.x();
        second += weight * at.x() * at.x();
      }
    }
    return Eigen::Vector2d(first / sum, second / sum);
  };
  return {moments(0).y() / (sigma_mm * sigma_mm),
          (moments(kLandingMm).x() - moments(-kLandingMm).x()) / (2 * kLandingMm)};
}

TEST(WeighedAperture, HasTheMomentsOfItsRays) {
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    for (const double sigma_mm : {0.3, 2.0, 4.0}) {
      for (const double zf_mm : {40.0, 400.0}) {
        SCOPED_TRACE(PsfName(psf) + ", sigma " + std::to_string(sigma_mm));
        const WeighedAperture found = WeighAperture({psf, sigma_mm, zf_mm, 16.2}, 12.9);
        const Sums sums = SumOf(psf, sigma_mm, zf_mm, 16.2, 12.9);
        EXPECT_NEAR(found.variance_ratio, sums.variance_ratio, psf == Psf::kDisc ? 5e-4 : 2e-5);
        EXPECT_NEAR(found.mean_per_landing / sums.mean_per_landing, 1, 2e-3);
      }
    }
  }
  const WeighedAperture none = WeighAperture({Psf::kGaussian, 0, 400, 16}, 12.9);
  EXPECT_NEAR(none.variance_ratio, 1, 1e-12);
  EXPECT_EQ(none.mean_per_landing, 0);
  const WeighedAperture far =
      WeighAperture({Psf::kDisc, 2, std::numeric_limits<double>::infinity(), 16.2}, 12.9);
  EXPECT_NEAR(far.variance_ratio, WeighAperture({Psf::kDisc, 2, 1e7, 16.2}, 12.9).variance_ratio,
              1e-9);
}

TEST(WeighedAperture, SlopesOfTheSeenBlurRatioAreThoseOfItsValues) {
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    for (const double zf_mm : {30.0, 400.0}) {
      const auto squared = [&](double kappa, double zf) {
        return SeeBlurRatio(kWide, psf, kappa, zf).squared;
      };
      const SeenBlurRatio seen = SeeBlurRatio(kWide, psf, 0.45, zf_mm);
      EXPECT_LT(seen.squared, 0.45 * 0.45);
      EXPECT_NEAR(seen.by_blur_ratio, (squared(0.4501, zf_mm) - squared(0.4499, zf_mm)) / 0.0002,
                  1e-6);
      EXPECT_NEAR(seen.by_focus_depth,
                  (squared(0.45, zf_mm + 0.01) - squared(0.45, zf_mm - 0.01)) / 0.02, 1e-9);
    }
  }
}

// The rule of thumb: kappa loses 3/2 and 1/2 of (sigma/d1)^2, and a tenth of it at a tenth of it.
TEST(WeighedAperture, OfASmallApertureFollowsTheLeadingTerms) {
  ThickLens lens = kWide;
  lens.aperture_radius_mm = 0.4;
  const double x = std::pow(0.5 * 0.4 / ImageDistanceMm(lens, 400), 2);
  EXPECT_NEAR((1 - SeeBlurRatio(lens, Psf::kGaussian, 0.5, 400).squared / 0.25) / (3 * x), 1, 0.02);
  EXPECT_NEAR((1 - SeeBlurRatio(lens, Psf::kDisc, 0.5, 400).squared / 0.25) / x, 1, 0.02);
  EXPECT_NEAR(CentreOfPerspectiveMm(lens, Psf::kGaussian, 0.5, 400) / (3 * x * 12.9), 1, 0.02);
}

// The size in the picture goes as one over the distance from there, whatever the depth.
TEST(WeighedAperture, SeesFromTheCentreOfPerspective) {
  const double zf_mm = 400, d1_mm = ImageDistanceMm(kWide, zf_mm);
  const double k_mm = DefocusScaleMm(kWide, d1_mm);
  const WeighedAperture weighed =
      WeighAperture({Psf::kDisc, 0.5 * kWide.aperture_radius_mm, zf_mm, d1_mm}, k_mm);
  const double centre_mm = CentreOfPerspectiveMm(kWide, Psf::kDisc, 0.5, zf_mm);
  EXPECT_GT(centre_mm, 0.3);
  for (const double z_mm : {100.0, 250.0, 900.0}) {
    const double seen =
        z_mm * (1 + weighed.mean_per_landing * DefocusPerAperture(kWide, d1_mm, z_mm));
    EXPECT_NEAR(seen / zf_mm, (z_mm - centre_mm) / (zf_mm - centre_mm), 1e-12);
  }
}

}  // namespace
}  // namespace thicklens::model
