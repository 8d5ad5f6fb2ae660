#include "thicklens/estimator/refine_depth.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <string>
#include <vector>

#include "estimator/depth/edge_labels.h"
#include "estimator/depth/map_faults.h"
#include "thicklens/base/error.h"

namespace thicklens::estimator {
namespace {

constexpr int kSize = 160;

// Two discs of their own colours in front of a wall, all slanted and textured. The truth is in
// closed form.
struct TwoDiscs {
  model::LinearImage photo{kSize, kSize, 3, {}};
  cv::Mat disparity = cv::Mat(kSize, kSize, CV_32F);

  explicit TwoDiscs(std::uint64_t seed = 3) {
    std::mt19937_64 engine(seed);
    std::normal_distribution<float> normal(0, 1);
    cv::Mat texture(kSize, kSize, CV_32F);
    for (float& value : cv::Mat_<float>(texture)) value = normal(engine);
    cv::GaussianBlur(texture, texture, {}, 1.2);
    const model::TransferCurve transfer = model::TransferCurve::Srgb();
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        const bool is_left = std::hypot(x - 55, y - 60) < 34;
        const bool is_right = std::hypot(x - 115, y - 105) < 26;
        disparity.at<float>(y, x) = is_left    ? 1.2F + 0.004F * static_cast<float>(x)
                                    : is_right ? 0.6F - 0.003F * static_cast<float>(y)
                                               : -0.8F + 0.002F * static_cast<float>(x + y);
        const std::array<float, 3> colour = is_left    ? std::array<float, 3>{0.62F, 0.4F, 0.3F}
                                            : is_right ? std::array<float, 3>{0.3F, 0.55F, 0.4F}
                                                       : std::array<float, 3>{0.35F, 0.36F, 0.5F};
        for (const float part : colour) {
          const float value = part + 0.08F * texture.at<float>(y, x) + normal(engine) / 255;
          photo.values.push_back(static_cast<float>(
              transfer.Decode(std::clamp(static_cast<double>(value), 0.0, 1.0))));
        }
      }
    }
  }

  // The share of the pixels whose disparity is wrong by more than 0.3 px per view step.
  double WrongShare(const DisparityMap& map) const {
    int wrong = 0;
    for (int i = 0; i < kSize * kSize; ++i) {
      if (std::abs(map.disparity[static_cast<std::size_t>(i)] -
                   disparity.at<float>(i / kSize, i % kSize)) > 0.3F)
        ++wrong;
    }
    return static_cast<double>(wrong) / (kSize * kSize);
  }
};

DisparityMap MapOf(const cv::Mat& map) {
  return {map.cols, map.rows, std::vector<float>(map.begin<float>(), map.end<float>()), {1, 1}};
}

DepthRefinement Refine(const TwoDiscs& scene, DisparityMap* map,
                       const std::vector<bool>& holes = {}, int threads = 2, bool eager = false) {
  DepthRefinementOptions options;
  options.threads = threads;
  options.eager = eager;
  return RefineDepth(scene.photo, model::TransferCurve::Srgb(), holes, options, map);
}

TEST(RefineDepth, AnExactMapStaysBitForBit) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    for (const bool eager : {false, true}) {
      const TwoDiscs scene(seed);
      DisparityMap map = MapOf(scene.disparity);
      const DepthRefinement found = Refine(scene, &map, {}, 2, eager);
      EXPECT_FALSE(found.applied) << found.message;
      EXPECT_EQ(map.disparity, MapOf(scene.disparity).disparity);
      EXPECT_NEAR(found.edge_width_px, 1, 0.2);
    }
  }
}

TEST(RefineDepth, LayersStayBitForBit) {
  // Five discs of their own colours in front of a wall, 0.5 px per view step apart.
  TwoDiscs scene;
  scene.photo.values.clear();
  constexpr std::array<std::array<int, 3>, 5> kDiscs = {
      {{40, 38, 27}, {112, 42, 31}, {36, 112, 24}, {88, 96, 19}, {130, 124, 22}}};
  constexpr std::array<std::array<float, 3>, 6> kColours = {{{0.35F, 0.36F, 0.5F},
                                                             {0.62F, 0.4F, 0.3F},
                                                             {0.3F, 0.55F, 0.4F},
                                                             {0.6F, 0.6F, 0.3F},
                                                             {0.25F, 0.25F, 0.25F},
                                                             {0.7F, 0.45F, 0.6F}}};
  const model::TransferCurve transfer = model::TransferCurve::Srgb();
  std::mt19937_64 engine(6);
  std::normal_distribution<double> noise(0, 1.5 / 255);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      std::size_t layer = 0;
      for (std::size_t i = 0; i < kDiscs.size(); ++i) {
        if (std::hypot(x - kDiscs[i][0], y - kDiscs[i][1]) < kDiscs[i][2]) layer = i + 1;
      }
      scene.disparity.at<float>(y, x) = -1 + 0.5F * static_cast<float>(layer);
      for (const float part : kColours[layer]) {
        scene.photo.values.push_back(
            static_cast<float>(transfer.Decode(static_cast<double>(part) + noise(engine))));
      }
    }
  }
  DisparityMap map = MapOf(scene.disparity);
  const DepthRefinement found = Refine(scene, &map);
  EXPECT_FALSE(found.applied) << found.message;
  EXPECT_EQ(found.quantum_px, 0);
  EXPECT_EQ(map.disparity, MapOf(scene.disparity).disparity);
}

