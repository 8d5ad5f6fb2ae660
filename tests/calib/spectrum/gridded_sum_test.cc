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

TEST(GriddedSums, AreTheDirectSumsAtMultiplesOfAnyFrequency) {
  std::mt19937 random(11);
  std::normal_distribution<float> grey(0.4F, 0.1F);
  struct Steps {
    double x, y;
    int highest_x, highest_y;
  };
  for (const auto& [width, height] : {std::pair{8, 9}, {64, 33}, {101, 58}, {53, 160}}) {
    cv::Mat pixels(height, width, CV_32F);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) pixels.at<float>(y, x) = grey(random);
    }
    // Even weights as well: the ends of the samples are the hardest part. Steps of more and of
    // less than one period over all samples; the low orders alone; and beyond half a cycle.
    for (const bool is_hann : {true, false}) {
      for (const Steps& steps :
           {Steps{2.0 / 63.7, 2.0 / 57.1, 10, 9}, Steps{0.3 / 41, 1.0 / 9, 4, 4},
            Steps{0.1234, 0.0421, 6, 17}, Steps{1.0 / 8, 1.0 / 300, 1, 0}}) {
        const Eigen::VectorXd x = is_hann ? HannWeights(width) : Eigen::VectorXd::Ones(width);
        const Eigen::VectorXd y = is_hann ? HannWeights(height) : Eigen::VectorXd::Ones(height);
        std::vector<std::pair<int, int>> orders;
        for (int j = -steps.highest_x; j <= steps.highest_x; ++j) {
          orders.emplace_back(j, steps.highest_y);
          orders.emplace_back(j, j % (steps.highest_y + 1));
        }
        const Eigen::ArrayXcd sums =
            GriddedSums(pixels, 0.4F, GriddedAxis(x, steps.x, steps.highest_x),
                        GriddedAxis(y, steps.y, steps.highest_y), orders);
        ASSERT_EQ(sums.size(), static_cast<Eigen::Index>(orders.size()));
        double total = 0;
        for (int row = 0; row < height; ++row) {
          for (int col = 0; col < width; ++col)
            total += x[col] * y[row] * std::abs(pixels.at<float>(row, col) - 0.4F);
        }
        for (std::size_t k = 0; k < orders.size(); ++k) {
          const auto [jx, jy] = orders[k];
          const std::complex<double> direct =
              DirectSum(pixels, 0.4F, x, y, jx * steps.x, jy * steps.y);
          EXPECT_LT(std::abs(sums[static_cast<Eigen::Index>(k)] - direct), 1e-6 * total)
              << width << " x " << height << ", order " << jx << ", " << jy;
        }
      }
    }
  }
}

TEST(GriddedSums, NoOrdersGiveNoSums) {
  const GriddedAxis axis(Eigen::VectorXd::Ones(8), 0.1, 0);
  EXPECT_EQ(GriddedSums(cv::Mat::ones(8, 8, CV_32F), 0, axis, axis, {}).size(), 0);
}

}  // namespace
}  // namespace thicklens::calib
