// The change of the contrast along both axes is compared with frames that are blurred directly.
#include "calib/registration/axis_contrast.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace thicklens::calib {
namespace {

constexpr int kFramesOfContrast = 15;

std::vector<ScaleSample> EvenSamples() {
  std::vector<ScaleSample> samples;
  for (std::size_t i = 0; i < kFramesOfContrast; ++i) {
    ScaleSample sample;
    sample.frame = i;
    sample.reading_mm = static_cast<double>(i);
    sample.scale = 1 + 0.005 * (7 - static_cast<double>(i));
    samples.push_back(sample);
  }
  return samples;
}

// White noise with lines along y, blurred by an amount that is least at `focus_x` and `focus_y`.
std::optional<model::Estimate> ChangeWith(double focus_x, double focus_y, double noise) {
  cv::Mat target(120, 160, CV_32F), lines(1, 160, CV_32F);
  cv::RNG random(7);
  random.fill(target, cv::RNG::NORMAL, 0.5, 0.1);
  random.fill(lines, cv::RNG::NORMAL, 0, 0.1);
  target += cv::repeat(lines, 120, 1);
  return ChangeOfAxisContrast(EvenSamples(), [&](std::size_t i) {
    const auto sigma = [&](double focus) {
      return std::hypot(0.7, 0.4 * (static_cast<double>(i) - focus));
    };
    cv::Mat blurred, grain(target.size(), CV_32F);
    cv::GaussianBlur(target, blurred, {}, sigma(focus_x), sigma(focus_y));
    cv::RNG(100 + i).fill(grain, cv::RNG::NORMAL, 0, noise);
    return cv::Mat(blurred + grain);
  });
}

TEST(ChangeOfAxisContrast, ShowsAstigmatism) {
  const auto change = ChangeWith(6, 8, 0.001);
  EXPECT_TRUE(ShowsAstigmatism(change));
  EXPECT_LT(change->value, 0);  // x is blurred more at larger readings
  EXPECT_GT(ChangeWith(8, 6, 0.001)->value, 0);
}

// The lines make the contrast along x the larger one, and by more in focus than out of it.
TEST(ChangeOfAxisContrast, AnUnevenTextureIsNoAstigmatism) {
  EXPECT_FALSE(ShowsAstigmatism(ChangeWith(7, 7, 0.001)));
  EXPECT_FALSE(ShowsAstigmatism(ChangeWith(7, 7, 0.01)));
}

TEST(ChangeOfAxisContrast, IsOpenForFewFrames) {
  EXPECT_FALSE(ChangeOfAxisContrast({ScaleSample()}, [](std::size_t) { return cv::Mat(); }));
  EXPECT_FALSE(ShowsAstigmatism(std::nullopt));
}

}  // namespace
}  // namespace thicklens::calib
