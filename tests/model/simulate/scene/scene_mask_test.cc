#include "model/simulate/scene/scene_mask.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "model/base/random_draws.h"
#include "model/simulate/scene/image_bounds.h"
#include "support/error_message.h"
#include "support/test_cameras.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;
using thicklens::testing::ErrorOf;
using thicklens::testing::TestCamera;
using thicklens::testing::TestSensor;
using thicklens::testing::ThickMacroLens;

constexpr int kWidth = 37, kHeight = 26;

LinearImage MaskOf(const std::vector<float>& values) { return {kWidth, kHeight, 1, values}; }

// Some of random numbers, some of blots with empty and full parts between.
std::vector<float> RandomValues(unsigned seed) {
  RandomDraws draws(seed, RandomDraws::Purpose::kTexture, 0);
  std::vector<float> values(kWidth * kHeight);
  const double x0 = kWidth * draws.Uniform(), y0 = kHeight * draws.Uniform();
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double noise = draws.Uniform();
      values[static_cast<std::size_t>(y * kWidth + x)] =
          static_cast<float>(seed % 2 == 0                             ? noise
                             : std::hypot(x - x0, y - y0) + noise < 12 ? 0.5 + noise
                                                                       : 0.1);
    }
  }
  return values;
}

double Bilinear(const std::vector<float>& values, double x, double y) {
  x = std::clamp(x, 0.0, kWidth - 1.0);
  y = std::clamp(y, 0.0, kHeight - 1.0);
  double sum = 0;
  for (int j = 0; j < kHeight; ++j) {
    for (int i = 0; i < kWidth; ++i) {
      sum += static_cast<double>(values[static_cast<std::size_t>(j * kWidth + i)]) *
             std::max(0.0, 1 - std::abs(x - i)) * std::max(0.0, 1 - std::abs(y - j));
    }
  }
  return sum;
}

TEST(ImageBoundsTest, HoldWhatIsInTheRegionAndNotMuchMore) {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const std::vector<float> values = RandomValues(seed);
    const auto at = [&](int x, int y) {
      return static_cast<double>(values[static_cast<std::size_t>(y * kWidth + x)]);
    };
    const ImageBounds bounds(kWidth, kHeight, at);
    RandomDraws draws(seed, RandomDraws::Purpose::kTexture, 1);
    for (int i = 0; i < 50; ++i) {
      ImageRegion region;
      region.low_px = {60 * draws.Uniform() - 12, 50 * draws.Uniform() - 12};
      const double size = std::pow(40, draws.Uniform()) - 1;
      region.high_px = region.low_px + size * Eigen::Vector2d(draws.Uniform(), draws.Uniform());
      const ValueRange found = bounds.Over(region);
      // The bounds must lie within the values of a larger region. Its margin allows for the blocks
      // of 4 px.
      const double margin = 5 + size / 2 + 4;
      ValueRange widest = {std::numeric_limits<double>::infinity(),
                           -std::numeric_limits<double>::infinity()};
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          const auto away = [&](double p, double low, double high, double last) {
            return std::max(std::min(low, last) - p, p - std::max(high, 0.0));
          };
          if (away(x, region.low_px.x(), region.high_px.x(), kWidth - 1) > margin) continue;
          if (away(y, region.low_px.y(), region.high_px.y(), kHeight - 1) > margin) continue;
          widest = {std::min(widest.low, at(x, y)), std::max(widest.high, at(x, y))};
        }
      }
      EXPECT_GE(found.low, widest.low);
      EXPECT_LE(found.high, widest.high);
      for (int k = 0; k < 10; ++k) {
        const Eigen::Vector2d part(draws.Uniform(), draws.Uniform());
        const Eigen::Vector2d there =
            region.low_px + part.cwiseProduct(region.high_px - region.low_px);
        const double value = Bilinear(values, there.x(), there.y());
        EXPECT_GE(value, found.low - 1e-12);
        EXPECT_LE(value, found.high + 1e-12);
      }
    }
  }
}

