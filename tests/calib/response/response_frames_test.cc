#include "calib/response/response_frames.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

namespace thicklens::calib {
namespace {

// The middle 512 px of a frame of 600 x 520 px, as ResponseCrop reads them.
TEST(ClippedPixels, ThoseThatWereFilledCount) {
  const cv::Mat image(512, 512, CV_32F, cv::Scalar(0.4));
  ResponseFrame frame;
  EXPECT_EQ(cv::countNonZero(ClippedPixels(image, frame)), 0);
  frame.filled = cv::Mat::zeros(520, 600, CV_8U);
  frame.filled(cv::Rect(100, 60, 9, 7)).setTo(255);
  frame.filled(cv::Rect(0, 0, 20, 3)).setTo(255);  // beside the middle
  const cv::Mat filled = ClippedPixels(image, frame);
  EXPECT_EQ(cv::countNonZero(filled), 63);
  EXPECT_EQ(filled.at<float>(60 - 4, 100 - 44), 1);
  EXPECT_EQ(filled.at<float>(59 - 4, 100 - 44), 0);
  frame.brightest = 0.3;
  EXPECT_EQ(cv::countNonZero(ClippedPixels(image, frame)), 512 * 512);
}

}  // namespace
}  // namespace thicklens::calib
