// Whether a photograph contradicts its depth map, and which causes are named.
#include "thicklens/estimator/depth_contradiction.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "estimator/scene/jpeg_blocks.h"
#include "support/layered_scene.h"
#include "thicklens/base/error.h"

namespace thicklens::estimator {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Not;
using thicklens::testing::LayeredScene;

constexpr int kSizePx = 192;

std::vector<std::string> CausesOf(const DepthContradiction& found) {
  std::vector<std::string> names;
  for (const DepthCauseTrial& cause : found.causes) names.push_back(DepthCauseName(cause.cause));
  return names;
}

// Describes each trial, for messages of failed tests.
std::string TrialsOf(const DepthContradiction& found) {
  std::string text = found.message;
  for (const DepthCauseTrial& trial : found.trials) {
    text += "\n  " + DepthCauseName(trial.cause) + " scale " + std::to_string(trial.scale) +
            " offset " + std::to_string(trial.offset_px) + " edges " +
            std::to_string(trial.edges.value_or(-99)) + " spectra " +
            std::to_string(trial.spectra.value_or(-99)) + " +- " +
            std::to_string(trial.spectra_sigma.value_or(-99)) + " residual " +
            std::to_string(trial.residual.value_or(-99));
  }
  return text;
}

// The photograph of one scene with a map of `value`(x, y) of the true map.
template <typename Value>
EstimateInput WithMap(const LayeredScene& scene, const Value& value) {
  EstimateInput input = scene.input();
  const DisparityMap& truth = scene.input().disparity;
  const auto at = [&truth](int x, int y) {
    const int column = std::clamp(x, 0, truth.width_px - 1);
    const int row = std::clamp(y, 0, truth.height_px - 1);
    return truth
        .disparity[static_cast<std::size_t>(row) * static_cast<std::size_t>(truth.width_px) +
                   static_cast<std::size_t>(column)];
  };
  std::size_t i = 0;
  for (int y = 0; y < truth.height_px; ++y) {
    for (int x = 0; x < truth.width_px; ++x) input.disparity.disparity[i++] = value(at, x, y);
  }
  return input;
}

DepthContradiction Check(const EstimateInput& input) {
  DepthContradictionOptions options;
  options.threads = 1;
  return CheckContradiction(input, options);
}

TEST(DepthContradiction, ARightMapIsNotAccusedEvenIfItsEdgesAreOff) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const LayeredScene scene(seed, kSizePx, kSizePx, seed == 2 ? 4 : 1);
    const DepthContradiction exact = Check(scene.input());
    EXPECT_FALSE(exact.is_contradicted) << seed << ": " << TrialsOf(exact);
    EXPECT_GT(exact.trials.front().edges.value_or(0), 4) << seed;
    constexpr int kDilationPx = 3;
    const DepthContradiction dilated = Check(WithMap(scene, [](const auto& at, int x, int y) {
      float nearest = at(x, y);
      for (int j = -kDilationPx; j <= kDilationPx; ++j) {
        for (int i = -kDilationPx; i <= kDilationPx; ++i)
          nearest = std::max(nearest, at(x + i, y + j));
      }
      return nearest;
    }));
    EXPECT_FALSE(dilated.is_contradicted) << seed << ": " << TrialsOf(dilated);
    constexpr int kCellPx = 8;
    const DepthContradiction coarse = Check(WithMap(scene, [](const auto& at, int x, int y) {
      return at(x / kCellPx * kCellPx + kCellPx / 2, y / kCellPx * kCellPx + kCellPx / 2);
    }));
    EXPECT_FALSE(coarse.is_contradicted) << seed << ": " << TrialsOf(coarse);
  }
}

TEST(DepthContradiction, AnotherOrderIsNamed) {
  const LayeredScene scene(4, kSizePx, kSizePx);
  constexpr int kLast = kSizePx - 1;
  const auto causes = [&](const auto& value) {
    const DepthContradiction found = Check(WithMap(scene, value));
    EXPECT_TRUE(found.is_contradicted) << TrialsOf(found);
    return CausesOf(found);
  };
  EXPECT_THAT(causes([](const auto& at, int x, int y) { return at(x, kLast - y); }),
              ElementsAre("rows"));
  EXPECT_THAT(causes([](const auto& at, int x, int y) { return at(kLast - x, y); }),
              ElementsAre("columns"));
  EXPECT_THAT(causes([](const auto& at, int x, int y) { return at(kLast - x, kLast - y); }),
              ElementsAre("both"));
  // The map as it is turned counter-clockwise shows the right column of the scene on top.
  EXPECT_THAT(causes([](const auto& at, int x, int y) { return at(kLast - y, x); }),
              ElementsAre("quarter-right"));
  EXPECT_THAT(causes([](const auto& at, int x, int y) { return at(y, kLast - x); }),
              ElementsAre("quarter-left"));
}

TEST(DepthContradiction, AMapBesideThePhotographIsNamedWithItsPlace) {
  const LayeredScene scene(5, kSizePx, 144);
  const DepthContradiction found =
      Check(WithMap(scene, [](const auto& at, int x, int y) { return at(x - 14, y + 8); }));
  ASSERT_THAT(CausesOf(found), ElementsAre("shift")) << TrialsOf(found);
  EXPECT_NEAR(found.causes.front().shift_x_px, -14, 3);
  EXPECT_NEAR(found.causes.front().shift_y_px, 8, 3);
}

TEST(DepthContradiction, TheMapOfAnotherImageIsNamed) {
  for (unsigned seed = 6; seed <= 8; ++seed) {
    const LayeredScene scene(seed, kSizePx, 144), other(seed + 10, kSizePx, 144);
    EstimateInput input = scene.input();
    input.disparity = other.input().disparity;
    const DepthContradiction found = Check(input);
    EXPECT_TRUE(found.is_contradicted) << TrialsOf(found);
    EXPECT_THAT(CausesOf(found), Contains("other-image")) << seed << ": " << TrialsOf(found);
  }
}