TEST(SceneMaskTest, InsideIsWhereItsBilinearValuesAreAtLeastHalf) {
  int covered = 0, untouched = 0, inside = 0, positions = 0;
  for (unsigned seed = 1; seed <= 120; ++seed) {
    const std::vector<float> values = RandomValues(seed);
    const SceneMask mask(MaskOf(values), kWidth, kHeight, "mask");
    RandomDraws draws(seed, RandomDraws::Purpose::kTexture, 1);
    ImageRegion hull = {{1e9, 1e9}, {-1e9, -1e9}};
    for (int i = 0; i < 60; ++i) {
      const Eigen::Vector2d centre_px(std::floor(48 * draws.Uniform() - 6),
                                      std::floor(38 * draws.Uniform() - 6));
      constexpr int kCount = 20;
      float x_px[kCount], y_px[kCount];
      bool is_inside[kCount];
      ImageRegion region = {{1e9, 1e9}, {-1e9, -1e9}};
      const double spread = 4 * draws.Uniform();
      for (int k = 0; k < kCount; ++k) {
        x_px[k] = static_cast<float>(spread * draws.Normal());
        y_px[k] = static_cast<float>(spread * draws.Normal());
        const Eigen::Vector2d at = centre_px + Eigen::Vector2d(x_px[k], y_px[k]);
        region.low_px = region.low_px.cwiseMin(at);
        region.high_px = region.high_px.cwiseMax(at);
      }
      mask.AreInside(centre_px, x_px, y_px, kCount, is_inside);
      const bool covers = mask.Covers(region), may_touch = mask.MayTouch(region);
      covered += covers;
      untouched += !may_touch;
      for (int k = 0; k < kCount; ++k) {
        const Eigen::Vector2d at = centre_px + Eigen::Vector2d(x_px[k], y_px[k]);
        const double value = Bilinear(values, at.x(), at.y());
        if (std::abs(value - 0.5) > 1e-9) {
          EXPECT_EQ(is_inside[k], value > 0.5);
          EXPECT_EQ(mask.IsInside(at), value > 0.5);
        }
        EXPECT_TRUE(!covers || is_inside[k]);
        EXPECT_TRUE(may_touch || !is_inside[k]);
        inside += is_inside[k];
        ++positions;
        if (!is_inside[k]) continue;
        hull.low_px = hull.low_px.cwiseMin(at);
        hull.high_px = hull.high_px.cwiseMax(at);
      }
    }
    EXPECT_TRUE((hull.low_px.array() >= mask.extent().low_px.array()).all());
    EXPECT_TRUE((hull.high_px.array() <= mask.extent().high_px.array()).all());
  }
  EXPECT_GT(inside, positions / 10);
  EXPECT_GT(covered, 15);
  EXPECT_GT(untouched, 300);
}

TEST(SceneMaskTest, ExtentEndsWhereTheOutermostBorderIs) {
  std::vector<float> values(kWidth * kHeight, 0.0F);
  const auto put = [&](int x, int y, float value) {
    values[static_cast<std::size_t>(y * kWidth + x)] = value;
  };
  put(10, 7, 1);
  put(11, 7, 0.75F);
  put(10, 8, 0.5F);
  const ImageRegion extent = SceneMask(MaskOf(values), kWidth, kHeight, "mask").extent();
  EXPECT_DOUBLE_EQ(extent.low_px.x(), 9.5);
  EXPECT_DOUBLE_EQ(extent.low_px.y(), 6.5);
  EXPECT_DOUBLE_EQ(extent.high_px.x(), 11 + 1 / 3.0);
  EXPECT_DOUBLE_EQ(extent.high_px.y(), 8);
  put(0, 7, 1);
  put(3, kHeight - 1, 1);
  const ImageRegion open = SceneMask(MaskOf(values), kWidth, kHeight, "mask").extent();
  EXPECT_EQ(open.low_px.x(), -std::numeric_limits<double>::infinity());
  EXPECT_EQ(open.high_px.y(), std::numeric_limits<double>::infinity());
  EXPECT_DOUBLE_EQ(open.high_px.x(), extent.high_px.x());
}

TEST(SceneMaskTest, WrongMasksAreReported) {
  const auto message = [](const LinearImage& image) {
    return ErrorOf([&] { SceneMask(image, kWidth, kHeight, "outline.mask 'm.png'"); });
  };
  EXPECT_EQ(message({}), "outline.mask 'm.png' is empty");
  EXPECT_EQ(message({kWidth, kHeight, 3, std::vector<float>(3 * kWidth * kHeight)}),
            "outline.mask 'm.png' has 3 channels: a mask must be a grey image with 1 channel");
  EXPECT_EQ(message({3, 2, 1, std::vector<float>(6, 1.0F)}),
            "outline.mask 'm.png' has 3x2 px, but the scene's image has 37x26 px: the sizes must "
            "be equal");
  EXPECT_EQ(message(MaskOf(std::vector<float>(kWidth * kHeight, 127 / 255.0F))),
            "outline.mask 'm.png' is empty: none of its 962 values is at least half of full scale");
}

// ------------------------------------------------------------------------------------ in scenes

// A card before a wall; its outline is a rectangle from column and row 12.5 to 30.5 and 20.5.
SceneSimulationOptions CardScene(const Eigen::Vector2d& slope) {
  SceneSimulationOptions options;
  options.camera = TestCamera("", ThickMacroLens(9), TestSensor(48, 40, 0.0045, {23.8, 19.1}),
                              {4 + 52 * 300.0 / 250, 0});
  options.layers.resize(2);
  options.layers[0].plane = {301, {0.2, 0}};
  options.layers[0].texture.kind = TextureKind::kSine;
  options.layers[1].plane = {298.5, slope};
  options.layers[1].texture.colour = {0.3, 0.6, 0.5};
  options.layers[1].outline.shape = OutlineOptions::Shape::kRectangle;
  options.layers[1].outline.centre = {21.5, 16.5};
  options.layers[1].outline.size = {18, 8};
  options.effects.without = {Effect::kDiffraction};
  return options;
}

