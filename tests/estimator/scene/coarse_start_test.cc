#include "estimator/scene/coarse_start.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "thicklens/estimator/scene_solver.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::estimator {
namespace {

model::LinearImage Numbers(int width_px, int height_px, int channels) {
  model::LinearImage image{width_px, height_px, channels, {}};
  for (int i = 0; i < width_px * height_px * channels; ++i)
    image.values.push_back(static_cast<float>(i));
  return image;
}

TEST(CoarseStart, PixelsAreMeansOfFour) {
  const model::LinearImage half = HalfSize(Numbers(3, 3, 2));
  ASSERT_EQ(half.width_px, 2);
  ASSERT_EQ(half.height_px, 2);
  // Pixel (x, y) of channel c holds 2 (3 y + x) + c.
  EXPECT_FLOAT_EQ(half.at(0, 0, 0), (0 + 2 + 6 + 8) / 4.0F);
  EXPECT_FLOAT_EQ(half.at(0, 0, 1), (1 + 3 + 7 + 9) / 4.0F);
  EXPECT_FLOAT_EQ(half.at(1, 0, 0), (4 + 10) / 2.0F);
  EXPECT_FLOAT_EQ(half.at(1, 1, 1), 17);
}

TEST(CoarseStart, DisparityStaysOnItsSurfaceAtHalfTheStep) {
  const DisparityMap half = HalfSize(DisparityMap{3, 2, {1, 5, 2, 7, 7, 7}, {1, 0.5}});
  EXPECT_EQ(half.width_px, 2);
  EXPECT_EQ(half.height_px, 1);
  EXPECT_EQ(half.disparity, (std::vector<float>{1, 2}));
  EXPECT_EQ(half.step, Eigen::Vector2d(0.5, 0.25));
}

// A smooth difference comes through, in place, whatever the image has itself.
TEST(CoarseStart, DetailIsAddedWhereItBelongs) {
  const model::LinearImage image = Numbers(41, 31, 3);
  const model::LinearImage blurred = HalfSize(image);
  model::LinearImage sharp = blurred;
  const auto detail = [](double x, double y, int c) {
    return std::sin(0.3 * x + c) * std::cos(0.2 * y);
  };
  for (int y = 0; y < sharp.height_px; ++y) {
    for (int x = 0; x < sharp.width_px; ++x) {
      for (int c = 0; c < 3; ++c) {
        sharp.values[static_cast<std::size_t>((y * sharp.width_px + x) * 3 + c)] +=
            static_cast<float>(detail(2 * x + 0.5, 2 * y + 0.5, c));
      }
    }
  }
  const model::LinearImage full = WithDetail(image, blurred, sharp);
  for (int y = 4; y < 27; ++y) {
    for (int x = 4; x < 37; ++x) {
      for (int c = 0; c < 3; ++c)
        ASSERT_NEAR(full.at(x, y, c) - image.at(x, y, c), detail(x, y, c), 0.05) << x << "," << y;
    }
  }
}

// Strips of random grey, blurred by an even aperture; and noise.
struct Strips {
  std::vector<float> truth;  // of every row
  EstimateInput input;
};
Strips BlurredStrips(int size_px) {
  constexpr float kDisparityPx = 2.5F;
  std::mt19937 random(4);
  Strips strips;
  std::vector<float>& line = strips.truth;
  float value = 0;
  for (int x = 0; x < size_px; ++x) {
    if (x % 14 == 0) value = 0.2F + 0.1F * static_cast<float>(random() % 6);
    line.push_back(value);
  }
  EstimateInput& input = strips.input;
  input.weights = model::ApertureWeights(model::ApertureShape::kUniform, 5, 5);
  input.disparity = {
      size_px, size_px, std::vector<float>(line.size() * line.size(), kDisparityPx), {1, 1}};
  input.image = {size_px, size_px, 1, {}};
  const auto at = [&](int x) {
    return line[static_cast<std::size_t>(std::clamp(x, 0, size_px - 1))];
  };
  for (int y = 0; y < size_px; ++y) {
    for (int x = 0; x < size_px; ++x) {
      float sum = 0;
      for (int k = -2; k <= 2; ++k) {
        const float place = static_cast<float>(x) + kDisparityPx * static_cast<float>(k);
        const int below = static_cast<int>(std::floor(place));
        const float share = place - static_cast<float>(below);
        sum += 0.2F * ((1 - share) * at(below) + share * at(below + 1));
      }
      const float noise = static_cast<float>(random() % 1000) / 1000 - 0.5F;
      input.image.values.push_back(sum + 0.006F * noise);
    }
  }
  return strips;
}

double RmsError(const model::LinearImage& radiance, const std::vector<float>& truth) {
  constexpr int kBorderPx = 20;
  double sum = 0;
  int count = 0;
  for (int y = kBorderPx; y < radiance.height_px - kBorderPx; ++y) {
    for (int x = kBorderPx; x < radiance.width_px - kBorderPx; ++x, ++count) {
      const double error = double{radiance.at(x, y, 0)} - truth[static_cast<std::size_t>(x)];
      sum += error * error;
    }
  }
  return std::sqrt(sum / count);
}

// After a few steps, an image just large enough for a start at half its size is closer to the scene
// than one just too small. After many steps, both are at the same solution.
TEST(CoarseStart, SavesIterations) {
  SceneOptions options;
  options.max_iterations = 15;
  SceneSummary summary;
  SceneMaps large, small;
  const Strips of_256 = BlurredStrips(256), of_255 = BlurredStrips(255);
  EstimateScene(of_256.input, options, {}, &summary, &large);
  EstimateScene(of_255.input, options, {}, &summary, &small);
  EXPECT_LT(RmsError(large.radiance, of_256.truth), 0.85 * RmsError(small.radiance, of_255.truth));
  options.max_iterations = 300;
  EstimateScene(of_256.input, options, {}, &summary, &large);
  EXPECT_TRUE(summary.converged);
  EXPECT_LE(summary.relative_residual, options.tolerance_or_usual());
}

}  // namespace
}  // namespace thicklens::estimator