TEST(DepthContradiction, NearAndFarThatAreExchangedAreNamed) {
  const LayeredScene scene(9, 128, 128);
  const DepthContradiction found =
      Check(WithMap(scene, [](const auto& at, int x, int y) { return -at(x, y); }));
  ASSERT_THAT(CausesOf(found), ElementsAre("sign")) << TrialsOf(found);
  EXPECT_GE(found.causes.front().residual.value_or(0), 4);
}

// Values are proposed that predict the blur of the right ones, whatever their sign, for the
// background and for things nearer than the plane of focus.
TEST(DepthContradiction, WrongValuesAreNamedWithBetterOnes) {
  const LayeredScene scene(10, 2 * kSizePx, kSizePx);
  for (const auto& [factor, offset] : {std::pair{2.0F, 0.0F}, {1.0F, 1.5F}}) {
    const DepthContradiction found =
        Check(WithMap(scene, [f = factor, o = offset](const auto& at, int x, int y) {
          return f * at(x, y) + o;
        }));
    ASSERT_TRUE(found.is_contradicted) << TrialsOf(found);
    const DepthCauseTrial& cause = found.causes.front();
    EXPECT_TRUE(cause.cause == DepthCause::kScale || cause.cause == DepthCause::kOffset ||
                cause.cause == DepthCause::kScaleOffset)
        << TrialsOf(found);
    for (const double truth : {LayeredScene::kFarPx, 0.4}) {
      const double proposed = cause.scale * (factor * truth + offset) + cause.offset_px;
      EXPECT_NEAR(std::abs(proposed), std::abs(truth), 0.4) << TrialsOf(found);
    }
  }
}

// Stores an image as JPEG does, with steps of 24 grey levels for the high frequencies of its
// blocks.
void Compress(model::LinearImage* image) {
  constexpr int kBlock = 8;
  constexpr double kPi = 3.14159265358979323846;
  const auto wave = [](int k, int n) {
    return std::sqrt((k == 0 ? 1.0 : 2.0) / kBlock) * std::cos(kPi * (2 * n + 1) * k / 16);
  };
  const auto at = [image](int x, int y) -> float& {
    return image->values[static_cast<std::size_t>(y) * static_cast<std::size_t>(image->width_px) +
                         static_cast<std::size_t>(x)];
  };
  for (int y = 0; y + kBlock <= image->height_px; y += kBlock) {
    for (int x = 0; x + kBlock <= image->width_px; x += kBlock) {
      std::vector<double> stored(kBlock * kBlock);
      for (int k = 0; k < kBlock; ++k) {
        for (int l = 0; l < kBlock; ++l) {
          double sum = 0;
          for (int i = 0; i < kBlock * kBlock; ++i) {
            sum += 255 * static_cast<double>(at(x + i % kBlock, y + i / kBlock)) *
                   wave(k, i % kBlock) * wave(l, i / kBlock);
          }
          const double step = 2 + 2 * (k + l);
          const double kept = step * std::round(sum / step);
          for (int i = 0; i < kBlock * kBlock; ++i) {
            stored[static_cast<std::size_t>(i)] += kept * wave(k, i % kBlock) * wave(l, i / kBlock);
          }
        }
      }
      for (int i = 0; i < kBlock * kBlock; ++i) {
        at(x + i % kBlock, y + i / kBlock) =
            static_cast<float>(std::round(stored[static_cast<std::size_t>(i)]) / 255);
      }
    }
  }
}

// Spectra of compressed images say little of their blur, but their edges stay.
TEST(DepthContradiction, CompressionThatNoFileStatesIsSeen) {
  const LayeredScene scene(11, kSizePx, kSizePx);
  EstimateInput input = scene.input();
  EXPECT_FALSE(ShowsJpegBlocks(input.image, input.transfer));
  Compress(&input.image);
  EXPECT_TRUE(ShowsJpegBlocks(input.image, input.transfer));
  const DepthContradiction found = Check(input);
  EXPECT_FALSE(found.is_contradicted) << TrialsOf(found);
  for (const DepthCauseTrial& trial : found.trials) EXPECT_FALSE(trial.spectra);
  for (float& value : input.disparity.disparity) value *= 2;
  EXPECT_THAT(CausesOf(Check(input)), Not(Contains("scale")));
  model::FlipDepth(model::DepthFlip::kRows, kSizePx, &input.disparity.disparity);
  EXPECT_THAT(CausesOf(Check(input)), ElementsAre("rows"));
}

TEST(DepthContradiction, WhatAgreesIsNotTestedFurther) {
  const LayeredScene scene(12, kSizePx, 144);
  DepthContradictionOptions options;
  options.check_values = false;
  const DepthContradiction found = CheckContradiction(scene.input(), options);
  EXPECT_FALSE(found.is_contradicted);
  EXPECT_EQ(found.trials.size(), 1U) << TrialsOf(found);
  EXPECT_THAT(found.message, ::testing::HasSubstr("lie on edges"));
}

TEST(DepthContradiction, ASmallPhotographShowsNothing) {
  const LayeredScene scene(13, 40, 40);
  const DepthContradiction found = Check(scene.input());
  EXPECT_FALSE(found.is_contradicted);
  EXPECT_THAT(found.causes, IsEmpty());
  EXPECT_THAT(found.message, ::testing::HasSubstr("less than 48 px"));
  DepthContradictionOptions options;
  options.photo_aperture = -1;
  EXPECT_THROW(CheckContradiction(scene.input(), options), Error);
}

}  // namespace
}  // namespace thicklens::estimator
