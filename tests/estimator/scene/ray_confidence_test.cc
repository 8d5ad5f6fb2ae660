// The confidence of each ray is compared with counts by hand.
#include "thicklens/estimator/ray_confidence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <vector>

#include "support/error_message.h"
#include "tests/estimator/solver_runs.h"
#include "thicklens/estimator/estimate_checks.h"
#include "thicklens/estimator/scene_solver.h"
#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator {
namespace {

using ::testing::Each;
using testing::ErrorOf;
using ::testing::HasSubstr;

constexpr int kW = 30, kH = 24;

std::size_t At(int x, int y) { return static_cast<std::size_t>(y * kW + x); }

// A scene seen through 3 x 3 views with different weights.
EstimateInput Scene(float disparity) {
  EstimateInput input;
  input.weights = model::ApertureWeights(model::ApertureShape::kGaussian, 3, 3);
  input.disparity = {kW, kH, std::vector<float>(kW * kH, disparity), {1, 1}};
  input.image = {kW, kH, 1, std::vector<float>(kW * kH, 0.5F)};
  return input;
}

bool IsCard(int x, int y) { return x >= 10 && x < 18 && y >= 8 && y < 14; }

// A card with a disparity of one px per step before a wall in focus, so that it moves by whole
// pixels from view to view.
EstimateInput Card() {
  EstimateInput input = Scene(0);
  for (int y = 0; y < kH; ++y) {
    for (int x = 0; x < kW; ++x) {
      if (IsCard(x, y)) input.disparity.disparity[At(x, y)] = 1;
    }
  }
  return input;
}

TEST(ConfidenceBytes, SayWhatTheyWereMadeOf) {
  for (const double share : {0.0, 0.25, 0.5, 0.999, 1.0}) {
    const Confidence sharp = ConfidenceOfPoint(share, kUnresolvedBlurSigmaPx);
    const Confidence blurred = ConfidenceOfPoint(share, kUnresolvedBlurSigmaPx + 0.01);
    EXPECT_TRUE(IsResolved(sharp));
    EXPECT_FALSE(IsResolved(blurred));
    EXPECT_NEAR(VisibleFractionOf(sharp), share, 0.5 / 126 + 1e-9);
    EXPECT_EQ(VisibleFractionOf(blurred), VisibleFractionOf(sharp));
    EXPECT_NE(blurred, kFilledIn);
  }
  EXPECT_EQ(ConfidenceOfPoint(1, 0), 255);
  EXPECT_EQ(ConfidenceOfPoint(0, 0), 129);
  EXPECT_EQ(ConfidenceOfPoint(1, 9), 127);
  EXPECT_EQ(ConfidenceOfPoint(0, 9), 1);
  EXPECT_EQ(ConfidenceOfPoint(1 + 1e-6, 0), 255);
  EXPECT_EQ(VisibleFractionOf(kFilledIn), 0);
  EXPECT_FALSE(IsResolved(kFilledIn));
}

TEST(PointConfidence, IsTheShareOfTheApertureThatACardLeaves) {
  const EstimateInput input = Card();
  const std::vector<Confidence> confidence = PointConfidence(input, 2);
  ASSERT_EQ(confidence.size(), std::size_t{kW * kH});
  int partly = 0;
  for (int y = 2; y < kH - 2; ++y) {
    for (int x = 2; x < kW - 2; ++x) {
      double visible = 1;  // of the card, all
      for (int b = -1; b <= 1 && !IsCard(x, y); ++b) {
        for (int a = -1; a <= 1; ++a) {
          if (IsCard(x + a, y + b)) visible -= input.weights(b + 1, a + 1);
        }
      }
      ASSERT_EQ(confidence[At(x, y)], ConfidenceOfPoint(visible, 0)) << x << ", " << y;
      partly += visible < 1 ? 1 : 0;
    }
  }
  EXPECT_EQ(partly, 2 * (8 + 6) + 4);
}

TEST(PointConfidence, EndsAtTheBorderOfThePhotograph) {
  const EstimateInput input = Scene(2);
  const std::vector<Confidence> confidence = PointConfidence(input, 1);
  const Eigen::ArrayXd across = input.weights.colwise().sum().transpose();
  for (int x = 0; x < kW; ++x) {
    double visible = 0;
    for (int a = -1; a <= 1; ++a) visible += x - 2 * a >= 0 && x - 2 * a < kW ? across[a + 1] : 0;
    EXPECT_EQ(confidence[At(x, kH / 2)], ConfidenceOfPoint(visible, 0)) << x;
  }
}

// A ray that leaves the photograph between the middle and the edge of its last pixel counts; where
// the ray meets the photograph decides, not the sample of the light field.
TEST(PointConfidence, GoesByTheDepthAlsoOnASlant) {
  EstimateInput input = Scene(0);
  for (int y = 0; y < kH; ++y) {
    for (int x = 0; x < kW; ++x)
      input.disparity.disparity[At(x, y)] = -0.4F + 0.03F * static_cast<float>(x);
  }
  const std::vector<Confidence> confidence = PointConfidence(input, 1);
  EXPECT_THAT(confidence, Each(Confidence{255}));
}

TEST(PointConfidence, TooStrongABlurLowersTheConfidence) {
  EstimateInput input = Scene(0.1F);
  // For 3 steps with these weights the standard deviation is less than 0.7 of a step.
  input.disparity.disparity.assign(input.disparity.disparity.size(), 6);
  std::vector<Confidence> confidence = PointConfidence(input, 1);
  EXPECT_EQ(confidence[At(15, 12)], 127);
  input.disparity.disparity.assign(input.disparity.disparity.size(), 2);
  confidence = PointConfidence(input, 1);
  EXPECT_EQ(confidence[At(15, 12)], 255);
}

TEST(PointConfidence, RefusesWhatNoEstimateStartsFrom) {
  EstimateInput input = Scene(0);
  input.image.values.pop_back();
  EXPECT_THAT(ErrorOf([&] { PointConfidence(input, 1); }), HasSubstr("image"));
}

TEST(RayConfidence, IsThatOfThePointAndNothingWhereThereIsNone) {
  const EstimateInput input = Card();
  const std::vector<Confidence> of_points = PointConfidence(input, 1);
  // One step to the right the card has moved one px to the left, and uncovers a column.
  const std::vector<Confidence> rays =
      RayConfidence(of_points, DisparityRenderer(input.disparity).RenderCompact(1, 0));
  for (int y = 8; y < 14; ++y) {
    for (int x = 9; x < 17; ++x) EXPECT_EQ(rays[At(x, y)], 255) << x << ", " << y;
    EXPECT_EQ(rays[At(17, y)], kFilledIn);
    EXPECT_EQ(rays[At(18, y)], of_points[At(18, y)]);
    EXPECT_EQ(rays[At(8, y)], of_points[At(8, y)]);
  }
  // In the middle view every ray is that of a point.
  EXPECT_EQ(RayConfidence(of_points, DisparityRenderer(input.disparity).RenderCompact(0, 0)),
            of_points);
}

TEST(RayConfidence, ComesWithTheSceneSolver) {
  const EstimateInput input = Card();
  SceneSummary summary;
  SceneMaps maps;
  EstimateScene(input, {}, RunOnThreads(2), &summary, &maps);
  const std::vector<Confidence> of_points = PointConfidence(input, 1);
  ASSERT_EQ(maps.confidence.size(), 9 * of_points.size());
  for (int l = 0; l < 3; ++l) {
    for (int k = 0; k < 3; ++k) {
      const auto first =
          maps.confidence.begin() + (l * 3 + k) * static_cast<std::ptrdiff_t>(of_points.size());
      EXPECT_EQ(
          std::vector<Confidence>(first, first + kW * kH),
          RayConfidence(of_points, DisparityRenderer(input.disparity).RenderCompact(k - 1, l - 1)))
          << k << ", " << l;
    }
  }
}

}  // namespace
}  // namespace thicklens::estimator
