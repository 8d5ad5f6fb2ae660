#include "thicklens/calib/sharpness.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "drawn_edges.h"

namespace thicklens::calib {
namespace {

using thicklens::testing::DrawnEdge;

// Flat, then linear over `width_px`, then flat; the slope along x.
cv::Mat Ramp(double dark, double height, int width_px) {
  cv::Mat ramp(40, 120, CV_32F);
  for (int y = 0; y < ramp.rows; ++y) {
    for (int x = 0; x < ramp.cols; ++x) {
      ramp.at<float>(y, x) =
          static_cast<float>(dark + height * std::clamp((x - 50.0) / width_px, 0.0, 1.0));
    }
  }
  return ramp;
}

SharpnessOptions Above(double threshold) {
  SharpnessOptions options;
  options.edge_threshold = threshold;
  return options;
}

TEST(MeanEdgeSlope, OfARampIsItsHeightOverTheWidthThatSmoothingLeaves) {
  // Smoothing by sigma 1 px reaches 5 px (its kernel's end) beyond each foot of the ramp, so the
  // extrema stand width + 10 px apart.
  for (const int width_px : {4, 8, 10, 20}) {
    for (const double height : {0.2, 0.5, -0.5}) {
      const SharpnessIndex index =
          MeanEdgeSlope(Ramp(height < 0 ? 0.8 : 0.1, height, width_px), Above(0.005));
      EXPECT_GE(index.edge_count, 36) << width_px;  // one a row, less the border
      // One pixel less where the last step of the foot is lost in rounding.
      EXPECT_GE(index.mean_edge_slope, std::abs(height) / (width_px + 10) - 1e-5) << width_px;
      EXPECT_LE(index.mean_edge_slope, std::abs(height) / (width_px + 8) + 1e-5) << width_px;
    }
  }
}

TEST(MeanEdgeSlope, FollowsTheGradientAcrossASlantedEdge) {
  // The same edge upright and at 30 degrees: the distance is taken along the normal.
  const double upright = MeanEdgeSlope(DrawnEdge(96, 0, 2, 0.2, 0.7), Above(0.02)).mean_edge_slope;
  const double slanted = MeanEdgeSlope(DrawnEdge(96, 30, 2, 0.2, 0.7), Above(0.02)).mean_edge_slope;
  EXPECT_NEAR(slanted / upright, 1, 0.1);
}

TEST(MeanEdgeSlope, FallsAsTheBlurGrows) {
  double last = 1;
  for (const double sigma_px : {0.5, 1.0, 2.0, 4.0, 6.0}) {
    const double slope =
        MeanEdgeSlope(DrawnEdge(96, 5, sigma_px, 0.2, 0.7), Above(0.01)).mean_edge_slope;
    EXPECT_GT(slope, 0);
    EXPECT_LT(slope, 0.95 * last) << sigma_px;
    last = slope;
  }
}

TEST(MeanEdgeSlope, GrowsWithBrightnessWhichIsWhyTheRawIndexMisleads) {
  const cv::Mat edge = DrawnEdge(96, 5, 1.5, 0.2, 0.6);
  const double slope = MeanEdgeSlope(edge, Above(0.01)).mean_edge_slope;
  const double lit = MeanEdgeSlope(edge * 1.5, Above(0.015)).mean_edge_slope;
  // An extremum may move by a pixel where the smoothed foot is flat to the last digit.
  EXPECT_NEAR(lit / slope, 1.5, 0.03);
}

TEST(MeanEdgeSlope, ThresholdIsTheCallersAndDoesNotAdaptToTheFrame) {
  // Sigma 2 px, smoothed by 1: the steepest gradient is 0.5/sqrt(2 pi 5) = 0.089 (less the pixel).
  const cv::Mat edge = DrawnEdge(96, 5, 2, 0.2, 0.7);
  EXPECT_GT(MeanEdgeSlope(edge, Above(0.07)).edge_count, 50);
  EXPECT_EQ(MeanEdgeSlope(edge, Above(0.1)).edge_count, 0);
  // Half the contrast misses a threshold that the whole one passed.
  EXPECT_EQ(MeanEdgeSlope(edge * 0.5, Above(0.07)).edge_count, 0);
}

TEST(MeanEdgeSlope, IsNothingWithoutEdges) {
  const SharpnessIndex flat = MeanEdgeSlope(cv::Mat(40, 40, CV_32F, cv::Scalar(0.4)), Above(0));
  EXPECT_EQ(flat.edge_count, 0);
  EXPECT_EQ(flat.mean_edge_slope, 0);
}

TEST(MeanEdgeSlope, SearchEndsAtItsLimit) {
  SharpnessOptions near = Above(0.005);
  near.max_search_px = 3;
  // Inside the ramp, 3 px each way: the ramp's own slope, however wide it is.
  EXPECT_NEAR(MeanEdgeSlope(Ramp(0.1, 0.5, 40), near).mean_edge_slope, 0.5 / 40, 2e-4);
}

}  // namespace
}  // namespace thicklens::calib
