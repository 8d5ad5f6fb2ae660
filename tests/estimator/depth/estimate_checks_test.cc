#include "thicklens/estimator/estimate_checks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <random>
#include <vector>

#include "support/error_message.h"

namespace thicklens::estimator {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using thicklens::testing::ErrorOf;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

DisparityMap MapOf(int width_px, int height_px, const std::function<double(int x, int y)>& value) {
  DisparityMap map{width_px, height_px, {}, {1, 1}};
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) map.disparity.push_back(static_cast<float>(value(x, y)));
  }
  return map;
}

double Slant(int x, int y) { return 0.013 * x - 0.007 * y - 0.4; }
// Four steps of a stair, each a slant.
double WithEdges(int x, int y) { return Slant(x, y) + (x / 25) * 0.9 - (y / 30) * 0.5; }

DisparityMap WithNoise(DisparityMap map, double sigma_px, unsigned seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<float> noise(0, 1);
  for (float& disparity : map.disparity) disparity += static_cast<float>(sigma_px) * noise(engine);
  return map;
}

DisparityMap Quantised(DisparityMap map, int levels) {
  float lo = map.disparity.front(), hi = lo;
  for (float disparity : map.disparity) {
    lo = std::min(lo, disparity);
    hi = std::max(hi, disparity);
  }
  const float step = (hi - lo) / static_cast<float>(levels - 1);
  for (float& disparity : map.disparity) {
    disparity = lo + std::round((disparity - lo) / step) * step;
  }
  return map;
}

TEST(CheckSteps, CountsWhatMovesTooFar) {
  // Columns 0 .. 9 with disparities -4.5 .. 4.5 px, two of them beyond 3 px on either side.
  DisparityMap map = MapOf(10, 4, [](int x, int) { return x - 4.5; });
  StepCheck check = CheckSteps(map, {0, 0});
  EXPECT_DOUBLE_EQ(check.largest_px, 4.5);
  EXPECT_DOUBLE_EQ(check.share, 0.4);
  // With ST off the plane of focus, rays of the next view land 1 px to the right of their sample:
  // -4.5 .. 4.5 px remain along x, and -3.5 .. 5.5 px along y.
  map = MapOf(10, 4, [](int x, int) { return x - 3.5; });
  check = CheckSteps(map, {1, 0});
  EXPECT_DOUBLE_EQ(check.largest_px, 5.5);
  EXPECT_DOUBLE_EQ(check.share, 0.5);
  // A step of 3 px is none beyond 3 px.
  map = MapOf(10, 4, [](int x, int) { return x == 0 ? 3 : -3; });
  EXPECT_EQ(CheckSteps(map, {0, 0}).share, 0);
  // Steps along one axis alone, in another unit.
  map.step = {0, 2};
  EXPECT_DOUBLE_EQ(CheckSteps(map, {0, 0}).largest_px, 6);
  EXPECT_EQ(CheckSteps(map, {0, 0}).share, 1);
  // Holes do not count.
  for (std::size_t i = 0; i < 20; ++i) map.disparity[i] = i < 10 ? kNan : 0;
  EXPECT_DOUBLE_EQ(CheckSteps(map, {0, 0}).share, 2.0 / 3);
  map.disparity.assign(map.disparity.size(), kNan);
  EXPECT_EQ(CheckSteps(map, {0, 0}).share, 0);
  EXPECT_EQ(CheckSteps(map, {0, 0}).largest_px, 0);
}

TEST(DepthNoise, IsThatOfTheMap) {
  for (const double sigma_px : {0.02, 0.05, 0.2}) {
    for (unsigned seed = 1; seed <= 3; ++seed) {
      SCOPED_TRACE(sigma_px);
      EXPECT_NEAR(*DepthNoisePx(WithNoise(MapOf(100, 90, Slant), sigma_px, seed)), sigma_px,
                  0.04 * sigma_px);
      EXPECT_NEAR(*DepthNoisePx(WithNoise(MapOf(100, 90, WithEdges), sigma_px, seed)), sigma_px,
                  0.15 * sigma_px);
    }
  }
}

TEST(DepthNoise, IsInPixelsOfAViewStep) {
  DisparityMap map = WithNoise(MapOf(100, 90, Slant), 0.1, 4);
  map.step = {0.5, -2};
  EXPECT_NEAR(*DepthNoisePx(map), 0.2, 0.01);
}