TEST(RefineDepth, WideEdgesBecomeStepsWhereTheColoursChange) {
  const TwoDiscs scene;
  cv::Mat blurred;
  cv::GaussianBlur(scene.disparity, blurred, {}, 2);
  DisparityMap map = MapOf(blurred);
  const double before = scene.WrongShare(map);
  const DepthRefinement found = Refine(scene, &map);
  EXPECT_TRUE(found.applied);
  // The rise over the largest slope of a blurred step is sigma sqrt(2 pi), and up to 1.4 times that
  // along an axis that the edge is oblique to.
  const double straight_px = 2 * std::sqrt(2 * M_PI);
  EXPECT_GT(found.edge_width_px, 0.95 * straight_px);
  EXPECT_LT(found.edge_width_px, 1.4 * straight_px);
  EXPECT_LT(scene.WrongShare(map), before / 8);
}

TEST(RefineDepth, AMapOfAnEighthOfTheSizeIsSharpened) {
  const TwoDiscs scene;
  cv::Mat small, large;
  cv::resize(scene.disparity, small, {}, 1.0 / 8, 1.0 / 8, cv::INTER_NEAREST);
  cv::resize(small, large, scene.disparity.size(), 0, 0, cv::INTER_LINEAR);
  DisparityMap map = MapOf(large);
  const double before = scene.WrongShare(map);
  const DepthRefinement found = Refine(scene, &map);
  EXPECT_LT(scene.WrongShare(map), before / 2) << found.message;
}

TEST(RefineDepth, BlocksOfASlantAreInterpolated) {
  const TwoDiscs scene;
  cv::Mat small, large;
  cv::resize(scene.disparity, small, {}, 0.25, 0.25, cv::INTER_NEAREST);
  cv::resize(small, large, scene.disparity.size(), 0, 0, cv::INTER_NEAREST);
  DisparityMap map = MapOf(large);
  const DepthRefinement found = Refine(scene, &map);
  EXPECT_EQ(found.block_px, 4);
  // In the middle of a disc, far from all edges, the slant is there again.
  const auto at = [&](int x, int y) {
    return map.disparity[static_cast<std::size_t>(y * kSize + x)];
  };
  for (int x = 45; x < 60; ++x) EXPECT_NEAR(at(x + 1, 60) - at(x, 60), 0.004F, 1e-3F);
}

TEST(RefineDepth, ADisplacedMapIsMovedBack) {
  const TwoDiscs scene;
  for (const auto& [right, down] : {std::pair{3, 0}, {0, -2}, {2, 3}}) {
    cv::Mat moved;
    cv::warpAffine(scene.disparity, moved, cv::Matx23d(1, 0, right, 0, 1, down),
                   scene.disparity.size(), cv::INTER_NEAREST, cv::BORDER_REPLICATE);
    DisparityMap map = MapOf(moved);
    const double before = scene.WrongShare(map);
    const DepthRefinement found = Refine(scene, &map);
    EXPECT_EQ(found.right_px, right) << found.message;
    EXPECT_EQ(found.down_px, down) << found.message;
    EXPECT_THAT(found.message, ::testing::Not(::testing::HasSubstr("-0 px")));
    EXPECT_LT(scene.WrongShare(map), before / 5);
  }
}

