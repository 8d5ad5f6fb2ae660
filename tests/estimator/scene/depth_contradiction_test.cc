// Whether a photograph contradicts its depth map, and which causes are named.
#include "thicklens/estimator/depth_contradiction.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "estimator/scene/depth_evidence.h"
#include "estimator/scene/jpeg_blocks.h"
#include "support/layered_scene.h"
#include "thicklens/base/error.h"

namespace thicklens::estimator {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
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

// The photograph of a textured surface whose disparity rises from left to right, and its map. The
// photograph is made without the estimator: points are moved view by view and averaged.
EstimateInput SlantedSurface(int width_px, int height_px, double first_px, double last_px) {
  constexpr int kSide = 256, kDiscs = 5000, kViews = LayeredScene::kViews;
  std::mt19937 random(21);
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<float> texture(static_cast<std::size_t>(kSide) * kSide, 0.5F);
  const auto place = [](int x, int y) {
    return static_cast<std::size_t>(y & (kSide - 1)) * kSide +
           static_cast<std::size_t>(x & (kSide - 1));
  };
  for (int disc = 0; disc < kDiscs; ++disc) {
    const double radius = 2 / std::sqrt(2e-3 + unit(random));
    const double x = kSide * unit(random), y = kSide * unit(random);
    const auto value = static_cast<float>(0.2 + 0.6 * unit(random));
    const int reach = static_cast<int>(radius) + 1;
    for (int j = -reach; j <= reach; ++j) {
      for (int i = -reach; i <= reach; ++i) {
        const int column = static_cast<int>(x) + i, row = static_cast<int>(y) + j;
        if (std::hypot(column - x, row - y) <= radius) texture[place(column, row)] = value;
      }
    }
  }
  EstimateInput input;
  input.weights = Eigen::ArrayXXd::Constant(kViews, kViews, 1.0 / (kViews * kViews));
  input.transfer = model::TransferCurve::Linear();
  input.image = {width_px, height_px, 1, {}};
  input.disparity = {width_px, height_px, {}, {1, 1}};
  std::normal_distribution<double> noise(0, 1.0 / 255);
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) {
      const double disparity = first_px + (last_px - first_px) * x / (width_px - 1);
      double sum = 0;
      for (int view = 0; view < kViews * kViews; ++view) {
        const double s = x + disparity * (view % kViews - kViews / 2);
        const double t = y + disparity * (view / kViews - kViews / 2);
        const int i = static_cast<int>(std::floor(s)), j = static_cast<int>(std::floor(t));
        const double a = s - i, b = t - j;
        const auto at = [&](int k, int l) { return static_cast<double>(texture[place(k, l)]); };
        sum += (1 - b) * ((1 - a) * at(i, j) + a * at(i + 1, j)) +
               b * ((1 - a) * at(i, j + 1) + a * at(i + 1, j + 1));
      }
      const double stored = std::clamp(sum / (kViews * kViews) + noise(random), 0.0, 1.0);
      input.image.values.push_back(static_cast<float>(std::round(255 * stored) / 255));
      input.disparity.disparity.push_back(static_cast<float>(disparity));
    }
  }
  return input;
}

// The texture may be what all parts have in common, so that one depth everywhere shows no blur.
TEST(DepthContradiction, OneDepthEverywhereShowsNoValues) {
  EstimateInput input = SlantedSurface(2 * kSizePx, kSizePx, 0.9, 0.9);
  for (float& disparity : input.disparity.disparity) disparity -= 0.9F;
  const DepthContradiction found = Check(input);
  EXPECT_FALSE(found.is_contradicted) << TrialsOf(found);
  EXPECT_THAT(found.values_untested, HasSubstr("about the same everywhere"));
}

// More than 2^20 px are compared at half the size, but an offset is stated in px of the photograph.
TEST(DepthContradiction, AnOffsetIsInPixelsOfTheWholePhotograph) {
  constexpr float kOffsetPx = 1.5F;
  EstimateInput input = SlantedSurface(1300, 900, -1.6, 1.6);
  for (float& value : input.disparity.disparity) value += kOffsetPx;
  const DepthContradiction found = Check(input);
  ASSERT_TRUE(found.is_contradicted) << TrialsOf(found);
  const DepthCauseTrial& cause = found.causes.front();
  for (const double truth : {-1.2, 0.4}) {
    const double proposed =
        cause.scale * (truth + static_cast<double>(kOffsetPx)) + cause.offset_px;
    EXPECT_NEAR(std::abs(proposed), std::abs(truth), 0.4) << TrialsOf(found);
  }
}

