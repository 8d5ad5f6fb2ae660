#include "thicklens/model/blur_transfer.h"

#include <gtest/gtest.h>

#include <cmath>

namespace thicklens::model {
namespace {

constexpr double kPi = 3.14159265358979323846;

struct Frequency {
  double fx, fy;
};
constexpr Frequency kFrequencies[] = {{0, 0},      {0.01, 0},    {0, 0.07},   {0.13, -0.21},
                                      {0.5, 0.25}, {-0.75, 0.4}, {1, 0.0001}, {0.9, 1}};

// The real part of the Fourier integral of a spatial density over [-reach, reach]^2, by the
// trapezoidal rule. The densities here are even, so that there is no imaginary part.
template <typename Density>
double FourierIntegral(const Density& density, double reach, int steps, Frequency f) {
  const double h = 2 * reach / steps;
  double sum = 0;
  for (int i = 0; i <= steps; ++i) {
    const double y = -reach + i * h;
    for (int j = 0; j <= steps; ++j) {
      const double x = -reach + j * h;
      const double weight = (i == 0 || i == steps ? 0.5 : 1) * (j == 0 || j == steps ? 0.5 : 1);
      sum += weight * density(x, y) * std::cos(2 * kPi * (f.fx * x + f.fy * y));
    }
  }
  return sum * h * h;
}

TEST(BlurTransferTest, GaussianIsTheFourierIntegralOfItsDensity) {
  for (const double sigma : {0.3, 0.5, 1.7}) {
    const auto density = [sigma](double x, double y) {
      return std::exp(-(x * x + y * y) / (2 * sigma * sigma)) / (2 * kPi * sigma * sigma);
    };
    for (const Frequency f : kFrequencies) {
      EXPECT_NEAR(GaussianTransfer(sigma, f.fx, f.fy), FourierIntegral(density, 9 * sigma, 200, f),
                  1e-9)
          << "sigma " << sigma << " at " << f.fx << ", " << f.fy;
    }
  }
}

TEST(BlurTransferTest, DiscIsTheFourierIntegralOfAUniformDisc) {
  for (const double radius : {0.4, 1.0, 6.5}) {
    for (const Frequency f : kFrequencies) {
      // The integral is in polar coordinates: the midpoint rule is used along the circle, and along
      // the radius in r^2, in which the area of the disc is uniform.
      constexpr int kAngles = 200, kRadii = 8000;
      double sum = 0;
      for (int i = 0; i < kRadii; ++i) {
        const double r = radius * std::sqrt((i + 0.5) / kRadii);
        for (int k = 0; k < kAngles / 4; ++k) {
          // The integrand's even symmetry in both coordinates needs only a quarter of the circle.
          const double angle = 2 * kPi * (k + 0.5) / kAngles;
          sum += std::cos(2 * kPi * f.fx * r * std::cos(angle)) *
                 std::cos(2 * kPi * f.fy * r * std::sin(angle));
        }
      }
      EXPECT_NEAR(DiscTransfer(radius, f.fx, f.fy), sum / kRadii / (kAngles / 4), 1e-6)
          << "radius " << radius << " at " << f.fx << ", " << f.fy;
    }
  }
}

TEST(BlurTransferTest, PixelBoxIsTheFourierIntegralOfOnePixel) {
  // The box separates. Midpoint rule: error (2 pi f)^2 h^2/24 per axis.
  const auto line = [](double f) {
    constexpr int kSteps = 4000;
    double sum = 0;
    for (int i = 0; i < kSteps; ++i) sum += std::cos(2 * kPi * f * ((i + 0.5) / kSteps - 0.5));
    return sum / kSteps;
  };
  for (const Frequency f : kFrequencies) {
    EXPECT_NEAR(PixelBoxTransfer(f.fx, f.fy), line(f.fx) * line(f.fy), 1e-6)
        << f.fx << ", " << f.fy;
  }
}

TEST(BlurTransferTest, IsOneWithoutBlurAndAtFrequencyZero) {
  EXPECT_EQ(GaussianTransfer(0, 0.3, 0.4), 1);
  EXPECT_EQ(DiscTransfer(0, 0.3, 0.4), 1);
  EXPECT_EQ(GaussianTransfer(3, 0, 0), 1);
  EXPECT_EQ(DiscTransfer(3, 0, 0), 1);
  EXPECT_EQ(PixelBoxTransfer(0, 0), 1);
  EXPECT_NEAR(PixelBoxTransfer(1, 0), 0, 1e-15);
}

TEST(BlurTransferTest, SeriesNearZeroMeetsTheFormula) {
  // Just above and below the switch at 2 pi R f = 1e-4.
  const double f = 1e-4 / (2 * kPi);
  EXPECT_NEAR(DiscTransfer(1, f * 1.001, 0), DiscTransfer(1, f * 0.999, 0), 1e-11);
  EXPECT_NEAR(PixelBoxTransfer(2 * f * 1.001, 0), PixelBoxTransfer(2 * f * 0.999, 0), 1e-11);
}

TEST(BlurTransferTest, BothShapesOfDefocusHaveTheSecondMomentSigma) {
  // T = 1 - 2 pi^2 sigma^2 f^2 + O(f^4), whatever the shape.
  const double f = 1e-4;
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    for (const double sigma : {0.5, 2.0, 9.0}) {
      const double moment = (1 - DefocusTransfer(psf, sigma, f, 0)) / (2 * kPi * kPi * f * f);
      EXPECT_NEAR(moment / (sigma * sigma), 1, 1e-4) << PsfName(psf) << " " << sigma;
    }
  }
}

TEST(BlurTransferTest, DiscHasItsFirstZeroWhereTheBesselFunctionHas) {
  // j_{1,1} = 3.8317059702 = 2 pi R f with R = 2 sigma.
  const double sigma = 1.5;
  EXPECT_NEAR(DefocusTransfer(Psf::kDisc, sigma, 3.8317059702 / (2 * kPi * 2 * sigma), 0), 0, 1e-9);
  EXPECT_LT(DefocusTransfer(Psf::kDisc, sigma, 5.0 / (2 * kPi * 2 * sigma), 0), -0.1);
}

}  // namespace
}  // namespace thicklens::model
