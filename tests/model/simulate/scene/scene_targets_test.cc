// The targets among a scene's textures: edge and star.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "model/base/random_draws.h"
#include "model/simulate/scene/scene_texture.h"
#include "support/error_message.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;
using thicklens::testing::ErrorOf;

constexpr double kPi = 3.14159265358979323846;
constexpr double kPixelMm = 0.02;

// The visible region is a square whose middle is off the axis.
TextureRequest SquareRequest(double side_px, double largest_px_of_layer = 1) {
  TextureRequest request;
  request.pixel_mm = kPixelMm;
  request.coarsest_pixel_mm = largest_px_of_layer * kPixelMm;
  request.centre_mm = {0.31, -0.13};
  request.low_mm = request.centre_mm.array() - side_px / 2 * kPixelMm;
  request.high_mm = request.centre_mm.array() + side_px / 2 * kPixelMm;
  return request;
}

SceneTexture DrawTexture(const TextureOptions& options, const TextureRequest& request) {
  RandomDraws draws(5, RandomDraws::Purpose::kTexture, 0);
  return SceneTexture(options, request, {}, &draws);
}

// Polar, px from the middle; degrees from the right, positive downward.
Eigen::Array3d LightAt(const SceneTexture& texture, double radius_px, double angle_deg) {
  const double angle_rad = angle_deg * kPi / 180;
  return texture
      .At(0.31 + kPixelMm * radius_px * std::cos(angle_rad),
          -0.13 + kPixelMm * radius_px * std::sin(angle_rad))
      .head<3>()
      .cast<double>();
}

TEST(SceneTargetsTest, EdgeIsTheSumOfAGaussianAcrossALineThroughTheMiddle) {
  TextureOptions options;
  options.kind = TextureKind::kEdge;
  options.colour = {0.5, 0.4, 0.2};
  options.contrast = 0.8;
  options.feature_size_px = 1.7;
  options.angle_deg = 95;  // downward, a little to the left
  const SceneTexture texture = DrawTexture(options, SquareRequest(60));
  for (const double across_px : {-9.0, -1.7, -0.4, 0.0, 0.4, 1.7, 3.4, 9.0}) {
    for (const double along_px : {-20.0, 0.0, 7.0}) {
      const Eigen::Array3d light = LightAt(texture, std::hypot(across_px, along_px),
                                           95 + std::atan2(along_px, across_px) * 180 / kPi);
      // The cumulative normal distribution, from dark to bright.
      const double below = std::erfc(-across_px / (1.7 * std::sqrt(2.0))) / 2;
      const Eigen::Array3d expected = options.colour.array() * (0.2 + 1.6 * below);
      EXPECT_LT((light - expected).abs().maxCoeff(), 1e-6) << across_px << " " << along_px;
    }
  }
  EXPECT_NEAR(texture.Darkest()(0), 0.1, 1e-6);
  EXPECT_NEAR(texture.Brightest()(0), 0.9, 1e-6);
}

TEST(SceneTargetsTest, EdgeIsAsSharpAsTheLargestPixelAllows) {
  TextureOptions options;
  options.kind = TextureKind::kEdge;
  const SceneTexture chosen = DrawTexture(options, SquareRequest(60, 1.25));
  options.feature_size_px = 1.25;
  const SceneTexture sharpest = DrawTexture(options, SquareRequest(60, 1.25));
  EXPECT_EQ(LightAt(chosen, 0.8, 0)(0), LightAt(sharpest, 0.8, 0)(0));
  options.feature_size_px = 1.2;
  EXPECT_THAT(ErrorOf([&] { DrawTexture(options, SquareRequest(60, 1.25)); }),
              HasSubstr("texture.feature_size_px is 1.2: the sigma of an edge must be at least "
                        "1.25 in this layer, one of its largest px"));
}

TEST(SceneTargetsTest, StarHasItsSectorsAroundTheMiddleAndIsGreyWhereTheyAreTooFine) {
  constexpr double kCycles = 12, kSidePx = 200, kContrast = 0.6;
  TextureOptions options;
  options.kind = TextureKind::kSiemensStar;
  options.contrast = kContrast;
  options.feature_size_px = kPi * (kSidePx / 2) / kCycles;
  const SceneTexture texture = DrawTexture(options, SquareRequest(kSidePx));
  for (int sector = 0; sector < 24; ++sector) {
    const double middle_deg = (sector + 0.5) * 15;
    const double expected = sector % 2 == 0 ? 0.5 * (1 + kContrast) : 0.5 * (1 - kContrast);
    for (const double radius_px : {45.0, 70.0, 98.0}) {
      EXPECT_NEAR(LightAt(texture, radius_px, middle_deg)(1), expected, 0.01)
          << sector << " " << radius_px;
      EXPECT_NEAR(LightAt(texture, radius_px, sector * 15)(1), 0.5, 0.01) << sector;
    }
    // The frequency is half a cycle per px where 24 sectors cover a circle of 24 px.
    EXPECT_NEAR(LightAt(texture, 2.5, middle_deg)(1), 0.5, 0.01);
  }
  // Twelve times round at a quarter of a cycle per px much is left; within the limit, 3.8 px,
  // little.
  const auto swing = [&](double radius_px) {
    double least = 1, most = 0;
    for (int i = 0; i < 24; ++i) {
      const double light = LightAt(texture, radius_px, (i + 0.5) * 15)(1);
      least = std::min(least, light);
      most = std::max(most, light);
    }
    return most - least;
  };
  EXPECT_GT(swing(7.6), 0.3);
  EXPECT_LT(swing(3), 0.03);

  options.feature_size_px = 0;
  const SceneTexture chosen = DrawTexture(options, SquareRequest(400));
  EXPECT_GT(LightAt(chosen, 190, 2.5)(0), 0.75);  // 36 pairs: 5 degrees each
  EXPECT_LT(LightAt(chosen, 190, -2.5)(0), 0.25);
  EXPECT_GT(LightAt(chosen, 190, 12.5)(0), 0.75);
}

}  // namespace
}  // namespace thicklens::model
