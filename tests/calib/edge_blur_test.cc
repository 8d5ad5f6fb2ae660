#include "thicklens/calib/edge_blur.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "drawn_edges.h"
#include "simulated_sweep.h"
#include "support/error_message.h"

namespace thicklens::calib {
namespace {

using thicklens::testing::DrawnEdge;
using thicklens::testing::SimulatedSweep;
using thicklens::testing::Stored;
using thicklens::testing::SweepCase;

constexpr double kPixelBoxPx2 = 1.0 / 12;

// Frames of a sweep as linear grey, without drift, flicker and errors of the readings.
struct Textures {
  model::SweepTruth truth;
  std::vector<cv::Mat> grey;
  cv::Point2d centre;
  model::Psf psf = model::Psf::kGaussian;

  const model::SweepTruth::Frame& True(std::size_t i) const { return truth.frames[i]; }
};
Textures Render(model::SweepSimulationOptions options, double first_depth_mm, double step_mm,
                int count) {
  options.drift_sigma_px = options.flicker = options.reading_sigma_mm = 0;
  options.first_depth_mm = first_depth_mm;
  options.step_mm = step_mm;
  options.frame_count = count;
  const SimulatedSweep rendered = thicklens::testing::Simulate(options);
  Textures result;
  result.truth = rendered.truth;
  result.centre = {options.camera.sensor.principal_point_px.x(),
                   options.camera.sensor.principal_point_px.y()};
  result.psf = options.camera.psf;
  for (std::size_t i = 0; i < rendered.stored->size(); ++i)
    result.grey.push_back(LinearGrey((*rendered.stored)[i], rendered.sweep, i));
  return result;
}

// What the meter is off by, px: the pixel's and the operator's boxes are taken out by their
// variances alone, as if they were Gaussian, which reads a sharp edge too soft.
double MeterBoundPx(double sigma_px) { return 0.014 / std::pow(sigma_px, 1.5); }

TEST(MeasureEdgeVariance, IsTrueAtDrawnEdgesOfAnyDirection) {
  for (const double angle_deg : {0.0, 5.0, 22.0, 45.0, 95.0, 200.0}) {
    for (const double sigma_px : {0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0}) {
      const auto blur = MeasureEdgeVariance(DrawnEdge(128, angle_deg, sigma_px, 0.2, 0.8));
      ASSERT_TRUE(blur) << angle_deg << " " << sigma_px;
      EXPECT_NEAR(std::sqrt(blur->variance_px2), sigma_px, MeterBoundPx(sigma_px))
          << angle_deg << " degrees";
    }
  }
}

TEST(MeasureEdgeVariance, HoldsWithNoiseAndEightBits) {
  unsigned seed = 1;
  for (const double angle_deg : {5.0, 40.0, 95.0}) {
    for (const double sigma_px : {0.5, 1.0, 2.0, 4.0, 6.0}) {
      const cv::Mat edge = DrawnEdge(192, angle_deg, sigma_px, 0.2, 0.8);
      const auto blur = MeasureEdgeVariance(Stored(edge, 1, 256, ++seed));
      ASSERT_TRUE(blur) << angle_deg << " " << sigma_px;
      EXPECT_NEAR(std::sqrt(blur->variance_px2), sigma_px,
                  MeterBoundPx(sigma_px) + 0.006 + 0.003 * sigma_px)
          << angle_deg << " degrees";
    }
  }
}

TEST(MeasureEdgeVariance, ErrorIsTheScatterOverNoise) {
  const cv::Mat edge = DrawnEdge(160, 8, 1.2, 0.2, 0.8);
  double mean = 0, squares = 0, stated = 0;
  constexpr int kRuns = 60;
  for (int run = 0; run < kRuns; ++run) {
    const auto blur = MeasureEdgeVariance(Stored(edge, 2, 256, 100U + static_cast<unsigned>(run)));
    ASSERT_TRUE(blur);
    mean += blur->variance_px2 / kRuns;
    squares += blur->variance_px2 * blur->variance_px2 / kRuns;
    stated += blur->error_px2 / kRuns;
  }
  const double scatter = std::sqrt(squares - mean * mean);
  EXPECT_GT(stated, 0.6 * scatter);
  EXPECT_LT(stated, 2 * scatter);
}

TEST(MeasureEdgeVariance, SaysNothingWithoutEdges) {
  EXPECT_FALSE(MeasureEdgeVariance(cv::Mat(64, 64, CV_32F, cv::Scalar(0.4))));
  EXPECT_FALSE(MeasureEdgeVariance(cv::Mat(64, 64, CV_32F, cv::Scalar(0.4)), kCoarseEdges));
}

TEST(MeasureSourceEdgeBlur, IsNearlyFlatBelowSevenTenthsOfAPixel) {
  // What a study of the source's meter found on slanted edges.
  const auto measure = [](double sigma_px) {
    const auto blur = MeasureSourceEdgeBlur(DrawnEdge(128, 5, sigma_px, 0.2, 0.8));
    return blur ? blur->sigma_px : -1;
  };
  EXPECT_NEAR(measure(0.3), 0.83, 0.06);
  EXPECT_NEAR(measure(0.7), 0.99, 0.06);
  EXPECT_NEAR(measure(1), 1.21, 0.06);
  EXPECT_NEAR(measure(2), 2.10, 0.06);
  // Of .4 px of change it shows less than half.
  EXPECT_LT(measure(0.7) - measure(0.3), 0.2);
}

TEST(EdgeMeterSlope, IsOneAtEdgesAndLessInTextures) {
  model::SweepSimulationOptions options = SweepCase("ii", 256, 3);
  options.target.ink_sigma_mm = 0.02;
  const auto slope_on = [&](model::TargetKind kind) {
    options.target.kind = kind;
    const Textures textures = Render(options, 300.2, 1, 1);
    const auto slope = EdgeMeterSlope(textures.grey[0], 0.004, textures.psf);
    return slope.value_or(-1);
  };
  EXPECT_NEAR(slope_on(model::TargetKind::kKnifeEdge), 1, 0.04);
  EXPECT_NEAR(slope_on(model::TargetKind::kPrintedEdge), 1, 0.04);
  const double pink = slope_on(model::TargetKind::kPinkNoise);
  EXPECT_GT(pink, 0);
  EXPECT_LT(pink, 0.8);
  EXPECT_LT(slope_on(model::TargetKind::kDeadLeaves), 0.9);
}

TEST(MeasureAddedVariance, IsTrueOnATextureAtEveryScale) {
  // Case iii: from 1.25 times the reference's size to 0.8 times, blurs up to 2.75 px.
  for (const unsigned seed : {1U, 2U}) {
    const Textures t = Render(SweepCase("iii", 320, seed), 320, 20, 10);
    constexpr std::size_t kReference = 4;  // 400 mm, in focus
    const double reference_px2 = std::pow(t.True(kReference).blur_sigma_px, 2);
    for (std::size_t i = 0; i < t.grey.size(); ++i) {
      if (i == kReference) continue;
      const double depth_mm = t.True(i).depth_mm;
      const double scale = t.True(kReference).depth_mm / depth_mm;
      const double truth_px2 = std::pow(t.True(i).blur_sigma_px, 2) + kPixelBoxPx2 -
                               scale * scale * (reference_px2 + kPixelBoxPx2);
      const auto added =
          MeasureAddedVariance(t.grey[kReference], t.grey[i], scale, t.centre, 0.005, t.psf);
      ASSERT_TRUE(added) << depth_mm;
      EXPECT_NEAR(added->variance_px2, truth_px2, 0.02 + 0.04 * truth_px2) << depth_mm << " mm";
    }
  }
}

TEST(MeasureAddedVariance, IsNegativeWhereTheFrameIsTheSharperOne) {
  const Textures t = Render(SweepCase("iii", 256, 4), 400, 20, 2);
  const double scale = t.True(1).depth_mm / t.True(0).depth_mm;
  const double truth_px2 = std::pow(t.True(0).blur_sigma_px, 2) + kPixelBoxPx2 -
                           scale * scale * (std::pow(t.True(1).blur_sigma_px, 2) + kPixelBoxPx2);
  ASSERT_LT(truth_px2, -0.1);
  const auto added = MeasureAddedVariance(t.grey[1], t.grey[0], scale, t.centre, 0.005, t.psf);
  ASSERT_TRUE(added);
  EXPECT_NEAR(added->variance_px2, truth_px2, 0.3 * std::abs(truth_px2));
}

TEST(MeasureAddedVariance, SaysNothingOfAFrameWithoutTheTarget) {
  const Textures t = Render(SweepCase("iii", 192, 5), 400, 1, 1);
  const cv::Mat flat(192, 192, CV_32F, cv::Scalar(0.4));
  EXPECT_FALSE(MeasureAddedVariance(t.grey[0], flat, 1, t.centre, 0.005, t.psf));
}

}  // namespace
}  // namespace thicklens::calib
