// Dust, defective pixels and columns, planted in simulated sweeps.
#include "calib/registration/sensor_defects.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "calib/sharpness/edge_pixels.h"
#include "tests/calib/damaged_sweep.h"
#include "tests/calib/simulated_sweep.h"
#include "tests/calib/tracked_sweep.h"

namespace thicklens::calib {
namespace {

using namespace thicklens::testing;

constexpr int kSizePx = 224;

SensorDefects Found(const SimulatedSweep& s) {
  const FramePlaces places = TrackedPlaces(s);
  std::vector<double> sharpness;
  for (const std::size_t i : places.used)
    sharpness.push_back(Quantile(CentralGradient(places.read_grey(i)).magnitude, 0.99));
  return FindSensorDefects(places, places.used.size() / 2, sharpness, 1);
}

SimulatedSweep CleanOf(std::uint64_t seed) { return Simulate(SweepCase("ii", kSizePx, seed)); }

TEST(SensorDefects, ACleanSweepHasNone) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const SensorDefects found = Found(CleanOf(seed));
    ASSERT_TRUE(found.done) << found.message;
    EXPECT_FALSE(found.Any()) << "seed " << seed << ": " << found.specks << " specks, "
                              << found.defective_px << " px, columns " << found.column_deviation;
  }
}

// The shading of the specks is recovered where it was planted, and nothing else is changed.
TEST(SensorDefects, SpecksAreFoundWithWhatTheyLetThrough) {
  for (std::uint32_t seed = 1; seed <= 3; ++seed) {
    for (const double depth : {0.25, 0.45}) {
      SimulatedSweep s = CleanOf(seed);
      const cv::Mat gain = GainOfSpecks({kSizePx, kSizePx}, 5, depth, 20 + seed);
      MultiplyLight(&s, gain);
      const SensorDefects found = Found(s);
      EXPECT_GE(found.specks, 3) << seed;
      EXPECT_LE(found.specks, 5) << seed;
      EXPECT_NEAR(found.deepest_speck, depth, 0.15);
      cv::Mat rest;
      cv::log(gain, rest);
      const double before = cv::norm(rest, cv::NORM_L2);
      rest -= found.log_gain;
      rest.setTo(0, found.filled);
      EXPECT_LT(cv::norm(rest, cv::NORM_L2), 0.35 * before) << seed << " depth " << depth;
      cv::Mat elsewhere = cv::abs(found.log_gain);
      elsewhere.setTo(0, gain < 0.999);
      EXPECT_LT(cv::countNonZero(elsewhere), 0.01 * kSizePx * kSizePx);
    }
  }
}

TEST(SensorDefects, HotAndDeadPixelsAreFilled) {
  SimulatedSweep s = CleanOf(4);
  const std::vector<std::pair<cv::Point, int>> planted = {
      {{40, 50}, 255}, {{170, 60}, 0}, {{60, 180}, 230}, {{180, 190}, 10}};
  for (cv::Mat& frame : *s.stored) {
    for (const auto& [at, value] : planted)
      frame.at<std::uint8_t>(at) = static_cast<std::uint8_t>(value);
  }
  const SensorDefects found = Found(s);
  EXPECT_EQ(found.specks, 0);
  EXPECT_EQ(found.defective_px, 4);
  for (const auto& [at, value] : planted) EXPECT_NE(found.filled.at<std::uint8_t>(at), 0) << at;
  EXPECT_LT(cv::countNonZero(found.filled), 60);
}

TEST(SensorDefects, ColumnsOfUnequalGainAreFound) {
  SimulatedSweep s = CleanOf(5);
  std::mt19937 engine(8);
  cv::Mat gain(kSizePx, kSizePx, CV_32F);
  double squares = 0;
  for (int x = 0; x < kSizePx; ++x) {
    // A sum of four uniform numbers is nearly normal.
    double sum = -2;
    for (int k = 0; k < 4; ++k) sum += static_cast<double>(engine()) / 4294967296.0;
    const double off = 0.02 * std::sqrt(3.0) * sum;
    squares += off * off / kSizePx;
    gain.col(x).setTo(1 + off);
  }
  MultiplyLight(&s, gain);
  const SensorDefects found = Found(s);
  EXPECT_NEAR(found.column_deviation, std::sqrt(squares), 0.3 * std::sqrt(squares));
  EXPECT_EQ(found.row_deviation, 0);
  cv::Mat before;
  cv::log(gain, before);
  EXPECT_LT(cv::norm(before - found.log_gain), 0.6 * cv::norm(before));
}

// A second round finds that one speck is shallower than it seemed, and one more.
TEST(SensorDefects, FindingsOfTwoRoundsAddUp) {
  SensorDefects first, second;
  first.done = second.done = true;
  first.log_gain = cv::Mat::zeros(60, 80, CV_32F);
  first.filled = cv::Mat::zeros(60, 80, CV_8U);
  second.log_gain = first.log_gain.clone();
  second.filled = first.filled.clone();
  const cv::Rect a(10, 10, 6, 6), b(40, 30, 5, 8);
  first.log_gain(a).setTo(-0.9);
  first.specks = 1;
  first.deepest_speck = 0.6;
  second.log_gain(a).setTo(0.4);
  second.log_gain(b).setTo(-0.3);
  second.specks = 2;
  const SensorDefects both = WithMore(first, second);
  EXPECT_EQ(both.specks, 2);
  EXPECT_NEAR(both.deepest_speck, 1 - std::exp(-0.5), 1e-6);
  EXPECT_NEAR(both.divided_share, (36 + 40) / 4800.0, 1e-9);
  EXPECT_EQ(both.filled_share, 0);
  EXPECT_EQ(first.log_gain.at<float>(12, 12), -0.9F);  // the first finding stays as it was
  // A speck that the second round takes back altogether does not count.
  second.log_gain(a).setTo(0.9);
  EXPECT_EQ(WithMore(first, second).specks, 1);
  EXPECT_EQ(WithMore(first, SensorDefects()).specks, 1);
}

}  // namespace
}  // namespace thicklens::calib