TEST(DepthNoise, IsNoneOnSurfacesAndAtEdges) {
  EXPECT_LT(*DepthNoisePx(MapOf(100, 90, Slant)), 1e-5);
  EXPECT_LT(*DepthNoisePx(MapOf(100, 90, WithEdges)), 1e-5);
  // Every sixth column has an edge of 5 px.
  EXPECT_LT(*DepthNoisePx(MapOf(100, 90, [](int x, int) { return x / 6 % 2 == 0 ? 5 : 0; })), 1e-5);
  // A ball of 40 px radius, 2 px of disparity high.
  const auto ball = [](int x, int y) {
    const double r2 = (x - 50) * (x - 50) + (y - 45) * (y - 45);
    return r2 < 1600 ? 2 * std::sqrt(1 - r2 / 1600) : 0;
  };
  EXPECT_LT(*DepthNoisePx(MapOf(100, 90, ball)), 0.01);
}

TEST(DepthNoise, OfQuantisationStaysBelowTheWarning) {
  for (const double slope : {0.001, 0.01, 0.013, 0.05, 0.1}) {
    for (const double offset : {0.0, 0.3}) {
      SCOPED_TRACE(slope);
      const auto slant = [&](int x, int y) { return slope * (x + offset * y); };
      EXPECT_LT(*DepthNoisePx(Quantised(MapOf(150, 90, slant), 256)), kLargestDepthNoisePx);
      EXPECT_LT(*DepthNoisePx(Quantised(MapOf(150, 90, slant), 65536)), kLargestDepthNoisePx);
    }
    EXPECT_LT(*DepthNoisePx(Quantised(MapOf(150, 90, WithEdges), 256)), kLargestDepthNoisePx);
  }
  // Few levels make wide steps: these are edges.
  EXPECT_EQ(*DepthNoisePx(Quantised(MapOf(150, 90, Slant), 8)), 0);
  // Noise is found in a quantised map, too.
  const DisparityMap noisy = WithNoise(MapOf(150, 90, Slant), 0.1, 5);
  EXPECT_NEAR(*DepthNoisePx(Quantised(noisy, 256)), 0.1, 0.02);
}

TEST(DepthNoise, OfSmallAndLargeMaps) {
  EXPECT_FALSE(DepthNoisePx(MapOf(2, 2, Slant)).has_value());
  EXPECT_FALSE(DepthNoisePx({}).has_value());
  EXPECT_TRUE(DepthNoisePx(MapOf(3, 1, Slant)).has_value());
  EXPECT_TRUE(DepthNoisePx(MapOf(1, 3, Slant)).has_value());
  EXPECT_FALSE(DepthNoisePx(MapOf(9, 2, [](int x, int) { return x % 3 == 0 ? kNan : 1; })));
  EXPECT_FALSE(DepthNoisePx(MapOf(9, 9, [](int, int) { return kNan; })).has_value());
  EXPECT_NEAR(*DepthNoisePx(WithNoise(MapOf(2400, 1800, Slant), 0.1, 6)), 0.1, 0.002);
}

class ResidualPatchesTest : public ::testing::Test {
 protected:
  ResidualPatchesTest() : occluded_fraction_(kPixels, 0.0F) {
    std::mt19937 engine(3);
    std::normal_distribution<float> noise(0, static_cast<float>(kNoise));
    for (std::size_t i = 0; i < kPixels; ++i) residual_.push_back(noise(engine));
  }
  void Fill(std::vector<float>* map, int x0, int y0, int width_px, int height_px, float value) {
    for (int y = y0; y < y0 + height_px; ++y) {
      for (int x = x0; x < x0 + width_px; ++x) (*map)[static_cast<std::size_t>(y * kW + x)] = value;
    }
  }
  std::vector<ResidualPatch> Patches(double noise_sigma = kNoise) const {
    return ResidualPatches(residual_, occluded_fraction_, kW, kH, noise_sigma);
  }

  static constexpr int kW = 200, kH = 100;
  static constexpr std::size_t kPixels = 20000;
  static constexpr double kNoise = 0.004;
  std::vector<float> residual_, occluded_fraction_;
};

TEST_F(ResidualPatchesTest, NoiseIsNone) {
  EXPECT_THAT(Patches(), IsEmpty());
  EXPECT_THAT(Patches(0), IsEmpty());  // the median block bounds it as well
}

TEST_F(ResidualPatchesTest, ArePlacedAndOrdered) {
  Fill(&residual_, 64, 32, 32, 32, 0.05F);
  Fill(&residual_, 192, 96, 8, 4, -0.1F);  // the small block in the corner
  const std::vector<ResidualPatch> patches = Patches();
  ASSERT_THAT(patches, SizeIs(2));
  EXPECT_EQ(patches[0].x, 192);
  EXPECT_EQ(patches[0].y, 96);
  EXPECT_EQ(patches[0].width_px, 8);
  EXPECT_EQ(patches[0].height_px, 4);
  EXPECT_NEAR(patches[0].rms, 0.1, 1e-6);
  EXPECT_EQ(patches[1].x, 64);
  EXPECT_EQ(patches[1].y, 32);
  EXPECT_EQ(patches[1].width_px, 32);
  EXPECT_EQ(patches[1].height_px, 32);
  EXPECT_NEAR(patches[1].rms, 0.05, 1e-6);
}

