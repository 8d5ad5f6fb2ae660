#include "model/simulate/scene/scene_texture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>

#include "model/base/random_draws.h"
#include "support/blur_oracles.h"
#include "support/error_message.h"
#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;
using thicklens::testing::ErrorOf;
using thicklens::testing::GaussianTransfer;

constexpr double kPi = 3.14159265358979323846;

TextureRequest SquareRequest(double side_px) {
  TextureRequest request;
  request.pixel_mm = 0.02;
  request.coarsest_pixel_mm = 0.02;
  request.low_mm.setConstant(-side_px * 0.01);
  request.high_mm.setConstant(side_px * 0.01);
  return request;
}

SceneTexture DrawTexture(const TextureOptions& options, const TextureRequest& request,
                         const LinearImage& image = {}) {
  RandomDraws draws(5, RandomDraws::Purpose::kTexture, 0);
  return SceneTexture(options, request, image, &draws);
}

TEST(SceneTextureTest, HoldsNothingThatThePixelsCannotShow) {
  for (const TextureKind kind : {TextureKind::kCheckerboard, TextureKind::kSiemensStar,
                                 TextureKind::kDeadLeaves, TextureKind::kNoise}) {
    TextureOptions options;
    options.kind = kind;
    const SceneTexture texture = DrawTexture(options, SquareRequest(160));
    // Rows of 128 px, 16 samples to the px, under a window whose own spectrum falls fast.
    const auto power = [&](double from, double to) {
      double sum = 0;
      for (double y_px = -60; y_px < 60; y_px += 23.3) {
        for (double f = from; f < to; f += 0.053) {
          std::complex<double> at_f = 0;
          for (int i = 0; i < 2048; ++i) {
            const double x_px = (i - 1024) / 16.0;
            const double t = (i + 0.5) / 2048;
            const double window = 0.35875 - 0.48829 * std::cos(2 * kPi * t) +
                                  0.14128 * std::cos(4 * kPi * t) - 0.01168 * std::cos(6 * kPi * t);
            const double light = static_cast<double>(texture.At(x_px * 0.02, y_px * 0.02)(1)) - 0.5;
            at_f += window * light * std::polar(1.0, -2 * kPi * f * x_px);
          }
          sum += std::norm(at_f);
        }
      }
      return sum / (to - from);
    };
    EXPECT_GT(power(0.03, 0.45), 1) << TextureKindName(kind);
    // Between the samples it is linear, which leaves a little around multiples of 4.
    EXPECT_LT(power(0.55, 2.5) / power(0.03, 0.45), 1e-5) << TextureKindName(kind);
    EXPECT_LT(power(3.5, 4.5) / power(0.03, 0.45), 1e-3) << TextureKindName(kind);
  }
}

TEST(SceneTextureTest, HasItsColourForItsMeanAndRepeats) {
  for (const TextureKind kind : {TextureKind::kCheckerboard, TextureKind::kSiemensStar,
                                 TextureKind::kDeadLeaves, TextureKind::kNoise}) {
    TextureOptions options;
    options.kind = kind;
    options.colour = {0.6, 0.3, 0.1};
    options.saturation = 0;
    const SceneTexture texture = DrawTexture(options, SquareRequest(120));
    Eigen::Array3d mean(0, 0, 0);
    double least = 1, most = 0;
    for (int i = 0; i < 120 * 120; ++i) {
      const Eigen::Array4f light = texture.At((i % 120 - 59.5) * 0.02, (i / 120 - 59.5) * 0.02);
      mean += light.head<3>().cast<double>() / (120 * 120);
      least = std::min(least, static_cast<double>(light(0)));
      most = std::max(most, static_cast<double>(light(0)));
      // Without saturation the channels differ by their colour only.
      EXPECT_NEAR(light(0) / 0.6f, light(1) / 0.3f, 2e-3f);
      EXPECT_NEAR(light(0) / 0.6f, light(2) / 0.1f, 2e-3f);
      EXPECT_TRUE(texture.At(1e9 + i, -1e9).isFinite().all());
    }
    EXPECT_LT((mean - options.colour.array()).abs().maxCoeff(), 0.02) << TextureKindName(kind);
    EXPECT_LT(least, 0.6 * 0.7) << TextureKindName(kind);
    EXPECT_GT(most, 0.6 * 1.3) << TextureKindName(kind);
  }
}

TEST(SceneTextureTest, SaturationGivesEveryChannelItsOwnDetail) {
  for (const TextureKind kind : {TextureKind::kDeadLeaves, TextureKind::kNoise}) {
    TextureOptions options;
    options.kind = kind;
    options.saturation = 1;
    const SceneTexture texture = DrawTexture(options, SquareRequest(120));
    double both = 0, red = 0, blue = 0;
    for (int i = 0; i < 120 * 120; ++i) {
      const Eigen::Array4d light =
          texture.At((i % 120 - 59.5) * 0.02, (i / 120 - 59.5) * 0.02).cast<double>() - 0.5;
      both += light(0) * light(2);
      red += light(0) * light(0);
      blue += light(2) * light(2);
    }
    EXPECT_LT(std::abs(both) / std::sqrt(red * blue), 0.35) << TextureKindName(kind);
  }
}

