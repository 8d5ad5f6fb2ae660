#include "calib/sharpness/gradient_energy.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace thicklens::calib {
namespace {

cv::Mat Noise(double mean, double sigma, std::uint64_t seed) {
  cv::Mat noise(256, 256, CV_32F);
  cv::RNG random(seed);
  random.fill(noise, cv::RNG::NORMAL, mean, sigma);
  return noise;
}

// A wave along x of 1 + a sin(w x) has half the square of a sin(w) exp(-w^2/2): central differences
// of a wave that a Gaussian of 1 px has smoothed.
TEST(GradientEnergy, IsThatOfAWaveInClosedForm) {
  constexpr double kAmplitude = 0.3, kPerPx = 2 * 3.14159265358979 / 16;
  cv::Mat wave(64, 256, CV_32F);
  for (int y = 0; y < wave.rows; ++y) {
    for (int x = 0; x < wave.cols; ++x)
      wave.at<float>(y, x) = static_cast<float>(0.2 * (1 + kAmplitude * std::sin(kPerPx * x)));
  }
  constexpr double kInside = 62.0 * 254 / (64 * 256);  // the border has no gradient
  const double expected =
      kInside * 0.5 * std::pow(kAmplitude * std::sin(kPerPx) * std::exp(-kPerPx * kPerPx / 2), 2);
  EXPECT_NEAR(GradientEnergy(wave, 0), expected, 0.03 * expected);
}

TEST(GradientEnergy, OfNoiseIsTakenOut) {
  const cv::Mat noise = Noise(0.4, 0.02, 7);
  const double with = GradientEnergy(noise, 0);
  EXPECT_GT(with, 0);
  EXPECT_NEAR(GradientEnergy(noise, 0.02), 0, 0.05 * with);
}

// Specks with steep borders, on a texture that is blurred more and more.
TEST(GradientEnergy, FixedStructureAddsTheSameToEveryFrame) {
  cv::Mat specks(256, 256, CV_32F, cv::Scalar(1));
  cv::RNG random(3);
  for (int i = 0; i < 25; ++i) {
    cv::circle(specks, {random.uniform(10, 246), random.uniform(10, 246)}, 6, cv::Scalar(0.6),
               cv::FILLED);
  }
  cv::GaussianBlur(specks, specks, {}, 1);
  const double of_specks = GradientEnergy(specks, 0);
  double last = HUGE_VAL;
  for (const double blur_px : {1.2, 2.0, 4.0, 8.0}) {
    cv::Mat texture = Noise(0, 1, 11);
    cv::GaussianBlur(texture, texture, {}, blur_px);
    texture = 0.5 + texture;
    const double alone = GradientEnergy(texture, 0);
    const double both = GradientEnergy(texture.mul(specks), 0);
    EXPECT_NEAR(both, alone + of_specks, 0.12 * (alone + of_specks)) << blur_px;
    EXPECT_LT(both, last) << blur_px;
    last = both;
  }
}

TEST(SharpestFrame, IsTheOneWithTheSteepestEdgesUnlessTheseAreNotTheTargets) {
  // A clean sweep: both indices agree within a step.
  EXPECT_EQ(SharpestFrame({0, 1, 2, 3}, {1, 5, 4.9, 1}, {2, 9, 9.5, 2}), 1u);
  // The edges of dust: the slopes are largest at the ends of the sweep.
  EXPECT_EQ(SharpestFrame({0, 1, 2, 3}, {6, 4, 5, 3}, {2, 5, 9, 4}), 2u);
  // Frames that are not used do not count.
  EXPECT_EQ(SharpestFrame({0, 1, 3}, {6, 4, 9, 3}, {2, 5, 99, 2}), 1u);
  // Without defocus the energies differ by chance.
  EXPECT_EQ(SharpestFrame({0, 1, 2}, {5, 6, 5}, {9.2, 9.0, 9.1}), 1u);
}

}  // namespace
}  // namespace thicklens::calib
