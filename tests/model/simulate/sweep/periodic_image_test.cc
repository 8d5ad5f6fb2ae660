#include "model/simulate/sweep/periodic_image.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <opencv2/core.hpp>
#include <utility>

#include "model/base/random_draws.h"
#include "support/blur_oracles.h"

namespace thicklens::model {
namespace {

using thicklens::testing::BoxTransfer;
using thicklens::testing::DiscTransfer;

constexpr double kPi = 3.14159265358979323846;
constexpr double kFloorPx = 0.5;

cv::Mat RandomSamples(int rows, int columns) {
  RandomDraws draws(7, RandomDraws::Purpose::kTexture, 0);
  cv::Mat samples(rows, columns, CV_64F);
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) samples.at<double>(i, j) = 1 + 0.3 * draws.Normal();
  }
  return samples;
}

// Transfer of a Gaussian at the square of a frequency.
double GaussianOracle(double sigma, double f_square) {
  return std::exp(-2 * kPi * kPi * sigma * sigma * f_square);
}
TEST(PeriodicImageTest, EqualsTheDirectSumOfItsFourierSeries) {
  for (const auto& [columns, rows] : {std::pair{60, 45}, std::pair{45, 64}, std::pair{5, 90}}) {
    const PeriodicImage image(RandomSamples(rows, columns));
    for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
      for (const double defocus : {0.0, 0.8, 4.0}) {
        const AxisSampling x{-2.31, 0.0313, 37};
        const AxisSampling y{0.77, 0.0191, 21};
        const cv::Mat frame = image.Evaluate(x, y, {kFloorPx, psf, defocus});
        ASSERT_EQ(frame.rows, 21);
        ASSERT_EQ(frame.cols, 37);
        for (int probe = 0; probe < 6; ++probe) {
          const int i = probe * 13 % 21;
          const int j = probe * 23 % 37;
          std::complex<double> sum = 0;
          for (int b = -image.max_y_frequency(); b <= image.max_y_frequency(); ++b) {
            for (int a = -image.max_x_frequency(); a <= image.max_x_frequency(); ++a) {
              const double fx = a * x.step, fy = b * y.step;
              const double f_square = fx * fx + fy * fy;
              const double defocused = psf == Psf::kDisc
                                           ? DiscTransfer(2 * defocus, std::sqrt(f_square))
                                           : GaussianOracle(defocus, f_square);
              sum += image.Coefficient(a, b) * GaussianOracle(kFloorPx, f_square) * defocused *
                     BoxTransfer(fx) * BoxTransfer(fy) *
                     std::polar(
                         1.0, 2 * kPi * (a * (x.start + j * x.step) + b * (y.start + i * y.step)));
            }
          }
          EXPECT_NEAR(frame.at<double>(i, j), sum.real(), 1e-9) << columns << "x" << rows;
          EXPECT_NEAR(sum.imag(), 0, 1e-9);
        }
      }
    }
  }
}

TEST(PeriodicImageTest, RunsThroughItsSamplesWhereThereIsNoBlur) {
  // Odd counts: every frequency has its phase. The pixel box is undone by a step that is tiny.
  const cv::Mat samples = RandomSamples(33, 27);
  const PeriodicImage image(samples);
  for (int i = 0; i < 33; i += 5) {
    for (int j = 0; j < 27; j += 4) {
      const cv::Mat value = image.Evaluate({j / 27.0, 1e-7, 1}, {i / 33.0, 1e-7, 1}, {});
      EXPECT_NEAR(value.at<double>(0, 0), samples.at<double>(i, j), 1e-9);
    }
  }
}

TEST(PeriodicImageTest, CosineKeepsItsFormWithTheAmplitudeOfTheTransfer) {
  constexpr int kCount = 48;
  cv::Mat samples(kCount, kCount, CV_64F);
  for (int i = 0; i < kCount; ++i) {
    for (int j = 0; j < kCount; ++j) {
      samples.at<double>(i, j) = 1 + 0.5 * std::cos(2 * kPi * (5.0 * j + 2.0 * i) / kCount);
    }
  }
  const PeriodicImage image(samples);
  const double step = 1 / 31.7;
  const cv::Mat frame =
      image.Evaluate({0.1, step, 40}, {0.2, step, 30}, {kFloorPx, Psf::kGaussian, 1.1});
  const double amplitude = 0.5 * GaussianOracle(std::hypot(kFloorPx, 1.1), 29 * step * step) *
                           BoxTransfer(5 * step) * BoxTransfer(2 * step);
  for (int i = 0; i < 30; ++i) {
    for (int j = 0; j < 40; ++j) {
      const double phase = 2 * kPi * (5 * (0.1 + j * step) + 2 * (0.2 + i * step));
      EXPECT_NEAR(frame.at<double>(i, j), 1 + amplitude * std::cos(phase), 1e-10);
    }
  }
}

}  // namespace
}  // namespace thicklens::model
