// Bands of a lamp that flickers under a rolling shutter, recovered from simulated sweeps.
#include "calib/registration/frame_bands.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/calib/damaged_sweep.h"
#include "tests/calib/simulated_sweep.h"
#include "tests/calib/tracked_sweep.h"

namespace thicklens::calib {
namespace {

using namespace thicklens::testing;

constexpr int kSidePx = 224;

// ln of the gain of line `line` of frame `frame`; the phases follow the golden section.
double TrueLogGain(std::size_t frame, int line, double amplitude, double period_px) {
  const double phase = 0.618034 * static_cast<double>(frame * (frame + 3));
  return std::log(1 + amplitude * std::sin(2 * CV_PI * (line / period_px + phase)));
}

SimulatedSweep Banded(const SimulatedSweep& clean, double amplitude, double period_px,
                      bool along_columns) {
  SimulatedSweep s = DeepCopy(clean);
  const model::TransferCurve& transfer = s.sweep.camera.sensor.transfer;
  for (std::size_t i = 0; i < s.stored->size(); ++i) {
    cv::Mat& frame = (*s.stored)[i];
    for (int y = 0; y < frame.rows; ++y) {
      for (int x = 0; x < frame.cols; ++x) {
        auto& value = frame.at<std::uint8_t>(y, x);
        const double gain = std::exp(TrueLogGain(i, along_columns ? x : y, amplitude, period_px));
        value = cv::saturate_cast<std::uint8_t>(
            255 * transfer.Encode(gain * transfer.Decode(value / 255.0)));
      }
    }
  }
  return s;
}

const SimulatedSweep& CleanLight() {
  static const SimulatedSweep rendered = Thinned(Simulate(SweepCase("ii", kSidePx, 1)), 2);
  return rendered;
}

std::optional<BandAxis> Suspected(const SimulatedSweep& s) {
  std::vector<LightProfiles> profiles;
  for (std::size_t i = 0; i < s.stored->size(); ++i)
    profiles.push_back(ProfilesOf(LinearGrey((*s.stored)[i], s.sweep, i)));
  std::vector<const LightProfiles*> in_order;
  for (const LightProfiles& profile : profiles) in_order.push_back(&profile);
  return SuspectedBands(in_order, {}, RegionCentre(s.sweep));
}

TEST(FrameBands, EvenLinesDoNotDependOnBands) {
  cv::Mat light(20, 30, CV_32F);
  for (int y = 0; y < light.rows; ++y) {
    for (int x = 0; x < light.cols; ++x)
      light.at<float>(y, x) = static_cast<float>(0.4 + 0.2 * std::sin(0.7 * x + 0.3 * y * y));
  }
  cv::Mat banded = light.clone();
  for (int y = 0; y < light.rows; ++y) {
    for (int x = 0; x < light.cols; ++x)
      banded.at<float>(y, x) *= static_cast<float>(1 + 0.3 * std::sin(0.9 * y));
  }
  const cv::Mat even = WithEvenLines(light, BandAxis::kRows);
  const cv::Mat of_banded = WithEvenLines(banded, BandAxis::kRows);
  const double gain = cv::mean(even)[0] / cv::mean(of_banded)[0];
  EXPECT_LT(cv::norm(even, gain * of_banded, cv::NORM_INF), 1e-5);
  cv::Mat rows;
  cv::reduce(even, rows, 1, cv::REDUCE_AVG);
  EXPECT_LT(cv::norm(rows, cv::Mat(rows.size(), CV_32F, cv::mean(even)), cv::NORM_INF), 1e-5);
}

TEST(FrameBands, AreSuspectedAlongTheirLinesAlone) {
  EXPECT_FALSE(Suspected(CleanLight()));
  EXPECT_EQ(Suspected(Banded(CleanLight(), 0.15, 24, false)), BandAxis::kRows);
  EXPECT_EQ(Suspected(Banded(CleanLight(), 0.15, 24, true)), BandAxis::kColumns);
}

TEST(FrameBands, LinesOfTheTargetAreNotSuspected) {
  SimulatedSweep s = DeepCopy(CleanLight());
  for (std::size_t i = 0; i < s.stored->size(); ++i) {
    cv::Mat& frame = (*s.stored)[i];
    // The lines move with the target, by up to 2 px.
    const double moved = 2 * std::sin(2.4 * static_cast<double>(i));
    for (int y = 0; y < frame.rows; ++y) {
      frame.row(y).convertTo(frame.row(y), -1, 1 + 0.5 * std::sin((y - moved) / 3.0));
    }
  }
  EXPECT_FALSE(Suspected(s));
}

TEST(FrameBands, AreRecoveredLineByLine) {
  for (const bool along_columns : {false, true}) {
    const SimulatedSweep s = Banded(CleanLight(), 0.15, 24, along_columns);
    FramePlaces places = TrackedPlaces(CleanLight());
    places.read_grey = [&s](std::size_t i) { return LinearGrey((*s.stored)[i], s.sweep, i); };
    const FrameBands found =
        MeasureBands(places, along_columns ? BandAxis::kColumns : BandAxis::kRows, 1);
    ASSERT_TRUE(found.done) << found.message;
    EXPECT_TRUE(found.is_significant);
    EXPECT_NEAR(found.deviation.value, 0.15 / std::sqrt(2.0), 0.01);
    ASSERT_TRUE(found.period_px);
    EXPECT_NEAR(*found.period_px, 24, 0.6);
    std::vector<double> off;
    for (std::size_t i = 0; i < found.log_gain.size(); ++i) {
      double mean = 0;
      for (int y = 0; y < kSidePx; ++y) mean += TrueLogGain(i, y, 0.15, 24) / kSidePx;
      double squares = 0;
      for (int y = 0; y < kSidePx; ++y) {
        squares += std::pow(found.log_gain[i][static_cast<std::size_t>(y)] -
                                (TrueLogGain(i, y, 0.15, 24) - mean),
                            2) /
                   kSidePx;
      }
      off.push_back(std::sqrt(squares));
    }
    std::sort(off.begin(), off.end());
    // The part that the bands have in common, 0.106 over the root of the frames, may go to the
    // target.
    EXPECT_LT(off[off.size() / 2], 0.04);
  }
}

TEST(FrameBands, ACleanSweepHasNoSignificantOnes) {
  const FramePlaces places = TrackedPlaces(CleanLight());
  for (const BandAxis axis : {BandAxis::kRows, BandAxis::kColumns}) {
    const FrameBands found = MeasureBands(places, axis, 1);
    ASSERT_TRUE(found.done) << found.message;
    EXPECT_FALSE(found.is_significant) << found.deviation.value;
  }
}

TEST(FrameBands, TooFewRegisteredFramesAreRefused) {
  FramePlaces places = TrackedPlaces(CleanLight());
  places.samples.resize(3);
  const FrameBands found = MeasureBands(places, BandAxis::kRows, 1);
  EXPECT_FALSE(found.done);
  EXPECT_EQ(found.message, "too few frames could be registered");
}

}  // namespace
}  // namespace thicklens::calib