// The contours of a slanted surface in a map of few levels are no edges of things, and neither are
// single pixels.
TEST(DepthContradiction, LevelsAndSinglePixelsSayNothing) {
  const EstimateInput truth = SlantedSurface(kSizePx, kSizePx, -1.6, 1.6);
  EstimateInput levels = truth;
  for (float& value : levels.disparity.disparity) {
    value = std::round((value + 1.6F) * 15 / 3.2F) * 3.2F / 15 - 1.6F;
  }
  EstimateInput noisy = truth;
  std::mt19937 random(22);
  std::uniform_real_distribution<float> unit(0, 1);
  for (float& value : noisy.disparity.disparity) {
    if (unit(random) < 0.02F) value = 3.2F * unit(random) - 1.6F;
  }
  for (const EstimateInput& input : {levels, noisy}) {
    const DepthContradiction found = Check(input);
    EXPECT_FALSE(found.is_contradicted) << TrialsOf(found);
    EXPECT_FALSE(found.trials.front().edges) << TrialsOf(found);
    EXPECT_THAT(found.message, HasSubstr("cannot be compared")) << TrialsOf(found);
  }
}

TEST(DepthContradiction, AMapWithoutEdgesHasNoSign) {
  const LayeredScene scene(14, 96, 96);
  const DepthContradiction found =
      Check(WithMap(scene, [](const auto& /*at*/, int /*x*/, int /*y*/) { return 0.4F; }));
  EXPECT_FALSE(found.trials.front().edges);
  for (const DepthCauseTrial& trial : found.trials)
    EXPECT_NE(trial.cause, DepthCause::kSign) << TrialsOf(found);
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
  EXPECT_THAT(found.values_untested, HasSubstr("compression"));
  EXPECT_THAT(found.message,
              AllOf(HasSubstr("were not tested"), Not(HasSubstr("no other values"))));
  for (float& value : input.disparity.disparity) value *= 2;
  EXPECT_THAT(CausesOf(Check(input)), Not(Contains("scale")));
  model::FlipDepth(model::DepthFlip::kRows, kSizePx, &input.disparity.disparity);
  EXPECT_THAT(CausesOf(Check(input)), ElementsAre("rows"));
}

// Adds lamps to the background of a scene, whose rays no object stops, and cuts the photograph off
// at full scale. Returns their number, at most 5.
int AddClippedLamps(EstimateInput* input) {
  constexpr int kGridPx = 12, kReachPx = 8, kViews = LayeredScene::kViews, kMost = 5;
  constexpr double kLight = 30, kHalfWidthPx = 1.5;
  const int width = input->image.width_px, height = input->image.height_px;
  const auto index = [width](int x, int y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(x);
  };
  std::vector<double> light(input->image.values.begin(), input->image.values.end());
  int lamps = 0;
  for (int lamp_y = kGridPx; lamp_y + kGridPx <= height; lamp_y += 2 * kGridPx) {
    for (int lamp_x = kGridPx; lamp_x + kGridPx <= width; lamp_x += 2 * kGridPx) {
      bool is_background = true;
      for (int y = lamp_y - kReachPx; y <= lamp_y + kReachPx; ++y) {
        for (int x = lamp_x - kReachPx; x <= lamp_x + kReachPx; ++x) {
          const auto disparity = static_cast<double>(input->disparity.disparity[index(x, y)]);
          is_background = is_background && std::abs(disparity - LayeredScene::kFarPx) < 1e-3;
        }
      }
      if (!is_background || lamps == kMost) continue;
      ++lamps;
      const auto cover = [](double at) { return std::clamp(kHalfWidthPx + 0.5 - at, 0.0, 1.0); };
      for (int y = lamp_y - kReachPx; y <= lamp_y + kReachPx; ++y) {
        for (int x = lamp_x - kReachPx; x <= lamp_x + kReachPx; ++x) {
          for (int view = 0; view < kViews * kViews; ++view) {
            const double a = view % kViews - kViews / 2, b = view / kViews - kViews / 2;
            light[index(x, y)] += kLight / (kViews * kViews) *
                                  cover(std::abs(x + LayeredScene::kFarPx * a - lamp_x)) *
                                  cover(std::abs(y + LayeredScene::kFarPx * b - lamp_y));
          }
        }
      }
    }
  }
  input->clipped.clear();
  for (std::size_t i = 0; i < light.size(); ++i) {
    input->clipped.push_back(light[i] >= 1 ? 1 : 0);
    input->image.values[i] = static_cast<float>(std::min(light[i], 1.0));
  }
  return lamps;
}

