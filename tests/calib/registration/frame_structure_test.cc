// Structure of the frame or of the light, found in simulated sweeps that contain it.
#include "calib/registration/frame_structure.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <string>

#include "calib/registration/scale_tracking.h"
#include "tests/calib/damaged_sweep.h"
#include "tests/calib/simulated_sweep.h"

namespace thicklens::calib {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using namespace thicklens::testing;

constexpr int kSizePx = 192;

const SimulatedSweep& Clean() {
  static const SimulatedSweep rendered = Simulate(SweepCase("ii", kSizePx, 1));
  return rendered;
}

FrameStructureFinding Found(const SimulatedSweep& s) {
  FramePlaces places{s.sweep,
                     [&s](std::size_t i) { return LinearGrey((*s.stored)[i], s.sweep, i); },
                     {},
                     {},
                     RegionCentre(s.sweep),
                     {}};
  for (std::size_t i = 0; i < s.sweep.frames.size(); ++i) places.used.push_back(i);
  places.samples = TrackScale(s.sweep, places.read_grey, places.used, places.used.size() / 2,
                              std::nullopt, 1, [] {});
  return MeasureStructure(places);
}

TEST(FrameStructure, ACleanSweepHasNone) {
  const FrameStructureFinding found = Found(Clean());
  EXPECT_TRUE(found.measured);
  EXPECT_FALSE(found.HasVignetting());
  EXPECT_FALSE(found.HasBands());
  EXPECT_FALSE(found.HasFixedStructure());
  EXPECT_EQ(StructureInWords(found), "");
  ASSERT_TRUE(found.vignetting && found.bands && found.fixed_structure) << "and it was looked for";
  // A small image cannot exclude weak vignetting, and its stated error shows that.
  EXPECT_LT(found.vignetting->sigma, 0.3);
  EXPECT_FALSE(VignettingIsExcluded(found));
}

TEST(FrameStructure, VignettingIsMeasured) {
  for (const double loss : {0.6, 0.75}) {
    SimulatedSweep s = DeepCopy(Clean());
    Vignette(&s, loss);
    const FrameStructureFinding found = Found(s);
    ASSERT_TRUE(found.HasVignetting()) << loss;
    // ln(1 - loss q) is not a parabola; the result is its slope over the middle of the field.
    EXPECT_NEAR(found.vignetting->value, std::log(1 - loss), 0.35 * -std::log(1 - loss));
    EXPECT_FALSE(found.HasBands() || found.HasFixedStructure());
    EXPECT_THAT(StructureInWords(found), AllOf(HasSubstr("the corners are"), HasSubstr("darker"),
                                               Not(HasSubstr("flickers"))));
  }
}

// A lamp that flickers under a rolling shutter makes bands with an independent phase in each frame.
void AddBands(SimulatedSweep* s, double amplitude, double period_px, bool along_columns) {
  std::mt19937 engine(3);
  for (cv::Mat& frame : *s->stored) {
    const double phase = static_cast<double>(engine()) / 4294967296.0 * 2 * CV_PI;
    for (int y = 0; y < frame.rows; ++y) {
      for (int x = 0; x < frame.cols; ++x) {
        const double at = along_columns ? x : y;
        const double gain = 1 + amplitude * std::sin(2 * CV_PI * at / period_px + phase);
        frame.at<std::uint8_t>(y, x) =
            cv::saturate_cast<std::uint8_t>(gain * frame.at<std::uint8_t>(y, x));
      }
    }
  }
}

TEST(FrameStructure, BandsOfTheLightAreFoundAlongTheirDirection) {
  for (const bool along_columns : {false, true}) {
    SimulatedSweep s = DeepCopy(Clean());
    AddBands(&s, 0.1, 24, along_columns);
    const FrameStructureFinding found = Found(s);
    ASSERT_TRUE(found.HasBands());
    EXPECT_EQ(found.bands_are_columns, along_columns);
    // The ratio of two sines with random phases has the standard deviation of their amplitude.
    EXPECT_NEAR(found.bands->value, 0.1 / std::sqrt(2.0), 0.02);
    EXPECT_THAT(StructureInWords(found),
                HasSubstr(along_columns ? "whole columns brighten" : "whole rows brighten"));
  }
}

// The stripes of a target are not evidence of bands in the light.
TEST(FrameStructure, AStripedTargetIsNotTakenForBands) {
  model::SweepSimulationOptions options = SweepCase("ii", kSizePx, 1);
  options.target.kind = model::TargetKind::kPrintedEdge;
  const FrameStructureFinding found = Found(Thinned(Simulate(options), 3));
  EXPECT_FALSE(found.HasBands());
}

TEST(FrameStructure, WhatStaysOnTheSensorIsFound) {
  SimulatedSweep s = DeepCopy(Clean());
  const cv::Size size = s.frame(0).size();
  cv::Mat gain(size, CV_32F, cv::Scalar(1));
  // The specks are near the corners, where the target moves by more than the width of a speck.
  for (const int x : {36, 47, 145, 156}) {
    for (const int y : {36, 47, 145, 156}) gain -= 0.3 * Spot(size, cv::Point2d(x, y), 2);
  }
  ApplyToEachFrame(&s, gain, cv::Mat::zeros(size, CV_32F));
  const FrameStructureFinding found = Found(s);
  EXPECT_TRUE(found.HasFixedStructure());
  EXPECT_FALSE(found.HasBands());
  EXPECT_THAT(StructureInWords(found), HasSubstr("stays at the same place in every frame"));
}

}  // namespace
}  // namespace thicklens::calib