TEST_F(ResidualPatchesTest, MustBeFarAboveTheNoiseAndTheMedianBlock) {
  Fill(&residual_, 64, 32, 32, 32, 0.017F);
  EXPECT_THAT(Patches(), SizeIs(1));        // 4.25 times the noise
  EXPECT_THAT(Patches(0.0044), IsEmpty());  // 3.9 times
  Fill(&residual_, 64, 32, 32, 32, 0.0155F);
  EXPECT_THAT(Patches(0), IsEmpty());  // 3.9 times the median block
}

TEST_F(ResidualPatchesTest, DoNotCountWhatIsOccluded) {
  Fill(&residual_, 64, 32, 32, 32, 0.05F);
  Fill(&occluded_fraction_, 64, 32, 32, 16, 0.5F);
  EXPECT_THAT(Patches(), SizeIs(1));
  Fill(&occluded_fraction_, 64, 32, 32, 26, 0.5F);  // less than a quarter is left
  EXPECT_THAT(Patches(), IsEmpty());
  // Large along an edge, and usual beside it.
  Fill(&residual_, 128, 0, 4, 32, 0.3F);
  Fill(&occluded_fraction_, 128, 0, 4, 32, 0.02F);
  EXPECT_THAT(Patches(), IsEmpty());
  occluded_fraction_.assign(kPixels, 1.0F);
  EXPECT_THAT(Patches(), IsEmpty());
}

TEST_F(ResidualPatchesTest, UnexplainedShareCountsBlocksAboveTheNoise) {
  // 7 x 4 blocks, one of them at the right border and four at the lower one.
  EXPECT_EQ(UnexplainedShare(residual_, occluded_fraction_, kW, kH, kNoise), 0);
  // If every block has the residual, it is not a patch, but it is unexplained.
  for (float& value : residual_) value *= 2.5F;
  EXPECT_EQ(UnexplainedShare(residual_, occluded_fraction_, kW, kH, kNoise), 1);
  EXPECT_THAT(Patches(), IsEmpty());
  for (float& value : residual_) value /= 2.5F;
  Fill(&residual_, 32, 0, 64, 96, 0.0061F);  // 6 blocks of 28
  EXPECT_DOUBLE_EQ(*UnexplainedShare(residual_, occluded_fraction_, kW, kH, kNoise), 6.0 / 28);
  EXPECT_EQ(UnexplainedShare(residual_, occluded_fraction_, kW, kH, 1.1 * kNoise), 0);
}

TEST_F(ResidualPatchesTest, UnexplainedShareLeavesOutWhatIsOccluded) {
  Fill(&residual_, 32, 0, 64, 96, 0.0061F);
  Fill(&occluded_fraction_, 32, 0, 32, 96, 0.5F);  // 3 of the 6
  EXPECT_DOUBLE_EQ(*UnexplainedShare(residual_, occluded_fraction_, kW, kH, kNoise), 3.0 / 25);
  occluded_fraction_.assign(kPixels, 1.0F);
  EXPECT_FALSE(UnexplainedShare(residual_, occluded_fraction_, kW, kH, kNoise).has_value());
  // A tenth of the 28 pixels would be three, so two say nothing about the whole.
  Fill(&occluded_fraction_, 0, 0, 64, 32, 0);
  EXPECT_FALSE(UnexplainedShare(residual_, occluded_fraction_, kW, kH, kNoise).has_value());
  Fill(&occluded_fraction_, 64, 0, 32, 32, 0);
  EXPECT_TRUE(UnexplainedShare(residual_, occluded_fraction_, kW, kH, kNoise).has_value());
}

TEST_F(ResidualPatchesTest, SizesThatDoNotFitAreNamed) {
  EXPECT_THAT(ErrorOf([&] { ResidualPatches(residual_, occluded_fraction_, kW, kH + 1, kNoise); }),
              AllOf(HasSubstr("20000"), HasSubstr("20200")));
  occluded_fraction_.pop_back();
  EXPECT_THAT(ErrorOf([&] { Patches(); }), HasSubstr("19999"));
  EXPECT_THAT(ErrorOf([&] { UnexplainedShare(residual_, occluded_fraction_, kW, kH, kNoise); }),
              HasSubstr("19999"));
}

}  // namespace
}  // namespace thicklens::estimator
