#include "calib/sharpness/sharpness.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "calib/sharpness/edge_pixels.h"
#include "tests/calib/drawn_edges.h"

namespace thicklens::calib {
namespace {

using thicklens::testing::DrawnEdge;

// Flat, then linear over `width_px`, then flat, with the slope along x.
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
  // Smoothing by sigma 1 px extends 5 px (the end of its kernel) beyond each foot of the ramp, so
  // the extrema are width + 10 px apart.
  for (const int width_px : {4, 8, 10, 20}) {
    for (const double height : {0.2, 0.5, -0.5}) {
      const SharpnessIndex index =
          MeanEdgeSlope(Ramp(height < 0 ? 0.8 : 0.1, height, width_px), Above(0.005));
      EXPECT_GE(index.edge_count, 36) << width_px;  // one per row, except at the border
      // The distance is one pixel less if the last step of the foot is lost in rounding.
      EXPECT_GE(index.mean_edge_slope, std::abs(height) / (width_px + 10) - 1e-5) << width_px;
      EXPECT_LE(index.mean_edge_slope, std::abs(height) / (width_px + 8) + 1e-5) << width_px;
    }
  }
}

TEST(MeanEdgeSlope, FollowsTheGradientAcrossASlantedEdge) {
  // One edge is drawn vertically and at 30 degrees. The slopes are equal, because the distance is
  // measured along the normal.
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
  // The edge has sigma 2 px and is smoothed by 1 px. Therefore its steepest gradient is
  // 0.5/sqrt(2 pi 5) = 0.089 (reduced by the pixel).
  const cv::Mat edge = DrawnEdge(96, 5, 2, 0.2, 0.7);
  EXPECT_GT(MeanEdgeSlope(edge, Above(0.07)).edge_count, 50);
  EXPECT_EQ(MeanEdgeSlope(edge, Above(0.1)).edge_count, 0);
  // Half the contrast is below a threshold that the whole contrast exceeds.
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
  // Inside the ramp, 3 px each way, the slope is that of the ramp, whatever its width is.
  EXPECT_NEAR(MeanEdgeSlope(Ramp(0.1, 0.5, 40), near).mean_edge_slope, 0.5 / 40, 2e-4);
}

// The definition, step by step, in double.
SharpnessIndex PlainMeanEdgeSlope(const cv::Mat& grey, double threshold, int max_search_px) {
  cv::Mat smoothed;
  cv::GaussianBlur(grey, smoothed, cv::Size(11, 11), 1, 1, cv::BORDER_REFLECT_101);
  const auto at = [&](double x, double y) {
    const int x0 = static_cast<int>(std::floor(x)), y0 = static_cast<int>(std::floor(y));
    const double fx = x - x0, fy = y - y0;
    // On the last row or column the next one has no weight, and does not exist.
    const int x1 = std::min(x0 + 1, smoothed.cols - 1), y1 = std::min(y0 + 1, smoothed.rows - 1);
    return (1 - fy) * ((1 - fx) * smoothed.at<float>(y0, x0) + fx * smoothed.at<float>(y0, x1)) +
           fy * ((1 - fx) * smoothed.at<float>(y1, x0) + fx * smoothed.at<float>(y1, x1));
  };
  const auto gradient = [&](int x, int y) {
    return cv::Point2d(0.5 * (at(x + 1, y) - at(x - 1, y)), 0.5 * (at(x, y + 1) - at(x, y - 1)));
  };
  // Gradients are 0 in the outermost row and column.
  const auto magnitude = [&](int x, int y) {
    if (x < 1 || y < 1 || x > grey.cols - 2 || y > grey.rows - 2) return 0.0;
    const cv::Point2d g = gradient(x, y);
    return std::hypot(g.x, g.y);
  };
  SharpnessIndex index;
  for (int y = 2; y < grey.rows - 2; ++y) {
    for (int x = 2; x < grey.cols - 2; ++x) {
      const double here = magnitude(x, y);
      if (!(here > threshold)) continue;
      const cv::Point2d g = gradient(x, y);
      const int sx = g.x >= 0 ? 1 : -1, sy = g.y >= 0 ? 1 : -1;
      const bool flat = std::abs(g.x) >= std::abs(g.y);
      const double t = flat ? std::abs(g.y / g.x) : std::abs(g.x / g.y);
      const auto beside = [&](int sign) {
        const int px = flat ? x + sign * sx : x, py = flat ? y : y + sign * sy;
        return (1 - t) * magnitude(px, py) + t * magnitude(x + sign * sx, y + sign * sy);
      };
      if (!(here > beside(1) && here >= beside(-1))) continue;
      double distance_px = 0, span = 0;
      for (const int sign : {1, -1}) {
        double last = at(x, y);
        for (int step = 1; step <= max_search_px; ++step) {
          const double px = x + sign * step * g.x / here, py = y + sign * step * g.y / here;
          if (!(px >= 0 && py >= 0 && px < grey.cols - 1 && py < grey.rows - 1)) break;
          if (!(sign * (at(px, py) - last) > 0)) break;
          last = at(px, py);
          distance_px += 1;
        }
        span += sign * last;
      }
      if (!(distance_px > 0)) continue;
      index.mean_edge_slope += std::abs(span) / distance_px;
      ++index.edge_count;
    }
  }
  if (index.edge_count > 0) index.mean_edge_slope /= index.edge_count;
  return index;
}

TEST(MeanEdgeSlope, IsThatOfThePlainDefinitionOnATexture) {
  // Smooth noise has edges in every direction and at the borders, and walks of every length.
  for (const double sigma_px : {1.0, 2.5, 6.0}) {
    cv::Mat noise(97, 131, CV_32F);
    cv::RNG random(4);
    random.fill(noise, cv::RNG::UNIFORM, 0.0, 1.0);
    cv::GaussianBlur(noise, noise, {}, sigma_px);
    for (const int reach_px : {1, 5, 64}) {
      SharpnessOptions options = Above(0.004);
      options.max_search_px = reach_px;
      const SharpnessIndex found = MeanEdgeSlope(noise, options);
      const SharpnessIndex plain = PlainMeanEdgeSlope(noise, 0.004, reach_px);
      ASSERT_GT(plain.edge_count, 100) << sigma_px;
      // A tie of two neighbours may be resolved in the other way in float.
      EXPECT_NEAR(found.edge_count, plain.edge_count, 2) << sigma_px;
      EXPECT_NEAR(found.mean_edge_slope / plain.mean_edge_slope, 1, 1e-3) << sigma_px << reach_px;
    }
  }
}

TEST(MeanEdgeSlopes, AreThoseOfEachThresholdAlone) {
  cv::Mat noise(90, 110, CV_32F);
  cv::RNG random(5);
  random.fill(noise, cv::RNG::UNIFORM, 0.2, 1.0);
  const std::vector<double> thresholds = {0.08, 0.02, 0.05, 10};
  const auto together = MeanEdgeSlopes(noise, {}, thresholds);
  ASSERT_EQ(together.size(), thresholds.size());
  for (std::size_t i = 0; i < thresholds.size(); ++i) {
    const SharpnessIndex alone = MeanEdgeSlope(noise, Above(thresholds[i]));
    EXPECT_EQ(together[i].edge_count, alone.edge_count);
    EXPECT_EQ(together[i].mean_edge_slope, alone.mean_edge_slope);
  }
  EXPECT_GT(together[1].edge_count, together[2].edge_count);
  EXPECT_EQ(together[3].edge_count, 0);
  EXPECT_TRUE(MeanEdgeSlopes(noise, {}, {}).empty());
  // The frame is divided by its mean.
  const double mean = cv::mean(noise)[0];
  const SharpnessIndex normalised = MeanEdgeSlope(noise / mean, Above(0.05 / mean));
  EXPECT_NEAR(normalised.edge_count, together[2].edge_count, 2);
  EXPECT_NEAR(normalised.mean_edge_slope * mean / together[2].mean_edge_slope, 1, 1e-3);
}

TEST(Quantile, IsTheValueOfItsRank) {
  cv::Mat uniform(130, 111, CV_32F), constant(130, 111, CV_32F, cv::Scalar(0.5F));
  cv::RNG random(6);
  random.fill(uniform, cv::RNG::UNIFORM, 0.0, 1.0);
  cv::Mat steep = uniform.clone();
  cv::pow(uniform, 40, steep);  // nearly all values are nearly 0
  cv::Mat rare = cv::Mat::zeros(130, 111, CV_32F);
  rare.at<float>(64, 64) = 1;
  cv::Mat tail = cv::Mat::zeros(130, 111, CV_32F);  // only where the sample has no pixels
  for (int y = 1; y < tail.rows; y += 4) tail.row(y).setTo(1);
  for (const cv::Mat& values :
       {uniform, steep, constant, rare, tail, cv::Mat(uniform.colRange(3, 90))}) {
    std::vector<float> sorted;
    for (int y = 0; y < values.rows; ++y)
      sorted.insert(sorted.end(), values.ptr<float>(y), values.ptr<float>(y) + values.cols);
    std::sort(sorted.begin(), sorted.end());
    for (const double fraction : {0.0, 0.3, 0.5, 0.91, 0.99, 0.995, 0.99999, 1.0}) {
      const auto rank = static_cast<std::size_t>(fraction * static_cast<double>(sorted.size() - 1));
      EXPECT_EQ(Quantile(values, fraction), sorted[rank]) << fraction;
    }
  }
  EXPECT_EQ(Quantile(cv::Mat(), 0.5), 0);
}

}  // namespace
}  // namespace thicklens::calib
