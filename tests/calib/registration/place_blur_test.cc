// A blur that depends on the place, against its closed forms.
#include "calib/registration/place_blur.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace thicklens::calib {
namespace {

constexpr int kWidth = 160, kHeight = 120;

PlaceBlur ABlur() {
  PlaceBlur blur;
  blur.centre_px = {70.3, 55.8};
  blur.at_centre_px2 = 2;
  blur.curvature = 3e-3;
  blur.astigmatism = -4e-4;
  return blur;
}

// Light and second central moments of what an image shows.
struct Moments {
  double light = 0, x = 0, y = 0, xx = 0, yy = 0, xy = 0;
};

Moments MomentsOf(const cv::Mat& image) {
  Moments m;
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const auto light = static_cast<double>(image.at<float>(y, x));
      m.light += light;
      m.x += light * x;
      m.y += light * y;
      m.xx += light * x * x;
      m.yy += light * y * y;
      m.xy += light * x * y;
    }
  }
  m.x /= m.light;
  m.y /= m.light;
  m.xx = m.xx / m.light - m.x * m.x;
  m.yy = m.yy / m.light - m.y * m.y;
  m.xy = m.xy / m.light - m.x * m.y;
  return m;
}

TEST(PlaceBlur, APointIsSpreadByTheBlurOfItsPlace) {
  const PlaceBlur blur = ABlur();
  for (const cv::Point at : {cv::Point(70, 56), cv::Point(110, 40), cv::Point(48, 80)}) {
    cv::Mat image = cv::Mat::zeros(kHeight, kWidth, CV_32F);
    image.at<float>(at) = 1;
    const Moments m = MomentsOf(SpreadByPlace(image, blur));
    const Eigen::Vector2d q = Eigen::Vector2d(at.x, at.y) - blur.centre_px;
    const double mean = blur.at_centre_px2 + blur.curvature * q.squaredNorm();
    const double along = blur.astigmatism * (q.x() * q.x() - q.y() * q.y());
    EXPECT_NEAR(m.light, 1, 1e-4);
    EXPECT_NEAR(m.x, at.x, 1e-3);
    EXPECT_NEAR(m.y, at.y, 1e-3);
    EXPECT_NEAR(m.xx, mean + along, 0.02 * mean) << at;
    EXPECT_NEAR(m.yy, mean - along, 0.02 * mean) << at;
    EXPECT_NEAR(m.xy, 2 * blur.astigmatism * q.x() * q.y(), 0.02 * mean) << at;
  }
}

TEST(PlaceBlur, WithoutAFieldItIsOneGaussian) {
  cv::Mat image(kHeight, kWidth, CV_32F);
  cv::theRNG().state = 5;
  cv::randu(image, 0, 1);
  PlaceBlur blur = ABlur();
  blur.curvature = blur.astigmatism = 0;
  cv::Mat expected;
  cv::GaussianBlur(image, expected, {}, std::sqrt(2.0), std::sqrt(2.0), cv::BORDER_REPLICATE);
  EXPECT_LT(cv::norm(SpreadByPlace(image, blur), expected, cv::NORM_INF), 1e-6);
  blur.at_centre_px2 = -1;
  EXPECT_EQ(cv::norm(SpreadByPlace(image, blur), image, cv::NORM_INF), 0);
}

TEST(PlaceBlur, TheLeastVarianceIsThatOfTheFarthestCorner) {
  PlaceBlur blur = ABlur();
  EXPECT_EQ(blur.Least({kWidth, kHeight}), 2);
  blur.curvature = -3e-3;
  // The corner at the right and the bottom is 88.7 and 63.2 px away.
  EXPECT_NEAR(blur.Least({kWidth, kHeight}), 2 - 3.4e-3 * (88.7 * 88.7 + 63.2 * 63.2), 1e-9);
}

}  // namespace
}  // namespace thicklens::calib
