// The shift of targets that look the same at every scale is compared with stars known in closed
// form.
#include "calib/registration/shift_registration.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>

#include "tests/calib/registration/star_image.h"
#include "tests/calib/registration/wave_image.h"

namespace thicklens::calib {
namespace {

using thicklens::testing::StarImage;
using thicklens::testing::StarView;
using thicklens::testing::View;
using thicklens::testing::WaveImage;

constexpr int kSizePx = 192;
constexpr double kMiddlePx = 0.5 * (kSizePx - 1);
const cv::Point2d kCentre(kMiddlePx, kMiddlePx);

// Dark where u v < 0; u and v are the distances from two lines through the middle.
cv::Mat Corner(double first_rad, double second_rad) {
  cv::Mat image(kSizePx, kSizePx, CV_32F);
  for (int y = 0; y < kSizePx; ++y) {
    for (int x = 0; x < kSizePx; ++x) {
      const double dx = x - kMiddlePx, dy = y - kMiddlePx;
      const double u = std::tanh(dx * std::cos(first_rad) + dy * std::sin(first_rad));
      const double v = std::tanh(dx * std::cos(second_rad) + dy * std::sin(second_rad));
      image.at<float>(y, x) = static_cast<float>(0.5 + 0.3 * u * v);
    }
  }
  return image;
}

cv::Mat WithNoise(const cv::Mat& image, double sigma) {
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0, sigma);
  cv::Mat noisy = image.clone();
  for (int y = 0; y < noisy.rows; ++y) {
    for (int x = 0; x < noisy.cols; ++x) noisy.at<float>(y, x) += static_cast<float>(noise(random));
  }
  return noisy;
}

TEST(IsScaleInvariant, HoldsForStarsAndLoneCorners) {
  for (const int spokes : {8, 36}) {
    StarView view;
    EXPECT_TRUE(IsScaleInvariant(StarImage(spokes).Render(kSizePx, view)));
    view.shift_x = 21;
    view.shift_y = -30;
    view.noise = 0.01;
    EXPECT_TRUE(IsScaleInvariant(StarImage(spokes).Render(kSizePx, view)));
  }
  EXPECT_TRUE(IsScaleInvariant(Corner(0.1, 1.6)));
}

TEST(IsScaleInvariant, DoesNotHoldForTexturesEdgesAndNothing) {
  EXPECT_FALSE(IsScaleInvariant(WaveImage(1).Render(kSizePx, {})));
  cv::Mat edge(kSizePx, kSizePx, CV_32F);
  for (int y = 0; y < kSizePx; ++y) {
    for (int x = 0; x < kSizePx; ++x)
      edge.at<float>(y, x) = static_cast<float>(0.5 + 0.3 * std::tanh(x - 0.1 * y - 80));
  }
  EXPECT_FALSE(IsScaleInvariant(edge));
  EXPECT_FALSE(IsScaleInvariant(WithNoise(edge, 0.005)));
  EXPECT_FALSE(IsScaleInvariant(cv::Mat(kSizePx, kSizePx, CV_32F, cv::Scalar(0.5))));
  // Rings about the middle of the star determine its scale.
  cv::Mat ringed = StarImage(36).Render(kSizePx, {});
  for (int radius = 20; radius < 90; radius += 12)
    cv::circle(ringed, {kSizePx / 2, kSizePx / 2}, radius, cv::Scalar(0.1), 2, cv::LINE_AA);
  EXPECT_FALSE(IsScaleInvariant(ringed));
}

TEST(RegisterShift, FindsSubPixelShiftsWhateverTheBlur) {
  const StarImage star(36);
  for (const double reference_blur_px : {0.6, 1.5}) {
    StarView sharp;
    sharp.blur_px = reference_blur_px;
    const cv::Mat reference = star.Render(kSizePx, sharp);
    int turn = 0;
    for (const double blur_px : {0.6, 1.0, 2.0, 3.5, 5.0}) {
      for (const double scale : {0.93, 1.0, 1.06}) {
        StarView view;
        view.blur_px = blur_px;
        view.shift_x = std::vector<double>{0.37, -2.21, 5.6}[static_cast<std::size_t>(turn % 3)];
        view.shift_y = std::vector<double>{-1.43, 0.09, 3.15}[static_cast<std::size_t>(++turn % 3)];
        const auto found = RegisterShift(reference, star.Render(kSizePx, view), scale, kCentre);
        ASSERT_TRUE(found) << blur_px << " " << scale;
        const double error_px =
            (found->shift_px - Eigen::Vector2d(view.shift_x, view.shift_y)).norm();
        EXPECT_LT(error_px, 0.02 + 0.0025 * blur_px * blur_px) << blur_px << " " << scale;
        EXPECT_NEAR(found->rotation_rad, 0, 3e-4) << blur_px;
      }
    }
  }
}

// Values that were not measured are not reported as measured.
TEST(RegisterShift, TakesTheScaleAsItIs) {
  const StarImage star(24);
  const cv::Mat reference = star.Render(kSizePx, {});
  for (const double scale : {0.8, 1.0, 1.07}) {
    const auto found = RegisterShift(reference, reference, scale, kCentre);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->scale, scale);
    EXPECT_EQ(found->scale_x, scale);
    EXPECT_EQ(found->scale_y, scale);
    EXPECT_EQ(found->scale_sigma, 0);
    EXPECT_EQ(found->cubic_sigma, 0);
    EXPECT_NEAR(found->shift_px.norm(), 0, 0.01);
  }
}

