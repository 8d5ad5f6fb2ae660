// Laws of the pupil against sums over their rays, written out once more.
#include "thicklens/model/pupil_law.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <string>

#include "support/error_message.h"
#include "thicklens/base/error.h"
#include "thicklens/model/blur_transfer.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;
using thicklens::testing::ErrorOf;

constexpr double kPi = 3.14159265358979323846;
const ThickLens kWide = {12.5, 12.8, 3, 12.5 / 2.8};

struct RaySums {
  double second_moment = 0, mean = 0, transfer = 0;
};

// Rays on a fine grid of the aperture (of the sine condition: of direction cosines times d1), of a
// point whose chief ray lands at `landing_mm`. Angles as angles, no expansion. `nu` in cycles per
// mm of the aperture.
RaySums SumOf(PupilLaw law, Psf psf, double transmission_mm, double zf_mm, double d1_mm,
              double k_mm, double landing_mm, double nu) {
  constexpr int kSide = 1001;
  const double reach = psf == Psf::kDisc ? 2 : 6.5;
  double sum = 0, first = 0, second = 0, wave = 0;
  const double chief_cosine = std::sin(std::atan(landing_mm / d1_mm));
  for (int i = 0; i < kSide; ++i) {
    for (int j = 0; j < kSide; ++j) {
      const Eigen::Vector2d unit =
          reach * Eigen::Vector2d((2 * i + 1.0) / kSide - 1, (2 * j + 1.0) / kSide - 1);
      if (psf == Psf::kDisc && unit.norm() > 2) continue;
      double weight = psf == Psf::kDisc ? 1 : std::exp(-unit.squaredNorm() / 2);
      Eigen::Vector2d at = transmission_mm * unit;
      const Eigen::Vector2d landing(landing_mm, 0);
      if (law == PupilLaw::kSineCondition) {
        const Eigen::Vector2d cosines = at / d1_mm + Eigen::Vector2d(chief_cosine, 0);
        if (!(cosines.squaredNorm() < 0.9)) continue;
        at = d1_mm * cosines / std::sqrt(1 - cosines.squaredNorm()) - landing;
      } else {
        const double alpha = std::atan((landing / k_mm - at / zf_mm).norm());
        const double beta = std::atan((landing + at).norm() / d1_mm);
        if (law == PupilLaw::kPaper) weight *= std::cos(alpha) * std::pow(std::cos(beta), 3);
        if (law == PupilLaw::kCosineFourth) weight *= std::pow(std::cos(beta), 4);
      }
      sum += weight;
      first += weight * at.x();
      second += weight * at.x() * at.x();
      wave += weight * std::cos(2 * kPi * nu * at.x());
    }
  }
  return {second / sum, first / sum, wave / sum};
}

TEST(PupilLaw, HasTheMomentsAndTheTransferFunctionOfItsRays) {
  for (const PupilLaw law : AllPupilLaws()) {
    for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
      for (const double sigma_mm : {0.4, 2.2}) {
        SCOPED_TRACE(PupilLawName(law) + ", " + PsfName(psf) + ", " + std::to_string(sigma_mm));
        const double zf_mm = 120, d1_mm = 16.2, k_mm = 12.9;
        const PupilProfile profile(law, {psf, sigma_mm, zf_mm, d1_mm, k_mm}, 20);
        const double transmission_mm = sigma_mm * profile.transmission_ratio();
        const double tolerance = psf == Psf::kDisc ? 1e-3 : 2e-5;
        constexpr double kLandingMm = 0.01;
        const double nu = 1.3 / (2 * kPi * sigma_mm);
        const RaySums axis = SumOf(law, psf, transmission_mm, zf_mm, d1_mm, k_mm, 0, nu);
        EXPECT_NEAR(axis.second_moment / (sigma_mm * sigma_mm), 1, tolerance);
        EXPECT_NEAR(profile.Transfer(1.3), axis.transfer, tolerance);
        const auto mean_at = [&](double landing_mm) {
          return SumOf(law, psf, transmission_mm, zf_mm, d1_mm, k_mm, landing_mm, nu).mean;
        };
        const double slope = (mean_at(kLandingMm) - mean_at(-kLandingMm)) / (2 * kLandingMm);
        EXPECT_NEAR(profile.mean_per_landing(), slope, 2e-3 * std::abs(slope) + 1e-6);
      }
    }
  }
}

