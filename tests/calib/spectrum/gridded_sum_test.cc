#include "calib/spectrum/gridded_sum.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <random>
#include <utility>
#include <vector>

#include "thicklens/base/pi.h"

namespace thicklens::calib {
namespace {

Eigen::VectorXd HannWeights(int samples) {
  Eigen::VectorXd weights(samples);
  for (int i = 0; i < samples; ++i)
    weights[i] = std::pow(std::sin(kPi * (i + 0.7) / (samples + 0.4)), 2);
  return weights;
}

// The sums of the definition, in double precision.
std::complex<double> DirectSum(const cv::Mat& pixels, double less, const Eigen::VectorXd& x,
                               const Eigen::VectorXd& y, double fx, double fy) {
  std::complex<double> sum = 0;
  for (int row = 0; row < pixels.rows; ++row) {
    for (int col = 0; col < pixels.cols; ++col) {
      const auto middle_x = static_cast<double>(x.size() / 2);
      const auto middle_y = static_cast<double>(y.size() / 2);
      sum += x[col] * y[row] * (pixels.at<float>(row, col) - less) *
             std::polar(1.0, -2 * kPi * (fx * (col - middle_x) + fy * (row - middle_y)));
    }
  }
  return sum;
}

TEST(GriddedSums, AreTheDirectSumsAtAnyFrequency) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> frequency(-0.5, 0.5);
  std::normal_distribution<float> grey(0.4F, 0.1F);
  for (const auto& [width, height] : {std::pair{8, 9}, {64, 33}, {101, 58}, {53, 160}}) {
    cv::Mat pixels(height, width, CV_32F);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) pixels.at<float>(y, x) = grey(random);
    }
    // Even weights as well: the ends of the samples are the hardest part of the interpolation.
    for (const bool is_hann : {true, false}) {
      const Eigen::VectorXd x = is_hann ? HannWeights(width) : Eigen::VectorXd::Ones(width);
      const Eigen::VectorXd y = is_hann ? HannWeights(height) : Eigen::VectorXd::Ones(height);
      std::vector<double> fx = {0, 0.5, -0.5, 1.2}, fy = {0, 0.5, 0.25, -0.7};
      for (int k = 0; k < 8; ++k) {
        fx.push_back(frequency(random));
        fy.push_back(frequency(random));
      }
      std::vector<std::pair<int, int>> pairs;
      for (int k = 0; k < static_cast<int>(fx.size()); ++k)
        pairs.emplace_back(k, (5 * k) % static_cast<int>(fy.size()));
      const Eigen::ArrayXcd sums =
          GriddedSums(pixels, 0.4F, GriddedAxis(x), GriddedAxis(y), fx, fy, pairs);
      ASSERT_EQ(sums.size(), static_cast<Eigen::Index>(pairs.size()));
      double total = 0;
      for (int row = 0; row < height; ++row) {
        for (int col = 0; col < width; ++col)
          total += x[col] * y[row] * std::abs(pixels.at<float>(row, col) - 0.4F);
      }
      for (std::size_t k = 0; k < pairs.size(); ++k) {
        const auto [i, j] = pairs[k];
        const std::complex<double> direct = DirectSum(
            pixels, 0.4F, x, y, fx[static_cast<std::size_t>(i)], fy[static_cast<std::size_t>(j)]);
        EXPECT_LT(std::abs(sums[static_cast<Eigen::Index>(k)] - direct), 1e-6 * total)
            << width << " x " << height << ", pair " << k;
      }
    }
  }
}

TEST(GriddedSums, NoPairsGiveNoSums) {
  const GriddedAxis axis(Eigen::VectorXd::Ones(8));
  EXPECT_EQ(GriddedSums(cv::Mat::ones(8, 8, CV_32F), 0, axis, axis, {}, {}, {}).size(), 0);
}

}  // namespace
}  // namespace thicklens::calib
