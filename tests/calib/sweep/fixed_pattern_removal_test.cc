#include "calib/sweep/fixed_pattern_removal.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>

namespace thicklens::calib {
namespace {

TEST(FixedPatternRemoval, DividesByTheGain) {
  const cv::Mat log_gain(4, 6, CV_32F, cv::Scalar(std::log(0.25)));
  cv::Mat light(4, 6, CV_32F, cv::Scalar(0.1));
  FixedPatternRemoval(log_gain, cv::Mat()).Apply(&light);
  EXPECT_NEAR(light.at<float>(2, 3), 0.4, 1e-6);
  // Twice the same gain divides by its square.
  light.setTo(0.1);
  const FixedPatternRemoval one(log_gain, cv::Mat());
  one.With(one).Apply(&light);
  EXPECT_NEAR(light.at<float>(0, 0), 1.6, 1e-5);
}

// A linear field is filled without error at the centre of a symmetric group.
TEST(FixedPatternRemoval, FillsFromTheSurroundings) {
  cv::Mat light(9, 9, CV_32F), filled = cv::Mat::zeros(9, 9, CV_8U);
  for (int y = 0; y < 9; ++y) {
    for (int x = 0; x < 9; ++x)
      light.at<float>(y, x) = static_cast<float>(0.1 + 0.02 * x + 0.01 * y);
  }
  const cv::Mat before = light.clone();
  const cv::Rect hole(3, 3, 3, 3);
  filled(hole).setTo(1);
  light(hole).setTo(7);
  filled.at<std::uint8_t>(0, 0) = 1;  // at the corner of the image
  light.at<float>(0, 0) = 0;
  FixedPatternRemoval(cv::Mat::zeros(9, 9, CV_32F), filled).Apply(&light);
  EXPECT_NEAR(light.at<float>(4, 4), before.at<float>(4, 4), 1e-6);
  EXPECT_LT(cv::norm(light(hole), before(hole), cv::NORM_INF), 0.03);
  EXPECT_NEAR(light.at<float>(0, 0), before.at<float>(0, 0), 0.03);
  // All else is as it was.
  light(hole).setTo(0);
  cv::Mat rest = before.clone();
  rest(hole).setTo(0);
  rest.at<float>(0, 0) = light.at<float>(0, 0);
  EXPECT_EQ(cv::norm(light, rest, cv::NORM_INF), 0);
}

TEST(FixedPatternRemoval, AFrameWithoutAnyGoodPixelStaysAsItIs) {
  cv::Mat light(3, 3, CV_32F, cv::Scalar(0.5));
  FixedPatternRemoval(cv::Mat::zeros(3, 3, CV_32F), cv::Mat::ones(3, 3, CV_8U)).Apply(&light);
  EXPECT_EQ(light.at<float>(1, 1), 0.5F);
}

}  // namespace
}  // namespace thicklens::calib