// A disc: its map with reversed rows is the right one moved by 5 px. Which of both is wrong cannot
// be said, so that the map stays for the search of contradictions.
TEST(RefineDepth, AMapThatMayBeReversedIsNotMoved) {
  TwoDiscs scene;
  std::mt19937_64 engine(11);
  std::normal_distribution<float> normal(0, 1);
  cv::Mat truth(kSize, kSize, CV_32F);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const bool is_disc = std::hypot(x - 60, y - 82) < 36;
      truth.at<float>(y, x) = is_disc ? 1 : -1;
      for (int c = 0; c < 3; ++c) {
        const auto i = 3 * static_cast<std::size_t>(y * kSize + x) + static_cast<std::size_t>(c);
        scene.photo.values[i] = (is_disc == (c == 0) ? 0.4F : 0.15F) + 0.003F * normal(engine);
      }
    }
  }
  cv::Mat reversed, moved(kSize, kSize, CV_32F, cv::Scalar(-1));
  cv::flip(truth, reversed, 0);
  DisparityMap map = MapOf(reversed);
  const DisparityMap before = map;
  const DepthRefinement found = Refine(scene, &map);
  EXPECT_EQ(found.down_px, 0) << found.message;
  EXPECT_EQ(map.disparity, before.disparity);
  // No order of rows and columns has the disc where it is moved to a side.
  truth(cv::Rect(0, 0, kSize - 5, kSize)).copyTo(moved(cv::Rect(5, 0, kSize - 5, kSize)));
  map = MapOf(moved);
  EXPECT_EQ(Refine(scene, &map).right_px, 5);
}

TEST(RefineDepth, NearSurfacesThatAreTooWideOrTooNarrowAreChanged) {
  const TwoDiscs scene;
  const cv::Mat window = cv::Mat::ones(7, 7, CV_8U);
  cv::Mat wide, narrow;
  cv::dilate(scene.disparity, wide, window);
  cv::erode(scene.disparity, narrow, window);
  DisparityMap map = MapOf(wide);
  EXPECT_EQ(Refine(scene, &map).dilation_px, 3);
  EXPECT_LT(scene.WrongShare(map), 0.01);
  map = MapOf(narrow);
  EXPECT_EQ(Refine(scene, &map).dilation_px, -3);
  EXPECT_LT(scene.WrongShare(map), 0.01);
}

TEST(RefineDepth, QuantisedMapsAreMadeSmoothWithinTheirRounding) {
  const TwoDiscs scene;
  constexpr float kQuantum = 0.1F;
  cv::Mat quantised = scene.disparity.clone();
  for (float& value : cv::Mat_<float>(quantised)) value = kQuantum * std::round(value / kQuantum);
  DisparityMap map = MapOf(quantised);
  const DepthRefinement found = Refine(scene, &map);
  EXPECT_NEAR(found.quantum_px, kQuantum, 1e-3);
  double before = 0, after = 0;
  for (int i = 0; i < kSize * kSize; ++i) {
    const float true_value = scene.disparity.at<float>(i / kSize, i % kSize);
    const float rounded = quantised.at<float>(i / kSize, i % kSize);
    const float value = map.disparity[static_cast<std::size_t>(i)];
    EXPECT_LE(std::abs(value - rounded), kQuantum / 2 + 1e-5F);
    before += std::pow(rounded - true_value, 2);
    after += std::pow(value - true_value, 2);
  }
  EXPECT_LT(after, before / 3);
}

TEST(RefineDepth, FilledHolesDoNotHideBlocksAndQuanta) {
  const TwoDiscs scene;
  cv::Mat small, large;
  cv::resize(scene.disparity, small, {}, 0.25, 0.25, cv::INTER_NEAREST);
  for (float& value : cv::Mat_<float>(small)) value = 0.05F * std::round(value / 0.05F);
  cv::resize(small, large, scene.disparity.size(), 0, 0, cv::INTER_NEAREST);
  std::vector<bool> holes(large.total(), false);
  std::mt19937_64 engine(4);
  std::uniform_real_distribution<float> any(-1, 1);
  for (int y = 40; y < 60; ++y) {
    for (int x = 120; x < 140; ++x) {
      holes[static_cast<std::size_t>(y * kSize + x)] = true;
      large.at<float>(y, x) += 0.01F * any(engine);
    }
  }
  DisparityMap map = MapOf(large);
  const DepthRefinement found = Refine(scene, &map, holes);
  EXPECT_EQ(found.block_px, 4);
  EXPECT_NEAR(found.quantum_px, 0.05, 1e-3);
}

TEST(RefineDepth, OutliersAreDropped) {
  const TwoDiscs scene;
  cv::Mat spoilt = scene.disparity.clone();
  for (int i = 0; i < 100; ++i) spoilt.at<float>(3 + 15 * (i / 10), 4 + 15 * (i % 10)) = 3;
  DisparityMap map = MapOf(spoilt);
  const DepthRefinement found = Refine(scene, &map);
  EXPECT_NEAR(found.outlier_share, 100.0 / (kSize * kSize), 2e-4);
  EXPECT_LT(scene.WrongShare(map), 3e-4);
}

