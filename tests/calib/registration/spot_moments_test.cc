#include "calib/registration/spot_moments.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

namespace thicklens::calib {
namespace {

// Discs or Gaussians at places, each pixel the mean over its square by 8 x 8 points, with flux 1
// per point, scaled by `flux`.
struct Drawing {
  bool is_disc = false;
  double sigma_px = 2;  // of a disc, half its radius
  double flux = 100, ground = 0.4, slope = 0, noise = 0;
  std::uint32_t seed = 1;
};

cv::Mat Draw(const std::vector<cv::Point2d>& places, const Drawing& of, int side = 120) {
  constexpr int kParts = 8;
  cv::Mat grey(side, side, CV_32F);
  std::mt19937 engine(of.seed);
  std::normal_distribution<double> normal(0, 1);
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      double light = 0;
      for (int k = 0; k < kParts * kParts; ++k) {
        const cv::Point2d p(x + (k % kParts + 0.5) / kParts - 0.5,
                            y + (k / kParts + 0.5) / kParts - 0.5);
        for (const cv::Point2d& place : places) {
          const double r2 = (p - place).dot(p - place), s2 = of.sigma_px * of.sigma_px;
          if (r2 > 64 * s2) continue;
          light += of.is_disc ? (r2 <= 4 * s2 ? 1 / (4 * CV_PI * s2) : 0)
                              : std::exp(-r2 / (2 * s2)) / (2 * CV_PI * s2);
        }
      }
      grey.at<float>(y, x) =
          static_cast<float>(of.ground + of.slope * (x - side / 2) +
                             of.flux * light / (kParts * kParts) + of.noise * normal(engine));
    }
  }
  return grey;
}

SpotWindow WindowOf(double sigma_px, double sign = 1) {
  SpotWindow window;
  window.sigma_px = sigma_px;
  window.sign = sign;
  return window;
}

// A uniform disc of radius r has the variance r^2/4 along each axis. The box of the pixel adds
// 1/12.
TEST(SpotMoments, ADiscHasAQuarterOfTheSquareOfItsRadius) {
  for (const double radius : {3.0, 6.0, 11.0}) {
    Drawing disc{true, radius / 2};
    const SpotMoments found = MeasureSpot(Draw({{60.3, 58.8}}, disc), {61, 58}, {},
                                          WindowOf(radius / 2), model::Psf::kDisc);
    ASSERT_EQ(found.fault, SpotFault::kNone) << radius;
    EXPECT_NEAR(found.variance_px2, radius * radius / 4 + 1.0 / 12, 0.004 * radius * radius);
    EXPECT_NEAR(found.centre_px.x, 60.3, 0.01);
    EXPECT_NEAR(found.centre_px.y, 58.8, 0.01);
  }
}

TEST(SpotMoments, AGaussianHasItsVarianceWithAndWithoutASlopeOfTheGround) {
  for (const double sigma : {1.0, 2.5, 6.0}) {
    for (const double slope : {0.0, 0.003}) {
      Drawing gaussian;
      gaussian.sigma_px = sigma;
      gaussian.slope = slope;
      const SpotMoments found =
          MeasureSpot(Draw({{59.6, 60.2}}, gaussian), {60, 60}, {},
                      WindowOf(std::sqrt(sigma * sigma + 1.0 / 12)), model::Psf::kGaussian);
      ASSERT_EQ(found.fault, SpotFault::kNone);
      EXPECT_NEAR(found.variance_px2, sigma * sigma + 1.0 / 12, 0.004 * sigma * sigma) << sigma;
    }
  }
}

// A window that is wrong by a tenth would move the moment of a Gaussian by 1 % without the
// correction, and with it by the difference of the corrections.
TEST(SpotMoments, TheWindowIsCorrectedForAGaussianAlone) {
  Drawing gaussian;
  gaussian.sigma_px = 4;
  const cv::Mat grey = Draw({{60, 60}}, gaussian);
  const SpotMoments as_gaussian =
      MeasureSpot(grey, {60, 60}, {}, WindowOf(4), model::Psf::kGaussian);
  const SpotMoments as_disc = MeasureSpot(grey, {60, 60}, {}, WindowOf(4), model::Psf::kDisc);
  const double beyond = 9 * std::exp(-8.0);
  EXPECT_NEAR(as_disc.variance_px2 / as_gaussian.variance_px2, 1 - beyond, 1e-6);
}