// The values hold to the leading order in (sigma/d1)^2 for a far plane of focus.
TEST(PupilLaw, OfASmallApertureFollowsTheLeadingTerms) {
  const double sigma_mm = 0.2, d1_mm = 16;
  const double x = std::pow(sigma_mm / d1_mm, 2);
  const auto profile = [&](PupilLaw law, Psf psf) {
    return PupilProfile(law, {psf, sigma_mm, 1e9, d1_mm, 12.5});
  };
  EXPECT_EQ(profile(PupilLaw::kUniform, Psf::kGaussian).mean_per_landing(), 0);
  EXPECT_NEAR(profile(PupilLaw::kUniform, Psf::kGaussian).transmission_ratio(), 1, 1e-12);
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    EXPECT_NEAR(profile(PupilLaw::kPaper, psf).mean_per_landing() / x, -3, 0.01);
    EXPECT_NEAR(profile(PupilLaw::kCosineFourth, psf).mean_per_landing() / x, -4, 0.01);
    EXPECT_NEAR(profile(PupilLaw::kSineCondition, psf).mean_per_landing() / x, 2, 0.01);
  }
  // The variance of a Gaussian falls by 2 n x under (1 + A^2/d1^2)^(-n), that of a disc by 2 n x/3.
  EXPECT_NEAR((profile(PupilLaw::kPaper, Psf::kGaussian).transmission_ratio() - 1) / x, 1.5, 0.02);
  EXPECT_NEAR((profile(PupilLaw::kPaper, Psf::kDisc).transmission_ratio() - 1) / x, 0.5, 0.02);
  EXPECT_NEAR((profile(PupilLaw::kCosineFourth, Psf::kGaussian).transmission_ratio() - 1) / x, 2,
              0.02);
}

TEST(PupilLaw, UniformIsThePsfItself) {
  const PupilProfile gaussian(PupilLaw::kUniform, {Psf::kGaussian, 3, 400, 16, 12.5});
  const PupilProfile disc(PupilLaw::kUniform, {Psf::kDisc, 3, 400, 16, 12.5}, 60);
  for (const double x : {0.0, 0.003, 0.5, 2.0, 4.7, 9.0, 37.0}) {
    const double nu = x / (2 * kPi);
    EXPECT_NEAR(gaussian.Transfer(x), GaussianTransfer(1, nu, 0), 1e-8) << x;
    EXPECT_NEAR(disc.Transfer(x), DiscTransfer(2, nu, 0), 1e-8) << x;
  }
}

// Blurs of tens of pixels ask for more than the quadrature was made for: there the series about the
// edge holds, as a finer quadrature shows.
TEST(PupilLaw, BeyondItsReachADiscsTransferIsThatOfItsEdge) {
  for (const PupilLaw law : AllPupilLaws()) {
    for (const double sigma_mm : {0.4, 2.2, 4.6}) {
      const PupilOptics optics{Psf::kDisc, sigma_mm, 120, 16.2, 12.9};
      const PupilProfile coarse(law, optics), fine(law, optics, 200);
      for (double x = 50; x < 195; x += 3.7) {
        EXPECT_NEAR(coarse.Transfer(x), fine.Transfer(x), x < 100 ? 1e-6 : 5e-9)
            << PupilLawName(law) << ", sigma " << sigma_mm << " mm, x " << x;
      }
    }
  }
}

// The size in the image is proportional to one over the distance from the centre of perspective,
// whatever the depth is.
TEST(PupilLaw, SeesFromTheCentreOfPerspective) {
  const double zf_mm = 400, d1_mm = ImageDistanceMm(kWide, zf_mm);
  for (const PupilLaw law : AllPupilLaws()) {
    const PupilProfile profile(law, PupilOpticsOf(kWide, Psf::kDisc, 0.5, zf_mm));
    const double centre_mm = CentreOfPerspectiveMm(kWide, Psf::kDisc, law, 0.5, zf_mm);
    EXPECT_EQ(law == PupilLaw::kUniform, centre_mm == 0);
    for (const double z_mm : {100.0, 250.0, 900.0}) {
      const double seen =
          z_mm * (1 + profile.mean_per_landing() * DefocusPerAperture(kWide, d1_mm, z_mm));
      EXPECT_NEAR(seen / zf_mm, (z_mm - centre_mm) / (zf_mm - centre_mm), 1e-9);
    }
  }
}

TEST(PupilLaw, NamesWhatItCannotDo) {
  EXPECT_THAT(ErrorOf([] { PupilLawFromName("cos5"); }), HasSubstr("uniform, paper, cos4 or sine"));
  EXPECT_THAT(ErrorOf([] {
                PupilProfile(PupilLaw::kPaper, {Psf::kGaussian, 0, 400, 16, 12});
              }),
              HasSubstr("sigma_mm is 0"));
  // No Gaussian of light within the steepest rays is as wide as twice the image distance.
  EXPECT_THAT(ErrorOf([] {
                PupilProfile(PupilLaw::kSineCondition, {Psf::kGaussian, 100, 400, 16, 12});
              }),
              HasSubstr("100 mm"));
  // All laws are defined for the widest pupil. A wider one has the same centre of perspective under
  // each law.
  const double widest = kWidestPupil * ImageDistanceMm(kWide, 400) / kWide.aperture_radius_mm;
  for (const PupilLaw law : AllPupilLaws()) {
    for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
      EXPECT_NO_THROW(PupilProfile(law, PupilOpticsOf(kWide, psf, widest, 400)));
      EXPECT_NEAR(CentreOfPerspectiveMm(kWide, psf, law, 5 * widest, 400),
                  CentreOfPerspectiveMm(kWide, psf, law, widest, 400), 1e-9);
    }
  }
  for (const PupilLaw law : AllPupilLaws()) EXPECT_EQ(PupilLawFromName(PupilLawName(law)), law);
}

}  // namespace
}  // namespace thicklens::model