// If the star is not in the middle, its position in a frame depends on the scale about the given
// centre.
TEST(RegisterShift, ShiftIsAboutTheGivenCentre) {
  const StarImage star(36);
  StarView aside;
  aside.shift_x = 12;
  aside.shift_y = -9;
  const cv::Mat reference = star.Render(kSizePx, aside);
  StarView moved = aside;
  moved.shift_x += 2.3;
  moved.shift_y += 1.6;
  const cv::Point2d centre(100, 70);
  constexpr double kScale = 1.05;
  const auto found = RegisterShift(reference, star.Render(kSizePx, moved), kScale, centre);
  ASSERT_TRUE(found);
  // p_frame = centre + shift + scale (p_reference - centre) for the middle of the star.
  const Eigen::Vector2d c(centre.x, centre.y), middle(kMiddlePx, kMiddlePx);
  const Eigen::Vector2d before = middle + Eigen::Vector2d(aside.shift_x, aside.shift_y);
  const Eigen::Vector2d after = middle + Eigen::Vector2d(moved.shift_x, moved.shift_y);
  EXPECT_LT((found->shift_px - (after - c - kScale * (before - c))).norm(), 0.01);
}

TEST(RegisterShift, FindsASmallTurnBesides) {
  const StarImage star(36);
  const cv::Mat reference = star.Render(kSizePx, {});
  for (const double turn_rad : {-0.012, 0.004, 0.02}) {
    StarView view;
    view.rotation_rad = turn_rad;
    view.shift_x = 1.7;
    view.shift_y = -0.6;
    view.blur_px = 1.8;
    const auto found = RegisterShift(reference, star.Render(kSizePx, view), 0.97, kCentre);
    ASSERT_TRUE(found) << turn_rad;
    EXPECT_NEAR(found->rotation_rad, turn_rad, 3e-4);
    EXPECT_NEAR(found->shift_px.x(), view.shift_x, 0.02);
    EXPECT_NEAR(found->shift_px.y(), view.shift_y, 0.02);
  }
}

TEST(RegisterShift, GainOffsetSlopeAndNoiseDoNotBias) {
  const StarImage star(36);
  const cv::Mat reference = star.Render(kSizePx, {});
  StarView view;
  view.shift_x = -1.3;
  view.shift_y = 0.7;
  view.blur_px = 1.5;
  view.gain = 0.3;
  view.offset = 0.1;
  view.slope = 1e-3;  // 19 % over the field
  view.noise = 0.003;
  const auto found = RegisterShift(reference, star.Render(kSizePx, view), 1.02, kCentre);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->shift_px.x(), view.shift_x, 0.03);
  EXPECT_NEAR(found->shift_px.y(), view.shift_y, 0.03);
}

TEST(RegisterShift, RejectsWhatDoesNotShowTheTarget) {
  const cv::Mat reference = StarImage(36).Render(kSizePx, {});
  EXPECT_FALSE(RegisterShift(reference, WaveImage(2).Render(kSizePx, {}), 1, kCentre));
  for (const int spokes : {23, 35})
    EXPECT_FALSE(RegisterShift(reference, StarImage(spokes).Render(kSizePx, {}), 1, kCentre));
  const cv::Mat blank = WithNoise(cv::Mat(kSizePx, kSizePx, CV_32F, cv::Scalar(0.5)), 0.01);
  EXPECT_FALSE(RegisterShift(reference, blank, 1, kCentre));
  const cv::Mat tiny = reference(cv::Rect(60, 60, 40, 40)).clone();
  EXPECT_FALSE(RegisterShift(tiny, tiny, 1, {19.5, 19.5}));
}

}  // namespace
}  // namespace thicklens::calib
