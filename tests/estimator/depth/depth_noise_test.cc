// The noise of a depth taken out along surfaces.
#include "thicklens/estimator/depth_noise.h"

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
#include "thicklens/estimator/estimate_checks.h"

namespace thicklens::estimator {
namespace {

using testing::ErrorOf;
using ::testing::HasSubstr;

constexpr int kW = 90, kH = 70;
using Surface = std::function<double(int x, int y)>;

double Slant(int x, int y) { return 0.3 + 0.02 * x - 0.013 * y; }
double Card(int x, int y) { return x > 30 && x < 60 && y > 20 && y < 50 ? 1.5 : Slant(x, y) - 1; }

DisparityMap MapOf(const Surface& surface, double noise_px = 0) {
  DisparityMap map{kW, kH, {}, {1, 1}};
  std::mt19937 engine(3);
  std::normal_distribution<double> normal(0, 1);
  for (int y = 0; y < kH; ++y) {
    for (int x = 0; x < kW; ++x) {
      map.disparity.push_back(static_cast<float>(surface(x, y) + noise_px * normal(engine)));
    }
  }
  return map;
}

// Over the pixels for which `counts`.
double RmsError(const DisparityMap& map, const Surface& surface,
                const std::function<bool(int x, int y)>& counts) {
  double sum = 0;
  int count = 0;
  for (int y = 0; y < kH; ++y) {
    for (int x = 0; x < kW; ++x) {
      if (!counts(x, y)) continue;
      const auto i = static_cast<std::size_t>(y * kW + x);
      sum += std::pow(static_cast<double>(map.disparity[i]) - surface(x, y), 2);
      ++count;
    }
  }
  return std::sqrt(sum / count);
}
bool Everywhere(int, int) { return true; }

TEST(SmoothDepth, LeavesPlanesAsTheyAre) {
  const DisparityMap map = MapOf(Slant);
  const SmoothedDepth smoothed = SmoothDepth(map, 0.05, 2);
  for (std::size_t i = 0; i < map.disparity.size(); ++i) {
    ASSERT_NEAR(smoothed.map.disparity[i], map.disparity[i], 1e-5) << i;
  }
}

TEST(SmoothDepth, LeavesAsMuchNoiseAsItSays) {
  for (const double noise_px : {0.03, 0.2}) {
    const SmoothedDepth smoothed = SmoothDepth(MapOf(Slant, noise_px), noise_px, 1);
    const double left_px = RmsError(smoothed.map, Slant, Everywhere);
    EXPECT_LT(left_px, 0.25 * noise_px);
    EXPECT_NEAR(left_px, smoothed.noise_left_px, 0.1 * smoothed.noise_left_px) << noise_px;
  }
}

TEST(SmoothDepth, KeepsEdges) {
  constexpr double kNoisePx = 0.05;
  const SmoothedDepth smoothed = SmoothDepth(MapOf(Card, kNoisePx), kNoisePx, 1);
  const auto at_edge = [](int x, int y) {
    return std::min({std::abs(x - 30), std::abs(x - 60), std::abs(y - 20), std::abs(y - 50)}) <= 2;
  };
  EXPECT_LT(RmsError(smoothed.map, Card, at_edge), 0.5 * kNoisePx);
  EXPECT_LT(RmsError(smoothed.map, Card, Everywhere), 0.25 * kNoisePx);
}

TEST(SmoothDepth, CountsInPixelsOfAViewStep) {
  DisparityMap map = MapOf(Card, 0.05);
  const SmoothedDepth smoothed = SmoothDepth(map, 0.05, 1);
  for (float& disparity : map.disparity) disparity *= 4;
  map.step = {0.125, -0.25};
  const SmoothedDepth in_other_unit = SmoothDepth(map, 0.05, 1);
  EXPECT_NEAR(in_other_unit.noise_left_px, smoothed.noise_left_px, 1e-6);
  for (std::size_t i = 0; i < map.disparity.size(); ++i) {
    ASSERT_NEAR(in_other_unit.map.disparity[i], 4 * smoothed.map.disparity[i], 1e-4) << i;
  }
}

TEST(SmoothDepth, GivesTheSameBitsOnAnyNumberOfThreads) {
  const DisparityMap map = MapOf(Card, 0.1);
  const SmoothedDepth one = SmoothDepth(map, 0.1, 1), three = SmoothDepth(map, 0.1, 3);
  EXPECT_EQ(one.map.disparity, three.map.disparity);
  EXPECT_EQ(one.noise_left_px, three.noise_left_px);
}

// Too few neighbours for a plane, or all of them in a line.
TEST(SmoothDepth, KeepsWhatHasNoSurface) {
  DisparityMap map = MapOf(Slant);
  map.disparity[35 * kW + 40] = 9;
  EXPECT_EQ(SmoothDepth(map, 0.05, 1).map.disparity[35 * kW + 40], 9);
  const DisparityMap line{12, 1, std::vector<float>(12, 0.5F), {1, 1}};
  const SmoothedDepth smoothed = SmoothDepth(line, 0.05, 1);
  EXPECT_EQ(smoothed.map.disparity, line.disparity);
  EXPECT_NEAR(smoothed.noise_left_px, 0.05, 1e-12);
}

TEST(SmoothDepth, DoubtfulPixelsYieldToTheOthers) {
  // Every second column has four times the noise, and a confidence that says so.
  DisparityMap map = MapOf(Slant, 0.02);
  const DisparityMap noisier = MapOf(Slant, 0.08);
  std::vector<float> confidence(map.disparity.size(), 1.0F);
  for (std::size_t i = 0; i < map.disparity.size(); i += 2) {
    map.disparity[i] = noisier.disparity[i];
    confidence[i] = 1 / 16.0F;
  }
  const double even = RmsError(SmoothDepth(map, 0.08, 1).map, Slant, Everywhere);
  const double weighted = RmsError(SmoothDepth(map, 0.08, 1, confidence).map, Slant, Everywhere);
  EXPECT_LT(weighted, 0.6 * even);
  confidence.pop_back();
  EXPECT_THAT(ErrorOf([&] { SmoothDepth(map, 0.08, 1, confidence); }),
              HasSubstr("numbers must be equal"));
}

TEST(SmoothDepth, RefusesHolesAndNoNoise) {
  DisparityMap map = MapOf(Slant);
  EXPECT_THAT(ErrorOf([&] { SmoothDepth(map, 0, 1); }), HasSubstr("must be > 0"));
  map.disparity[7] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(ErrorOf([&] { SmoothDepth(map, 0.1, 1); }), HasSubstr("holes"));
}

}  // namespace
}  // namespace thicklens::estimator