// Where values are only lower bounds, light is missing that no map explains.
TEST(DepthContradiction, ClippedLampsAccuseNoRightMap) {
  EstimateInput input = LayeredScene(1, kSizePx, kSizePx).input();
  ASSERT_EQ(AddClippedLamps(&input), 5);
  const DepthContradiction found = Check(input);
  EXPECT_FALSE(found.is_contradicted) << TrialsOf(found);
}

TEST(DepthContradiction, ResidualsCountOnlyBelowClippedValues) {
  EstimateInput input = LayeredScene(14, 128, 128).input();
  ASSERT_EQ(AddClippedLamps(&input), 4);
  const auto squares = [&](const ClippedValues& clipped) {
    const ReducedPhoto photo{input.image, input.disparity, 1, clipped};
    const std::vector<double> of_blocks = ExplainedBy(photo, input.disparity, input, 1, 1).squares;
    return std::accumulate(of_blocks.begin(), of_blocks.end(), 0.0);
  };
  EXPECT_LT(squares(input.clipped), squares({}));
}

TEST(DepthContradiction, TilesWithClippedPixelsShowNoBlur) {
  const EstimateInput input = LayeredScene(15, kSizePx, kSizePx).input();
  const auto tiles = [&](const ClippedValues& clipped) {
    return TileLikelihood({input.image, input.disparity, 1, clipped}, input, 1, 1.0 / 255, 1)
        .tiles();
  };
  const std::size_t all = tiles({});
  ASSERT_GE(all, TileLikelihood::kMinTiles);
  ClippedValues clipped(input.image.values.size(), 0);
  EXPECT_EQ(tiles(clipped), all);
  for (std::size_t i = 0; i < clipped.size(); ++i) {
    if (i % kSizePx < kSizePx / 2) clipped[i] = 1;
  }
  EXPECT_LT(tiles(clipped), all);
  std::fill(clipped.begin(), clipped.end(), std::uint8_t{1});
  EXPECT_EQ(tiles(clipped), 0U);
}

// Blur does not show the sign: it is tested also where the values are not.
TEST(DepthContradiction, OnlyTheSignOfValuesThatAgreeIsTested) {
  DepthContradictionOptions options;
  options.check_values = false;
  const LayeredScene scene(12, kSizePx, 144);
  const DepthContradiction found = CheckContradiction(scene.input(), options);
  EXPECT_FALSE(found.is_contradicted) << TrialsOf(found);
  for (const DepthCauseTrial& trial : found.trials) EXPECT_FALSE(trial.spectra);
  EXPECT_THAT(found.message, AllOf(HasSubstr("lie on edges"), HasSubstr("were not tested")));
  const LayeredScene other(9, 128, 128);
  EXPECT_THAT(CausesOf(CheckContradiction(
                  WithMap(other, [](const auto& at, int x, int y) { return -at(x, y); }), options)),
              ElementsAre("sign"));
}

// Edges of a strip are compared within its width only.
TEST(DepthContradiction, AStripShowsNothing) {
  const LayeredScene scene(15, 64, 3000);
  const DepthContradiction found = Check(scene.input());
  EXPECT_FALSE(found.is_contradicted) << TrialsOf(found);
  EXPECT_THAT(found.message, HasSubstr("less than 48 px at 1/2"));
  const LayeredScene narrow(16, 20, 1500);
  const auto place = EdgeCoincidence(narrow.input().image, narrow.input().transfer)
                         .Of(narrow.input().disparity, 24);
  ASSERT_TRUE(place);
  EXPECT_LE(std::max(std::abs(place->best_x), std::abs(place->best_y)), 6);
}

TEST(DepthContradiction, ASmallPhotographShowsNothing) {
  const LayeredScene scene(13, 40, 40);
  const DepthContradiction found = Check(scene.input());
  EXPECT_FALSE(found.is_contradicted);
  EXPECT_THAT(found.causes, IsEmpty());
  EXPECT_THAT(found.message, HasSubstr("less than 48 px"));
  EXPECT_THAT(found.values_untested, HasSubstr("less than 48 px"));
  DepthContradictionOptions options;
  options.photo_aperture = -1;
  EXPECT_THROW(CheckContradiction(scene.input(), options), Error);
}

}  // namespace
}  // namespace thicklens::estimator
