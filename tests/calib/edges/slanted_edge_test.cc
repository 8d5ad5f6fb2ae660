#include "thicklens/calib/slanted_edge.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <opencv2/core.hpp>
#include <random>

#include "calib/drawn_edges.h"
#include "thicklens/model/blur_transfer.h"

namespace thicklens::calib {
namespace {

using ::testing::HasSubstr;

using thicklens::testing::DrawnEdge;
using thicklens::testing::Stored;

// The transfer along the normal: of the blur, and of the pixel's box in that direction.
double GaussianWithPixel(double sigma_px, double normal_deg, double f) {
  const double c = std::cos(normal_deg * CV_PI / 180), s = std::sin(normal_deg * CV_PI / 180);
  return model::GaussianTransfer(sigma_px, f, 0) * model::PixelBoxTransfer(f * c, f * s);
}

// An edge blurred by a disc of radius R and by the box of the pixel, by the mean over a fine grid
// of points of each pixel. The edge spread of a disc is its area on one side of a chord.
cv::Mat DiscEdge(int size_px, double angle_deg, double radius_px) {
  constexpr int kPoints = 6;
  const double nx = std::cos(angle_deg * CV_PI / 180), ny = std::sin(angle_deg * CV_PI / 180);
  const double middle = 0.5 * (size_px - 1);
  cv::Mat edge(size_px, size_px, CV_32F);
  for (int y = 0; y < size_px; ++y) {
    for (int x = 0; x < size_px; ++x) {
      double sum = 0;
      for (int j = 0; j < kPoints; ++j) {
        for (int i = 0; i < kPoints; ++i) {
          const double u = x + (i + 0.5) / kPoints - 0.5, v = y + (j + 0.5) / kPoints - 0.5;
          const double t =
              std::clamp(((u - middle) * nx + (v - middle) * ny) / radius_px, -1.0, 1.0);
          sum += 0.5 + (t * std::sqrt(1 - t * t) + std::asin(t)) / CV_PI;
        }
      }
      edge.at<float>(y, x) = static_cast<float>(0.2 + 0.6 * sum / (kPoints * kPoints));
    }
  }
  return edge;
}

void ExpectCurve(const SlantedEdgeResult& edge, const std::function<double(double)>& expected,
                 double up_to, double tolerance) {
  ASSERT_TRUE(edge.done) << edge.message;
  for (std::size_t i = 0; i < edge.curve.transfer.size(); ++i) {
    const double f = edge.curve.frequency_per_px[i];
    if (f > up_to) break;
    EXPECT_NEAR(edge.curve.transfer[i], expected(f), tolerance) << "at " << f;
  }
}

TEST(SlantedEdge, HasTheTransferOfAGaussian) {
  for (const double sigma_px : {0.5, 1.2, 3.0}) {
    for (const double angle_deg : {5.0, 96.0, -175.0}) {
      SCOPED_TRACE(::testing::Message() << sigma_px << " px at " << angle_deg);
      const SlantedEdgeResult edge =
          MeasureSlantedEdge(DrawnEdge(160, angle_deg, sigma_px, 0.1, 0.8));
      ExpectCurve(
          edge, [&](double f) { return GaussianWithPixel(sigma_px, angle_deg, f); }, 0.5, 0.006);
      EXPECT_NEAR(std::remainder(edge.normal_deg - angle_deg, 360), 0, 0.05);
      EXPECT_NEAR(edge.contrast, 0.7, 0.01);
      EXPECT_FALSE(edge.is_clipped);
    }
  }
}

// Beyond the first zero of a disc the contrast is reversed, and the MTF is its modulus.
TEST(SlantedEdge, HasTheTransferOfADisc) {
  const double radius_px = 3, angle_deg = 6;
  const SlantedEdgeResult edge = MeasureSlantedEdge(DiscEdge(200, angle_deg, radius_px));
  const double c = std::cos(angle_deg * CV_PI / 180), s = std::sin(angle_deg * CV_PI / 180);
  ExpectCurve(
      edge,
      [&](double f) {
        return std::abs(model::DiscTransfer(radius_px, f, 0) *
                        model::PixelBoxTransfer(f * c, f * s));
      },
      0.5, 0.01);
}

TEST(SlantedEdge, LevelsAreWhereTheCurveCrossesThem) {
  const SlantedEdgeResult edge = MeasureSlantedEdge(DrawnEdge(160, 5, 1.2, 0.1, 0.8));
  ASSERT_TRUE(edge.mtf50 && edge.mtf10);
  EXPECT_NEAR(GaussianWithPixel(1.2, 5, edge.mtf50->value), 0.5, 0.01);
  EXPECT_NEAR(GaussianWithPixel(1.2, 5, edge.mtf10->value), 0.1, 0.01);
}

// Noise adds its power to the modulus of a transform; without a correction the mean of many edges
// would be above the truth by several per cent at high frequencies.
TEST(SlantedEdge, IsNotBiasedByNoise) {
  constexpr int kRuns = 40;
  const cv::Mat clean = DrawnEdge(120, 5, 1.5, 0.1, 0.8);
  std::vector<double> sum(101, 0), square(101, 0), predicted(101, 0);
  double mtf50 = 0, mtf50_square = 0, mtf50_sigma = 0;
  for (int run = 0; run < kRuns; ++run) {
    const SlantedEdgeResult edge =
        MeasureSlantedEdge(Stored(clean, 800, 65536, static_cast<unsigned>(run + 1)));
    ASSERT_TRUE(edge.done) << edge.message;
    ASSERT_TRUE(edge.mtf50);
    for (std::size_t i = 0; i < sum.size(); ++i) {
      sum[i] += edge.curve.transfer[i] / kRuns;
      square[i] += edge.curve.transfer[i] * edge.curve.transfer[i] / kRuns;
      predicted[i] += edge.curve.sigma[i] / kRuns;
    }
    mtf50 += edge.mtf50->value / kRuns;
    mtf50_square += edge.mtf50->value * edge.mtf50->value / kRuns;
    mtf50_sigma += edge.mtf50->sigma / kRuns;
  }
  for (const std::size_t i : {10u, 20u, 25u}) {
    const double scatter = std::sqrt(square[i] - sum[i] * sum[i]);
    const double truth = GaussianWithPixel(1.5, 5, static_cast<double>(i) / 100);
    EXPECT_NEAR(sum[i], truth, 4 * scatter / std::sqrt(kRuns) + 0.004) << i;
    // The place of the edge and its levels scatter, too.
    EXPECT_GT(predicted[i], 0.6 * scatter) << i;
    EXPECT_LT(predicted[i], 1.8 * scatter) << i;
  }
  const double scatter = std::sqrt(mtf50_square - mtf50 * mtf50);
  EXPECT_GT(mtf50_sigma, 0.5 * scatter);
  EXPECT_LT(mtf50_sigma, 2 * scatter);
}

// Light that changes evenly along both sides is no blur.
TEST(SlantedEdge, IsNotChangedByASlopeOfTheLight) {
  cv::Mat edge = DrawnEdge(160, 5, 1.2, 0.2, 0.7);
  for (int y = 0; y < edge.rows; ++y) {
    for (int x = 0; x < edge.cols; ++x) {
      edge.at<float>(y, x) *= static_cast<float>(1 + 0.002 * (x - 80) + 0.001 * (y - 80));
    }
  }
  ExpectCurve(
      MeasureSlantedEdge(edge), [](double f) { return GaussianWithPixel(1.2, 5, f); }, 0.5, 0.012);
}

TEST(SlantedEdge, RefusesAnEdgeAlongThePixels) {
  const SlantedEdgeResult edge = MeasureSlantedEdge(DrawnEdge(160, 0, 1.2, 0.1, 0.8));
  EXPECT_FALSE(edge.done);
  EXPECT_THAT(edge.message, HasSubstr("an angle of 3 to 10 degrees is right"));
}

TEST(SlantedEdge, RefusesAnImageWithoutAnEdge) {
  cv::Mat noise(100, 100, CV_32F);
  cv::theRNG().state = 3;
  cv::randn(noise, 0.5, 0.01);
  const SlantedEdgeResult edge = MeasureSlantedEdge(noise);
  EXPECT_FALSE(edge.done);
  EXPECT_THAT(edge.message, HasSubstr("edge"));
}

TEST(SlantedEdge, SaysThatTheBrightSideIsClipped) {
  cv::Mat edge = Stored(DrawnEdge(160, 5, 1.2, 0.2, 1.05), 2, 256, 5);
  EXPECT_TRUE(MeasureSlantedEdge(edge).is_clipped);
}

TEST(SlantedEdge, FrequencyAtALevelIsAbsentAboveIt) {
  ModulationTransfer curve;
  curve.frequency_per_px = {0, 0.5, 1};
  curve.transfer = {1, 0.8, 0.6};
  EXPECT_FALSE(FrequencyAtLevel(curve, 0.5));
  curve.transfer = {1, 0.8, 0.4};
  curve.sigma = {0, 0.02, 0.02};
  const auto level = FrequencyAtLevel(curve, 0.5);
  ASSERT_TRUE(level);
  EXPECT_NEAR(level->value, 0.875, 1e-12);
  EXPECT_NEAR(level->sigma, 0.025, 1e-12);
}

}  // namespace
}  // namespace thicklens::calib
