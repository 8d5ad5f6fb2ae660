#include "model/simulate/sweep/sweep_target.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <vector>

#include "model/base/random_draws.h"
#include "model/simulate/sweep/periodic_image.h"
#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

constexpr double kPi = 3.14159265358979323846;

LinearImage UniformImage() { return {4, 3, 1, std::vector<float>(12, 0.37f)}; }

TargetTile Tile(TargetKind kind, double contrast, double feature_size_mm) {
  TargetOptions options;
  options.kind = kind;
  options.contrast = contrast;
  options.feature_size_mm = feature_size_mm;
  TileRequest request;
  request.width_mm = 12;
  request.height_mm = 9;
  request.spacing_mm = 0.02;
  request.pixel_mm = 0.04;
  request.field_mm = 8;
  RandomDraws draws(3, RandomDraws::Purpose::kTexture, 0);
  return DrawTargetTile(options, request, UniformImage(), &draws);
}

TEST(SweepTargetTest, EveryTextureHasTheMeanOneAndNoNegativeLight) {
  for (const TargetKind kind :
       {TargetKind::kDeadLeaves, TargetKind::kPinkNoise, TargetKind::kWhiteNoise,
        TargetKind::kCheckerboard, TargetKind::kSiemensStar, TargetKind::kImage}) {
    const TargetTile tile = Tile(kind, 0.6, 0);
    EXPECT_NEAR(cv::mean(tile.samples)[0], 1, 1e-12) << TargetKindName(kind);
    double low, high;
    cv::minMaxLoc(tile.samples, &low, &high);
    EXPECT_GE(low, 0) << TargetKindName(kind);
    EXPECT_LE(high, 2.1) << TargetKindName(kind);
    EXPECT_GE(tile.width_mm, 12 - 1e-9);
    EXPECT_GE(tile.height_mm, 9 - 1e-9);
    if (kind != TargetKind::kImage) {
      EXPECT_GT(high - low, 0.5) << TargetKindName(kind);
    }
  }
}

TEST(SweepTargetTest, DeadLeavesHaveEveryGreyOfTheContrast) {
  const TargetTile tile = Tile(TargetKind::kDeadLeaves, 0.6, 0);
  // Uniform greys in [0.4, 1.6] have the standard deviation 1.2/sqrt(12). The number of leaves is
  // large, but the large ones dominate.
  cv::Scalar mean, deviation;
  cv::meanStdDev(tile.samples, mean, deviation);
  EXPECT_NEAR(deviation[0], 1.2 / std::sqrt(12.0), 0.05);
}

// Mean power of the tile's spectrum in a ring of frequencies, cycles per mm.
double RingPower(const TargetTile& tile, double from, double to) {
  const PeriodicImage image(tile.samples);
  double sum = 0;
  int count = 0;
  for (int b = 0; b <= image.max_y_frequency(); ++b) {
    for (int a = -image.max_x_frequency(); a <= image.max_x_frequency(); ++a) {
      const double f = std::hypot(a / tile.width_mm, b / tile.height_mm);
      if (f < from || f > to) continue;
      sum += std::norm(image.Coefficient(a, b));
      ++count;
    }
  }
  return sum / count;
}

TEST(SweepTargetTest, NoiseHasItsSpectrum) {
  // A small contrast, so that the soft limits do not bend the spectrum. Shortest period 0.1 mm.
  const TargetTile pink = Tile(TargetKind::kPinkNoise, 0.05, 0.1);
  const TargetTile white = Tile(TargetKind::kWhiteNoise, 0.05, 0.1);
  EXPECT_NEAR(RingPower(pink, 1.9, 2.1) / RingPower(pink, 7.9, 8.1), 16, 3);
  EXPECT_NEAR(RingPower(white, 1.9, 2.1) / RingPower(white, 7.9, 8.1), 1, 0.2);
  EXPECT_LT(RingPower(white, 11, 20), 1e-3 * RingPower(white, 5, 9));
  cv::Scalar mean, deviation;
  cv::meanStdDev(white.samples, mean, deviation);
  EXPECT_NEAR(deviation[0], 0.025, 0.0002);
}

TEST(SweepTargetTest, SiemensStarTurnsIntoItself) {
  // 36 cycles: half a turn changes nothing, a quarter neither.
  const TargetTile tile = Tile(TargetKind::kSiemensStar, 0.8, 0);
  const PeriodicImage image(tile.samples);
  const auto at = [&](double x_mm, double y_mm) {
    return image
        .Evaluate({x_mm / tile.width_mm + 0.5, 1e-3, 1}, {y_mm / tile.height_mm + 0.5, 1e-3, 1},
                  {3, Psf::kGaussian, 0})
        .at<double>(0, 0);
  };
  for (const double angle : {0.02, 0.3, 1.1}) {
    const double x = 2.5 * std::cos(angle), y = 2.5 * std::sin(angle);
    EXPECT_NEAR(at(x, y), at(-x, -y), 0.01);
    const double turned = angle + 2 * kPi / 36;
    EXPECT_NEAR(at(x, y), at(2.5 * std::cos(turned), 2.5 * std::sin(turned)), 0.02);
    const double opposite = angle + kPi / 36;
    EXPECT_NEAR(at(x, y) + at(2.5 * std::cos(opposite), 2.5 * std::sin(opposite)), 2, 0.05);
  }
}

TEST(SweepTargetTest, RefusesFeaturesThatTheTileCannotShow) {
  for (const TargetKind kind : {TargetKind::kDeadLeaves, TargetKind::kWhiteNoise,
                                TargetKind::kCheckerboard, TargetKind::kSiemensStar}) {
    EXPECT_THROW(Tile(kind, 0.6, 0.001), Error) << TargetKindName(kind);
    EXPECT_THROW(Tile(kind, 0.6, 1000), Error) << TargetKindName(kind);
  }
}

TEST(SweepTargetTest, LargeFieldsAreDrawnCoarser) {
  TargetOptions options;
  TileRequest request;
  request.width_mm = 100;  // 100000 samples wanted
  request.height_mm = 2;
  request.spacing_mm = 0.001;
  request.pixel_mm = 0.002;
  request.field_mm = 2;
  RandomDraws draws(3, RandomDraws::Purpose::kTexture, 0);
  const TargetTile tile = DrawTargetTile(options, request, {}, &draws);
  EXPECT_EQ(tile.samples.cols, 4096);
  EXPECT_NEAR(tile.width_mm, 100, 1e-9);
  EXPECT_GE(tile.height_mm, 2);
  EXPECT_NEAR(tile.height_mm / tile.samples.rows, tile.width_mm / tile.samples.cols, 1e-12);
}

}  // namespace
}  // namespace thicklens::model