TEST(RefineDepth, AFilledHoleGetsTheSurfaceOfItsColour) {
  const TwoDiscs scene;
  DisparityMap map = MapOf(scene.disparity);
  std::vector<bool> holes(map.disparity.size(), false);
  // A hole over the edge of the left disc was filled with the wall.
  for (int y = 55; y < 66; ++y) {
    for (int x = 82; x < 96; ++x) {
      const auto i = static_cast<std::size_t>(y * kSize + x);
      holes[i] = true;
      map.disparity[i] = -0.5F;
    }
  }
  const double before = scene.WrongShare(map);
  ASSERT_GT(before, 0.002);
  EXPECT_TRUE(Refine(scene, &map, holes).applied);
  EXPECT_LT(scene.WrongShare(map), before / 3);
}

TEST(RefineDepth, TheResultDoesNotDependOnTheThreads) {
  const TwoDiscs scene;
  cv::Mat blurred;
  cv::GaussianBlur(scene.disparity, blurred, {}, 2);
  DisparityMap one = MapOf(blurred), four = MapOf(blurred);
  Refine(scene, &one, {}, 1);
  Refine(scene, &four, {}, 4);
  EXPECT_EQ(one.disparity, four.disparity);
}

TEST(RefineDepth, AnotherUnitOfTheMapChangesNothing) {
  const TwoDiscs scene;
  cv::Mat blurred;
  cv::GaussianBlur(scene.disparity, blurred, {}, 2);
  // A power of two keeps the digits.
  constexpr float kUnits = 16;
  DisparityMap map = MapOf(blurred), other = map;
  for (float& value : other.disparity) value *= kUnits;
  other.step = {1 / kUnits, 1 / kUnits};
  const DepthRefinement found = Refine(scene, &map), found_other = Refine(scene, &other);
  EXPECT_EQ(found.message, found_other.message);
  for (float& value : map.disparity) value *= kUnits;
  EXPECT_EQ(map.disparity, other.disparity);
}

TEST(RefineDepth, OtherSizesAreRefused) {
  const TwoDiscs scene;
  DisparityMap map = MapOf(scene.disparity(cv::Rect(0, 0, 80, 160)).clone());
  try {
    Refine(scene, &map);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("80x160"));
  }
}

TEST(SharpenEdges, ASlopeIsNoEdge) {
  cv::Mat slope(64, 64, CV_32F);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) slope.at<float>(y, x) = 0.08F * static_cast<float>(x);
  }
  cv::Mat map = slope.clone();
  SharpenEdges(8, 0.25, &map);
  EXPECT_EQ(cv::norm(map(cv::Rect(16, 0, 32, 64)), slope(cv::Rect(16, 0, 32, 64)), cv::NORM_INF),
            0);
}

TEST(MapFaults, ExactMapsHaveNoBlocksAndNoQuantum) {
  const TwoDiscs scene;
  EXPECT_EQ(FindBlocks(scene.disparity).size_px(), 1);
  // The truth is a multiple of the slopes per px, which is far below any rounding that matters.
  EXPECT_LT(QuantumOf(scene.disparity, 0.25), 0.0025);
  // Few flat surfaces are neither.
  cv::Mat flat(100, 100, CV_32F, cv::Scalar(0));
  flat(cv::Rect(20, 30, 40, 20)) = 1;
  EXPECT_EQ(FindBlocks(flat).size_px(), 1);
  EXPECT_EQ(QuantumOf(flat, 0.25), 0);
}

TEST(MapFaults, AQuantumIsSmallAndDividesTheDifferences) {
  const auto map_of = [](const std::vector<float>& layers) {
    cv::Mat map(10, static_cast<int>(layers.size()), CV_32F);
    for (int x = 0; x < map.cols; ++x) map.col(x) = static_cast<double>(layers[std::size_t(x)]);
    return map;
  };
  // Some levels may be absent.
  EXPECT_NEAR(QuantumOf(map_of({0, 0.1F, 0.2F, 0.5F, 0.6F, 0.7F, 1.4F, 1.5F}), 0.25), 0.1, 1e-6);
  EXPECT_EQ(QuantumOf(map_of({0, 0.5F, 1, 1.5F, 2, 2.5F}), 0.25), 0);
  EXPECT_EQ(QuantumOf(map_of({0, 0.07F, 0.17F, 0.23F, 0.38F, 0.49F, 0.54F, 0.78F}), 0.25), 0);
}

TEST(MapFaults, SmoothingTheQuantaDoesNotDependOnTheThreads) {
  const TwoDiscs scene;
  cv::Mat quantised = scene.disparity.clone();
  for (float& value : cv::Mat_<float>(quantised)) value = 0.1F * std::round(value / 0.1F);
  const cv::Mat one = WithoutQuanta(quantised, 0.1, 1), four = WithoutQuanta(quantised, 0.1, 4);
  EXPECT_EQ(cv::norm(one, four, cv::NORM_INF), 0);
  EXPECT_GT(cv::norm(one, quantised, cv::NORM_INF), 0.03);
}

}  // namespace
}  // namespace thicklens::estimator