TEST(SceneTextureTest, CheckerboardHasItsSquaresAroundTheAxis) {
  TextureOptions options;
  options.kind = TextureKind::kCheckerboard;
  options.contrast = 0.5;
  options.feature_size_px = 10;
  const SceneTexture texture = DrawTexture(options, SquareRequest(100));
  for (int row = -4; row < 4; ++row) {
    for (int column = -4; column < 4; ++column) {
      const double expected = (row + column) % 2 == 0 ? 0.75 : 0.25;
      EXPECT_NEAR(texture.At((column + 0.5) * 0.2, (row + 0.5) * 0.2)(0), expected, 0.01)
          << row << " " << column;
      EXPECT_NEAR(texture.At((column + 0.5) * 0.2, row * 0.2)(0), 0.5, 0.01);
    }
  }
}

TEST(SceneTextureTest, ImageStandsUprightAndIsMirroredBeyondItsSides) {
  // Red, green; blue, white.
  LinearImage image{16, 16, 3, {}};
  for (int i = 0; i < 256; ++i) {
    const bool right = i % 16 >= 8;
    const bool below = i / 16 >= 8;
    for (const bool light : {right == below, right, below}) image.values.push_back(light);
  }
  TextureOptions options;
  options.kind = TextureKind::kImage;
  options.image_path = "quarters.png";
  options.feature_size_px = 80;
  TextureRequest request = SquareRequest(60);
  request.centre_mm = {0.3, -0.1};
  const SceneTexture texture = DrawTexture(options, request, image);
  const auto at = [&](double x_px, double y_px) {
    return Eigen::Array3f(texture.At(0.3 + 0.02 * x_px, -0.1 + 0.02 * y_px).head<3>());
  };
  const Eigen::Array3f red(1, 0, 0), green(0, 1, 0), blue(0, 0, 1), white(1, 1, 1);
  EXPECT_LT((at(-36, -36) - red).abs().maxCoeff(), 0.05);
  EXPECT_LT((at(36, -36) - green).abs().maxCoeff(), 0.05);
  EXPECT_LT((at(-36, 36) - blue).abs().maxCoeff(), 0.05);
  EXPECT_LT((at(36, 36) - white).abs().maxCoeff(), 0.05);
  EXPECT_LT((at(44, -36) - green).abs().maxCoeff(), 0.05);
  EXPECT_LT((at(80 + 36, -36) - red).abs().maxCoeff(), 0.05);
  EXPECT_LT((at(36, 80 + 36) - green).abs().maxCoeff(), 0.05);
  // Halfway between two of its pixels.
  EXPECT_LT((at(0, -36) - Eigen::Array3f(0.5f, 0.5f, 0)).abs().maxCoeff(), 0.05);

  EXPECT_THAT(ErrorOf([&] { DrawTexture(options, request); }),
              HasSubstr("texture.image 'quarters.png' is empty"));
}

// An image of waves, four of its pixels to one px, so that nothing is resampled: they pass the
// limit of the band with the fading alone, whatever the lines between the samples take.
TEST(SceneTextureTest, DetailBelowTheLimitKeepsItsAmplitude) {
  for (const int period : {10, 20}) {  // of its pixels
    LinearImage image{320, 320, 1, {}};
    for (int i = 0; i < 320 * 320; ++i) {
      image.values.push_back(
          static_cast<float>(0.5 + 0.4 * std::cos(2 * kPi * (i % 320 + 0.5) / period)));
    }
    TextureOptions options;
    options.kind = TextureKind::kImage;
    options.feature_size_px = 80;
    const SceneTexture texture = DrawTexture(options, SquareRequest(60), image);
    double amplitude = 0;
    for (int i = 0; i < 4000; ++i) {  // 40 px from the left side, whole periods
      const double x_px = (i + 0.5) / 100;
      amplitude += static_cast<double>(texture.At((x_px - 40) * 0.02, 0.003)(2)) *
                   std::cos(2 * kPi * 4 * x_px / period) / 2000;
    }
    EXPECT_NEAR(amplitude, 0.4 * GaussianTransfer(0.5, 4.0 / period), 5e-4) << period;
  }
}

TEST(SceneTextureTest, RefusesFeaturesThatCannotBeShown) {
  const auto message = [](TextureKind kind, double size_px) {
    TextureOptions options;
    options.kind = kind;
    options.feature_size_px = size_px;
    TextureRequest request = SquareRequest(60);
    request.coarsest_pixel_mm = 0.025;
    return ErrorOf([&] { DrawTexture(options, request); });
  };
  EXPECT_THAT(message(TextureKind::kSine, 2.4), HasSubstr("must be at least 2.5 in this layer"));
  EXPECT_EQ(message(TextureKind::kSine, 2.51), "(no error)");
  EXPECT_THAT(message(TextureKind::kNoise, 1.9), HasSubstr("for noise it must be from 2 to 1000"));
  EXPECT_THAT(message(TextureKind::kDeadLeaves, 0.4), HasSubstr("must be from 0.5 to"));
  EXPECT_THAT(message(TextureKind::kCheckerboard, 0.9), HasSubstr("must be from 1 to"));
  EXPECT_THAT(message(TextureKind::kCheckerboard, 2000), HasSubstr("must be from 1 to"));
}

}  // namespace
}  // namespace thicklens::model