// The mean over many images with noise is that without noise, and the scatter is what is stated.
TEST(SpotMoments, NoiseBiasesNothingAndScattersAsStated) {
  constexpr int kDraws = 150;
  Drawing of;
  of.sigma_px = 2.5;
  of.flux = 20;
  of.noise = 0.02;
  double sum = 0, squares = 0, stated = 0;
  int count = 0;
  for (int i = 0; i < kDraws; ++i) {
    of.seed = static_cast<std::uint32_t>(i + 1);
    const SpotMoments found = MeasureSpot(Draw({{30.3, 29.8}}, of, 60), {30, 30}, {}, WindowOf(2.5),
                                          model::Psf::kGaussian);
    ASSERT_EQ(found.fault, SpotFault::kNone);
    sum += found.variance_px2;
    squares += found.variance_px2 * found.variance_px2;
    stated += found.variance_sigma_px2;
    ++count;
  }
  const double mean = sum / count;
  const double scatter = std::sqrt(squares / count - mean * mean);
  EXPECT_NEAR(mean, 2.5 * 2.5 + 1.0 / 12, 4 * scatter / std::sqrt(kDraws));
  EXPECT_NEAR(scatter / (stated / count), 1, 0.2);
}

TEST(SpotMoments, PointsThatCannotBeMeasuredHaveTheirReason) {
  Drawing of;
  of.sigma_px = 2;
  const std::vector<cv::Point2d> places = {{60, 60}, {67, 60}, {4, 60}, {30, 30}};
  const cv::Mat grey = Draw(places, of);
  const auto fault = [&](std::size_t index, double clip_light = 1e30) {
    std::vector<cv::Point2d> others = places;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(index));
    SpotWindow window = WindowOf(2);
    window.clip_light = clip_light;
    return MeasureSpot(grey, places[index], others, window, model::Psf::kGaussian).fault;
  };
  EXPECT_EQ(fault(0), SpotFault::kOverlapped);
  EXPECT_EQ(fault(2), SpotFault::kOutside);
  EXPECT_EQ(fault(3), SpotFault::kNone);
  EXPECT_EQ(fault(3, 2.0), SpotFault::kClipped);
  of.flux = 0.3;
  of.noise = 0.05;
  EXPECT_EQ(
      MeasureSpot(Draw({{60, 60}}, of), {60, 60}, {}, WindowOf(2), model::Psf::kGaussian).fault,
      SpotFault::kFaint);
}

TEST(FindSpots, FindsBrightAndDarkPointsAndNothingElse) {
  std::vector<cv::Point2d> places;
  for (int i = 0; i < 9; ++i) places.emplace_back(20 + 40 * (i % 3) + i, 18 + 40 * (i / 3));
  Drawing of;
  of.sigma_px = 1.2;
  of.noise = 0.01;
  for (const double flux : {6.0, -3.0}) {
    of.flux = flux;
    const SpotPattern found = FindSpots(Draw(places, of));
    ASSERT_TRUE(found.done) << found.message;
    EXPECT_TRUE(found.is_nothing_else);
    EXPECT_EQ(found.are_bright, flux > 0);
    EXPECT_EQ(found.centres_px.size(), places.size());
    EXPECT_NEAR(found.spacing_px, 40, 3);
  }
}

// Grains of noise stand out like faint points, but the ground between them is not even.
TEST(FindSpots, ATextureIsNotPoints) {
  std::mt19937 engine(3);
  std::normal_distribution<double> normal(0, 1);
  for (int trial = 0; trial < 12; ++trial) {
    cv::Mat noise(160, 160, CV_32F), texture;
    for (int y = 0; y < noise.rows; ++y) {
      for (int x = 0; x < noise.cols; ++x)
        noise.at<float>(y, x) = static_cast<float>(normal(engine));
    }
    cv::GaussianBlur(noise, texture, {}, 1 + 0.25 * trial);
    const SpotPattern found = FindSpots(0.5 + 0.1 * texture);
    EXPECT_FALSE(found.done && found.is_nothing_else) << trial;
  }
}

}  // namespace
}  // namespace thicklens::calib
