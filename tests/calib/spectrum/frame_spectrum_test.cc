#include "calib/spectrum/frame_spectrum.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <random>
#include <set>
#include <utility>
#include <vector>

namespace thicklens::calib {
namespace {

constexpr double kPi = 3.14159265358979323846;

double Sinc(double x) { return x == 0 ? 1 : std::sin(kPi * x) / (kPi * x); }

cv::Mat WhiteNoise(int width_px, int height_px, double mean, double sigma, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(mean, sigma);
  cv::Mat grey(height_px, width_px, CV_32F);
  for (int y = 0; y < grey.rows; ++y) {
    for (int x = 0; x < grey.cols; ++x) grey.at<float>(y, x) = static_cast<float>(normal(random));
  }
  return grey;
}

// The definition, pixel by pixel in double precision.
struct Direct {
  std::complex<double> value;
  double mean = 0, noise_gain = 0;
};
Direct DirectSum(const cv::Mat& grey, const Eigen::Vector2d& origin_px, const FramePlace& place,
                 const TargetWindow& window, const Mode& mode) {
  const auto weight_and_x = [&](int x, int y, Eigen::Vector2d* target) {
    *target = (Eigen::Vector2d(x, y) - origin_px - place.shift_px) / place.scale;
    double w = 1;
    for (int axis = 0; axis < 2; ++axis) {
      const double u = ((*target)[axis] - window.centre_px[axis]) / window.size_px[axis];
      w *= std::abs(u) < 0.5 ? std::pow(std::cos(kPi * u), 2) : 0;
    }
    return w;
  };
  Direct direct;
  Eigen::Vector2d target;
  double total = 0, squares = 0, light = 0;
  for (int y = 0; y < grey.rows; ++y) {
    for (int x = 0; x < grey.cols; ++x) {
      const double w = weight_and_x(x, y, &target);
      total += w;
      squares += w * w;
      light += w * grey.at<float>(y, x);
    }
  }
  direct.mean = light / total;
  direct.noise_gain = squares / (total * total) / (direct.mean * direct.mean);
  const Eigen::Vector2d nu(mode.jx / window.size_px.x(), mode.jy / window.size_px.y());
  for (int y = 0; y < grey.rows; ++y) {
    for (int x = 0; x < grey.cols; ++x) {
      const double w = weight_and_x(x, y, &target) / total;
      direct.value +=
          w * (grey.at<float>(y, x) / direct.mean - 1) * std::polar(1.0, -2 * kPi * nu.dot(target));
    }
  }
  direct.value /= Sinc(nu.x() / place.scale) * Sinc(nu.y() / place.scale);
  return direct;
}

TEST(MeasureSpectrum, IsTheFourierSumOverTheFramesOwnPixels) {
  struct Case {
    int width_px, height_px;
    FramePlace place;
    TargetWindow window;
  };
  const std::vector<Case> cases = {
      {97, 83, {1, {0, 0}}, {{0, 0}, {80, 70}}},
      {97, 83, {0.83, {3.7, -2.2}}, {{4.5, -3.25}, {71.3, 62.9}}},
      {64, 131, {1.31, {-0.4, 5.1}}, {{-2, 11}, {33.7, 60.1}}},
  };
  for (const Case& c : cases) {
    const cv::Mat grey = WhiteNoise(c.width_px, c.height_px, 0.4, 0.1, 3);
    const Eigen::Vector2d origin(0.5 * c.width_px - 3.2, 0.5 * c.height_px + 1.7);
    const std::vector<Mode> modes = {{0, 2}, {3, 0}, {4, -6}, {5, 7}, {12, -11}, {1, 1}, {2, 20}};
    const auto spectrum = MeasureSpectrum(grey, origin, c.place, c.window, modes, modes.size());
    ASSERT_TRUE(spectrum);
    ASSERT_EQ(spectrum->values.size(), static_cast<Eigen::Index>(modes.size()));
    for (std::size_t k = 0; k < modes.size(); ++k) {
      const Direct direct = DirectSum(grey, origin, c.place, c.window, modes[k]);
      // The values are about 0.25/sqrt(pixels), 3e-3, and are summed in float over 5000 pixels.
      EXPECT_LT(std::abs(spectrum->values[static_cast<Eigen::Index>(k)] - direct.value), 2e-7) << k;
      EXPECT_NEAR(spectrum->mean, direct.mean, 1e-6);
      EXPECT_NEAR(spectrum->noise_gain / direct.noise_gain, 1, 1e-5);
    }
  }
}

TEST(MeasureSpectrum, ReadsAPartOfALargerImage) {
  const cv::Mat whole = WhiteNoise(120, 110, 0.4, 0.1, 9);
  const cv::Mat part = whole(cv::Rect(17, 11, 71, 67));
  const TargetWindow window{{0, 0}, {60, 60}};
  const std::vector<Mode> modes = {{2, 4}, {6, -2}};
  const auto of_part = MeasureSpectrum(part, {35, 33}, {}, window, modes, 2);
  const auto of_copy = MeasureSpectrum(part.clone(), {35, 33}, {}, window, modes, 2);
  ASSERT_TRUE(of_part && of_copy);
  EXPECT_EQ(of_part->values[0], of_copy->values[0]);
  EXPECT_EQ(of_part->values[1], of_copy->values[1]);
}

TEST(MeasureSpectrum, GivesAsManyValuesAsAsked) {
  const cv::Mat grey = WhiteNoise(64, 64, 0.4, 0.1, 9);
  const TargetWindow window{{0, 0}, {50, 50}};
  const std::vector<Mode> modes = {{2, 4}, {6, -2}, {8, 8}};
  const auto all = MeasureSpectrum(grey, {31, 31}, {}, window, modes, 3);
  const auto some = MeasureSpectrum(grey, {31, 31}, {}, window, modes, 2);
  ASSERT_TRUE(all && some);
  ASSERT_EQ(some->values.size(), 2);
  EXPECT_NEAR(std::abs(some->values[1] - all->values[1]), 0, 1e-8);
  const auto none = MeasureSpectrum(grey, {31, 31}, {}, window, modes, 0);
  ASSERT_TRUE(none);
  EXPECT_EQ(none->values.size(), 0);
}

// A cosine of the target, averaged over the box of each pixel (1/scale target px wide) in closed
// form. The result is the cosine itself, whatever the scale of the frame is: half its amplitude
// with its phase at its own mode, and 0 two modes off, where the transform of the squared cosine
// has its first zero.
TEST(MeasureSpectrum, APureCosineComesOutWithoutThePixelsBox) {
  const TargetWindow window{{1.5, -2}, {64, 64}};
  const Mode mode{12, -8};
  const double amplitude = 0.3, phase = 0.7, mean = 0.5;
  const Eigen::Vector2d nu = ModeFrequency(mode, window);
  for (const double scale : {0.8, 1.0, 1.25}) {
    const FramePlace place{scale, {2.3, -1.1}};
    const Eigen::Vector2d origin(60, 58);
    cv::Mat grey(119, 121, CV_32F);
    for (int y = 0; y < grey.rows; ++y) {
      for (int x = 0; x < grey.cols; ++x) {
        const Eigen::Vector2d target = (Eigen::Vector2d(x, y) - origin - place.shift_px) / scale;
        grey.at<float>(y, x) =
            static_cast<float>(mean * (1 + amplitude * Sinc(nu.x() / scale) * Sinc(nu.y() / scale) *
                                               std::cos(2 * kPi * nu.dot(target) + phase)));
      }
    }
    const std::vector<Mode> modes = {mode, {12, -10}, {14, -8}, {4, 20}, {13, -8}};
    const auto spectrum = MeasureSpectrum(grey, origin, place, window, modes, modes.size());
    ASSERT_TRUE(spectrum);
    // The sum over pixels equals the integral except for a remainder that falls with the size of
    // the window.
    const std::complex<double> expected = 0.5 * amplitude * std::polar(1.0, phase);
    EXPECT_LT(std::abs(spectrum->values[0] - expected), 2e-5) << scale;
    for (const int k : {1, 2, 3}) EXPECT_LT(std::abs(spectrum->values[k]), 2e-5) << k;
    // The neighbouring mode is the transform of the Hann window: -1/2 of its middle times the phase
    // of its centre.
    const std::complex<double> next =
        0.5 * expected * std::polar(1.0, -2 * kPi * window.centre_px.x() / window.size_px.x());
    const double box = Sinc(nu.x() / scale) / Sinc((nu.x() + 1 / window.size_px.x()) / scale);
    EXPECT_LT(std::abs(spectrum->values[4] - next * box), 5e-5) << scale;
  }
}

TEST(MeasureSpectrum, BrightnessDropsOut) {
  const cv::Mat grey = WhiteNoise(64, 64, 0.4, 0.1, 9);
  const TargetWindow window{{0, 0}, {50, 50}};
  const std::vector<Mode> modes = {{2, 4}, {6, -2}, {8, 8}};
  const auto one = MeasureSpectrum(grey, {31, 31}, {}, window, modes, 3);
  const auto other = MeasureSpectrum(0.37 * grey, {31, 31}, {}, window, modes, 3);
  ASSERT_TRUE(one && other);
  EXPECT_NEAR(other->mean, 0.37 * one->mean, 1e-6);
  for (int k = 0; k < 3; ++k) EXPECT_LT(std::abs(other->values[k] - one->values[k]), 1e-7);
}

// E |G box|^2 of white noise is noise_gain times the pixel's variance.
TEST(MeasureSpectrum, NoiseGainIsTheScatterOfWhiteNoise) {
  const TargetWindow window{{2, 1}, {52, 44}};
  const FramePlace place{0.9, {1.3, 0.2}};
  const std::vector<Mode> modes = {{4, 6}, {0, 8}, {10, -6}, {16, 2}};
  constexpr double kSigma = 0.02, kMean = 0.4;
  constexpr int kRuns = 500;
  double power = 0, gain = 0, mean = 0, real = 0;
  for (unsigned run = 0; run < kRuns; ++run) {
    const cv::Mat grey = WhiteNoise(64, 60, kMean, kSigma, 100 + run);
    const auto spectrum = MeasureSpectrum(grey, {30, 30}, place, window, modes, modes.size());
    ASSERT_TRUE(spectrum);
    gain += spectrum->noise_gain / kRuns;
    mean += spectrum->mean / kRuns;
    for (std::size_t k = 0; k < modes.size(); ++k) {
      const double box = BoxTransfer(modes[k], window, place.scale);
      const std::complex<double> value = box * spectrum->values[static_cast<Eigen::Index>(k)];
      power += std::norm(value) / static_cast<double>(kRuns * modes.size());
      real += 2 * value.real() * value.real() / static_cast<double>(kRuns * modes.size());
    }
  }
  EXPECT_NEAR(mean, kMean, 3e-4);
  // 2000 exponential draws have an error of 2.2 % each.
  EXPECT_NEAR(power / (gain * kSigma * kSigma), 1, 0.08);
  EXPECT_NEAR(real / (gain * kSigma * kSigma), 1, 0.12);
}

TEST(MeasureSpectrum, AWindowThatLeavesTheFrameGivesNothing) {
  const cv::Mat grey = WhiteNoise(80, 60, 0.4, 0.1, 3);
  const std::vector<Mode> modes = {{2, 2}};
  const Eigen::Vector2d origin(39.5, 29.5);
  const TargetWindow window{{0, 0}, {70, 50}};
  const auto fits = [&](const FramePlace& place, const TargetWindow& w) {
    return MeasureSpectrum(grey, origin, place, w, modes, 1).has_value();
  };
  EXPECT_TRUE(fits({}, window));
  EXPECT_TRUE(fits({1, {4, 4}}, window));
  EXPECT_FALSE(fits({1, {6, 0}}, window));
  EXPECT_FALSE(fits({1, {-6, 0}}, window));
  EXPECT_FALSE(fits({1, {0, 6}}, window));
  EXPECT_FALSE(fits({1, {0, -6}}, window));
  EXPECT_TRUE(fits({1.12, {0, 0}}, window));
  EXPECT_FALSE(fits({1.2, {0, 0}}, window));
  EXPECT_FALSE(fits({}, {{0, 10}, {70, 50}}));
  // The whole frame is still inside.
  EXPECT_TRUE(fits({}, {{0, 0}, {79, 59}}));
}

TEST(MeasureSpectrum, AFrameWithoutLightGivesNothing) {
  const std::vector<Mode> modes = {{2, 2}};
  const TargetWindow window{{0, 0}, {40, 40}};
  for (const double level : {0.0, -0.1}) {
    EXPECT_FALSE(MeasureSpectrum(cv::Mat(64, 64, CV_32F, cv::Scalar(level)), {31, 31}, {}, window,
                                 modes, 1));
  }
}

TEST(BoxTransfer, IsTheSincOfThePixelInTheFrame) {
  const TargetWindow window{{0, 0}, {64, 50}};
  EXPECT_NEAR(BoxTransfer({16, 0}, window, 1), Sinc(0.25), 1e-12);
  EXPECT_NEAR(BoxTransfer({0, -10}, window, 0.5), Sinc(0.4), 1e-12);
  EXPECT_NEAR(BoxTransfer({8, 10}, window, 1.25), Sinc(0.1) * Sinc(0.16), 1e-12);
}

TEST(ModesBetween, AreInOrderAndNoneIsDoubled) {
  const TargetWindow window{{3, 4}, {91.5, 120}};
  const double low = 0.03, high = 0.21;
  const std::vector<Mode> modes = ModesBetween(window, low, high);
  std::set<std::pair<int, int>> seen;
  double last = 0;
  for (const Mode& mode : modes) {
    const double nu = ModeFrequency(mode, window).norm();
    EXPECT_GT(nu, low);
    EXPECT_LT(nu, high);
    EXPECT_GE(nu, last);
    last = nu;
    EXPECT_TRUE(mode.jx > 0 || (mode.jx == 0 && mode.jy > 0));
    EXPECT_EQ(mode.jx % 2, 0);
    EXPECT_EQ(mode.jy % 2, 0);
    EXPECT_TRUE(seen.insert({mode.jx, mode.jy}).second);
    EXPECT_FALSE(seen.count({-mode.jx, -mode.jy}));
  }
  // No mode is missing: the set is every second mode of the half plane.
  std::size_t expected = 0;
  for (int jx = 0; jx < 40; jx += 2) {
    for (int jy = -40; jy < 40; jy += 2) {
      if (jx == 0 && jy <= 0) continue;
      const double nu = std::hypot(jx / 91.5, jy / 120.0);
      expected += nu > low && nu < high ? 1U : 0U;
    }
  }
  EXPECT_EQ(modes.size(), expected);
  EXPECT_TRUE(ModesBetween(window, 0.2, 0.1).empty());
}

TEST(ModeFrequency, IsInCyclesPerTargetPixel) {
  const Eigen::Vector2d nu = ModeFrequency({3, -4}, {{0, 0}, {60, 80}});
  EXPECT_DOUBLE_EQ(nu.x(), 0.05);
  EXPECT_DOUBLE_EQ(nu.y(), -0.05);
}

}  // namespace
}  // namespace thicklens::calib
