// Shading of the frame in simulated sweeps, distinguished from that of the target.
#include "calib/registration/frame_shading.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "tests/calib/damaged_sweep.h"
#include "tests/calib/simulated_sweep.h"
#include "tests/calib/tracked_sweep.h"

namespace thicklens::calib {
namespace {

using ::testing::HasSubstr;
using namespace thicklens::testing;

constexpr int kSizePx = 224;

SimulatedSweep CleanOf(std::uint64_t seed) { return Simulate(SweepCase("ii", kSizePx, seed)); }

// cos^4 of a field angle, off the middle, times a lamp that is brighter on two sides: neither is a
// polynomial.
cv::Mat Uneven(double corner) {
  cv::Mat gain(kSizePx, kSizePx, CV_32F);
  const double corner2 = 2 * std::pow(0.5 * kSizePx, 2);
  const double tangent2 = (1 / std::sqrt(corner) - 1) / corner2;
  for (int y = 0; y < kSizePx; ++y) {
    for (int x = 0; x < kSizePx; ++x) {
      const double r2 = std::pow(x - 0.47 * kSizePx, 2) + std::pow(y - 0.52 * kSizePx, 2);
      const double lamp = 1 + 0.1 * std::cos(3.0 * x / kSizePx);
      gain.at<float>(y, x) = static_cast<float>(lamp * std::pow(1 + tangent2 * r2, -2));
    }
  }
  return gain;
}

TEST(FrameShading, ACleanSweepHasNone) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const SimulatedSweep s = CleanOf(seed);
    const FrameShading found = MeasureShading(TrackedPlaces(s), 1);
    ASSERT_TRUE(found.done) << found.message;
    EXPECT_FALSE(found.is_significant) << seed;
    ASSERT_TRUE(found.corner_stops);
    EXPECT_LT(std::abs(found.corner_stops->value), 4 * found.corner_stops->sigma + 0.03) << seed;
    EXPECT_LT(found.corner_stops->sigma, 0.3);
  }
}

// The gain that remains after the division must be even. A constant and a slope are free.
double UnevennessAfter(const FrameShading& found, const cv::Mat& gain) {
  cv::Mat rest;
  cv::log(gain, rest);
  rest -= LogOfShading(found, gain.size());
  double worst = 0;
  for (int y = 0; y < kSizePx; y += 8) {
    for (int x = 0; x < kSizePx; x += 8) {
      // The mean of opposite places has no slope.
      const double here =
          0.5 * static_cast<double>(rest.at<float>(y, x) +
                                    rest.at<float>(kSizePx - 1 - y, kSizePx - 1 - x));
      const double centre = static_cast<double>(rest.at<float>(kSizePx / 2, kSizePx / 2));
      worst = std::max(worst, std::abs(here - centre));
    }
  }
  return worst;
}

TEST(FrameShading, IsRecoveredWithinItsError) {
  for (const double corner : {0.5, 0.25}) {
    for (std::uint64_t seed = 1; seed <= 2; ++seed) {
      SimulatedSweep s = CleanOf(seed);
      const cv::Mat gain = Uneven(corner);
      MultiplyLight(&s, gain);
      const FrameShading found = MeasureShading(TrackedPlaces(s), 1);
      ASSERT_TRUE(found.is_significant) << found.message;
      const double sigma = std::log(2.0) * found.corner_stops->sigma;
      EXPECT_LT(sigma, 0.15);
      EXPECT_LT(UnevennessAfter(found, gain), 4 * sigma + 0.03) << corner << " seed " << seed;
    }
  }
}

// Light that is uneven on the target moves with it and must stay.
TEST(FrameShading, UnevennessOfTheTargetIsNone) {
  SimulatedSweep s = CleanOf(2);
  const cv::Mat gain = Uneven(0.4);
  const std::size_t reference = s.stored->size() / 2;
  for (std::size_t i = 0; i < s.stored->size(); ++i) {
    // The field of the reference is scaled with the target about the middle, beyond its own border.
    const double scale = s.TrueScale(i, reference), middle = 0.5 * (kSizePx - 1);
    const cv::Matx23d map(scale, 0, (1 - scale) * middle, 0, scale, (1 - scale) * middle);
    cv::Mat wide, moved;
    const int margin = 40;
    cv::copyMakeBorder(gain, wide, margin, margin, margin, margin, cv::BORDER_REFLECT_101);
    const cv::Matx23d in_wide(scale, 0, map(0, 2) + (1 - scale) * margin, 0, scale,
                              map(1, 2) + (1 - scale) * margin);
    cv::warpAffine(wide, moved, in_wide, wide.size(), cv::INTER_LINEAR);
    SimulatedSweep one = s;
    one.stored = std::make_shared<std::vector<cv::Mat>>(1, (*s.stored)[i]);
    MultiplyLight(&one, moved(cv::Rect(margin, margin, kSizePx, kSizePx)).clone());
  }
  const FrameShading found = MeasureShading(TrackedPlaces(s), 1);
  ASSERT_TRUE(found.corner_stops) << found.message;
  EXPECT_LT(std::abs(found.corner_stops->value), 4 * found.corner_stops->sigma + 0.06);
}

TEST(FrameShading, WithoutAChangeOfScaleItCannotBeTold) {
  SimulatedSweep s = CleanOf(1);
  MultiplyLight(&s, Uneven(0.25));
  FramePlaces places = TrackedPlaces(s);
  // Frames of one scale, as a telecentric lens gives them: all are the reference.
  const std::size_t reference = s.stored->size() / 2;
  places.read_grey = [&s, reference](std::size_t) {
    return LinearGrey((*s.stored)[reference], s.sweep, reference);
  };
  for (ScaleSample& sample : places.samples) {
    sample.scale = 1;
    sample.registration = Registration();
  }
  const FrameShading found = MeasureShading(places, 1);
  EXPECT_FALSE(found.is_significant);
  EXPECT_FALSE(found.corner_stops);
  EXPECT_THAT(found.message, HasSubstr("changes too little"));
}

}  // namespace
}  // namespace thicklens::calib
