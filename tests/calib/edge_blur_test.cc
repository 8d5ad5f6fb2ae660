#include "thicklens/calib/edge_blur.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
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

// The sweep's frames without drift, flicker and reading error, as linear grey.
struct Textures {
  model::SweepTruth truth;
  std::vector<cv::Mat> grey;
  cv::Point2d centre;
  model::Psf psf;
};
Textures Render(model::SweepSimulationOptions options, const std::vector<double>& depths_mm) {
  options.drift_sigma_px = options.flicker = options.reading_sigma_mm = 0;
  options.frame_count = 1;
  Textures result;
  result.centre = {options.camera.sensor.principal_point_px.x(),
                   options.camera.sensor.principal_point_px.y()};
  result.psf = options.camera.psf;
  for (const double depth_mm : depths_mm) {
    options.first_depth_mm = depth_mm;
    const SimulatedSweep one = thicklens::testing::Simulate(options);
    result.grey.push_back(LinearGrey((*one.stored)[0], one.sweep, 0));
    result.truth.frames.push_back(one.truth.frames[0]);
  }
  return result;
}

// What the meter is off by, px: the pixel's and the operator's boxes are taken out by their variances
// alone, as if they were Gaussian, which reads a sharp edge too soft.
double MeterBoundPx(double sigma_px) { return 0.014 / std::pow(sigma_px, 1.5); }

TEST(MeasureEdgeVariance, IsTrueAtDrawnEdgesOfAnyDirection) {
  for (const double angle_deg : {0.0, 5.0, 22.0, 45.0, 95.0, 200.0}) {
    for (const double sigma_px : {0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0}) {
      const auto blur = MeasureEdgeVariance(DrawnEdge(128, angle_deg, sigma_px, 0.2, 0.8));
      ASSERT_TRUE(blur) << angle_deg << " " << sigma_px;
      if (std::getenv("MEASURE")) printf("E %g %g %.4f\n", angle_deg, sigma_px, std::sqrt(blur->variance_px2)-sigma_px);
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
      const double error_px2 = blur->variance_px2 - sigma_px * sigma_px;
      if (std::getenv("MEASURE")) printf("N %g %g %.4f rel %.4f err %.4f pull %.2f\n", angle_deg, sigma_px, std::sqrt(blur->variance_px2)-sigma_px, error_px2/sigma_px/sigma_px, blur->error_px2, error_px2/blur->error_px2);
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
  if (std::getenv("MEASURE")) printf("S scatter %.4f stated %.4f mean err %.4f\n", scatter, stated, mean-1.44);
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
    if (std::getenv("MEASURE")) printf("Z %g %.4f\n", sigma_px, blur ? blur->sigma_px : -1);
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
  const auto slope_on = [&](model::TargetKind kind) {
    options.target.kind = kind;
    const Textures textures = Render(options, {300.2});
    const auto slope = EdgeMeterSlope(textures.grey[0], 0.004, textures.psf);
    if (std::getenv("MEASURE")) printf("M %d %.4f\n", static_cast<int>(kind), slope.value_or(-1));
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
  // Case iii: from 1.25 times the reference's size to 0.83 times, blurs up to 2.9 px.
  const std::vector<double> depths_mm = {400, 320, 335, 350, 365, 440, 460, 480, 500};
  for (const unsigned seed : {1U, 2U}) {
    const Textures t = Render(SweepCase("iii", 320, seed), depths_mm);
    const double reference_px2 = std::pow(t.truth.frames[0].blur_sigma_px, 2);
    for (std::size_t i = 1; i < depths_mm.size(); ++i) {
      const double scale = depths_mm[0] / depths_mm[i];
      const double sigma_px = t.truth.frames[i].blur_sigma_px;
      const double truth_px2 = sigma_px * sigma_px + kPixelBoxPx2 -
                               scale * scale * (reference_px2 + kPixelBoxPx2);
      const auto added =
          MeasureAddedVariance(t.grey[0], t.grey[i], scale, t.centre, 0.005, t.psf);
      ASSERT_TRUE(added) << depths_mm[i];
      if (std::getenv("MEASURE")) printf("A z %g scale %.3f sigma %.2f truth %.4f got %.4f +- %.4f rel %.3f\n", depths_mm[i], scale, sigma_px, truth_px2, added->variance_px2, added->error_px2, added->variance_px2/truth_px2-1);
      EXPECT_NEAR(added->variance_px2, truth_px2, 0.03 + 0.05 * truth_px2) << depths_mm[i] << " mm";
    }
  }
}

TEST(MeasureAddedVariance, IsNegativeWhereTheFrameIsTheSharperOne) {
  const Textures t = Render(SweepCase("iii", 256, 4), {400, 420});
  const double scale = 420.0 / 400.0;
  const double truth_px2 =
      std::pow(t.truth.frames[0].blur_sigma_px, 2) + kPixelBoxPx2 -
      scale * scale * (std::pow(t.truth.frames[1].blur_sigma_px, 2) + kPixelBoxPx2);
  ASSERT_LT(truth_px2, -0.1);
  const auto added = MeasureAddedVariance(t.grey[1], t.grey[0], scale, t.centre, 0.005, t.psf);
  ASSERT_TRUE(added);
  if (std::getenv("MEASURE")) printf("NEG truth %.4f got %.4f\n", truth_px2, added->variance_px2);
  EXPECT_LT(added->variance_px2, 0.5 * truth_px2);
}

TEST(MeasureAddedVariance, SaysNothingOfAFrameWithoutTheTarget) {
  const Textures t = Render(SweepCase("iii", 192, 5), {400});
  const cv::Mat flat(192, 192, CV_32F, cv::Scalar(0.4));
  EXPECT_FALSE(MeasureAddedVariance(t.grey[0], flat, 1, t.centre, 0.005, t.psf));
}

}  // namespace
}  // namespace thicklens::calib