// The mask has half of its value between the outermost pixels inside and the next ones, so that the
// borders are straight. A corner of a bilinear contour is cut off, and pixels near it are not
// compared.
TEST(SceneMaskTest, RectangleAsAMaskGivesTheImageOfTheOutline) {
  for (const Eigen::Vector2d& slope : {Eigen::Vector2d(0, 0), Eigen::Vector2d(-0.4, 0.3)}) {
    for (const bool occlusion : {true, false}) {
      SceneSimulationOptions drawn = CardScene(slope);
      if (!occlusion) drawn.effects.without.Add(Effect::kOcclusion);
      drawn.effects.base = EffectSelectionOptions::Base::kAll;
      SceneSimulationOptions masked = drawn;
      masked.layers[1].outline = {};
      masked.layers[1].outline.shape = OutlineOptions::Shape::kMask;
      LayerPixels card;
      card.mask = {48, 40, 1, std::vector<float>(48 * 40, 0.0F)};
      for (int y = 13; y <= 20; ++y) {
        std::fill_n(card.mask.values.begin() + 48 * y + 13, 18, 1.0F);
      }
      const SceneSimulator rectangle(drawn, {}), mask(masked, {{}, card});
      EXPECT_EQ(rectangle.RenderDepth().values, mask.RenderDepth().values);
      const LinearImage expected = rectangle.RenderNoiseless({1, {}});
      const LinearImage found = mask.RenderNoiseless({1, {}});
      const LinearImage expected_view = rectangle.RenderView({2, -3}, {1, {}});
      const LinearImage found_view = mask.RenderView({2, -3}, {1, {}});
      int compared = 0, edges = 0;
      for (int y = 0; y < 40; ++y) {
        for (int x = 0; x < 48; ++x) {
          // A Gaussian of 0.9 px, to where rays go.
          const double to_corner_px = std::max(std::min(std::abs(x - 12.5), std::abs(x - 30.5)),
                                               std::min(std::abs(y - 12.5), std::abs(y - 20.5)));
          if (to_corner_px < 3.9) continue;
          ++compared;
          edges += std::min({std::abs(x - 12.5), std::abs(x - 30.5), std::abs(y - 12.5),
                             std::abs(y - 20.5)}) < 1;
          for (int c = 0; c < 3; ++c) {
            // A ray on a border may be taken for one on its other side.
            EXPECT_NEAR(found.at(x, y, c), expected.at(x, y, c), 1e-3) << x << ", " << y;
            EXPECT_NEAR(found_view.at(x, y, c), expected_view.at(x, y, c), 1e-2) << x << ", " << y;
          }
        }
      }
      EXPECT_GT(compared, 900);
      EXPECT_GT(edges, 100);
    }
  }
}

TEST(SceneMaskTest, ReachesBeyondTheImageAsItEnds) {
  SceneSimulationOptions drawn = CardScene({0, 0});
  drawn.effects.base = EffectSelectionOptions::Base::kAll;
  drawn.layers[1].texture.kind = TextureKind::kUniform;
  SceneSimulationOptions masked = drawn;
  drawn.layers[1].outline.centre = {-987.5, 20};
  drawn.layers[1].outline.size = {2000, 4000};  // up to 12.5
  masked.layers[1].outline = {};
  masked.layers[1].outline.shape = OutlineOptions::Shape::kMask;
  LayerPixels card;
  card.mask = {48, 40, 1, std::vector<float>(48 * 40, 0.0F)};
  for (int y = 0; y < 40; ++y) std::fill_n(card.mask.values.begin() + 48 * y, 13, 1.0F);
  const LinearImage expected = SceneSimulator(drawn, {}).RenderNoiseless({1, {}});
  const LinearImage found = SceneSimulator(masked, {{}, card}).RenderNoiseless({1, {}});
  for (std::size_t i = 0; i < expected.values.size(); ++i) {
    EXPECT_NEAR(found.values[i], expected.values[i], 1e-3);
  }
}

TEST(SceneMaskTest, ALayerWithoutItsFileIsReportedByName) {
  SceneSimulationOptions options = CardScene({0, 0});
  options.layers[1].name = "card";
  options.layers[1].outline.shape = OutlineOptions::Shape::kMask;
  options.layers[1].outline.mask_path = "card.png";
  EXPECT_EQ(ErrorOf([&] { SceneSimulator(options, {}); }),
            "layers[1] 'card': outline.mask 'card.png' is empty");
  options.layers[1].outline.unit = OutlineOptions::Unit::kMm;
  EXPECT_THAT(ErrorOf([&] { SceneSimulator(options, {}); }), HasSubstr("a mask is given in mm"));
}

}  // namespace
}  // namespace thicklens::model
