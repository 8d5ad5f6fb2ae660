#include "estimator/projection/separable_mask.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <random>
#include <utility>
#include <vector>

#include "estimator/projection/angular_bundle.h"
#include "estimator/projection/visible_fraction.h"

namespace thicklens::estimator {
namespace {

constexpr int kWidth = 90, kHeight = 70;
constexpr double kTolerancePx = 0.2;

DisparityMap MapOf(const Eigen::Vector2d& step, const std::function<double(int x, int y)>& shape) {
  DisparityMap map{kWidth, kHeight, {}, step};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) map.disparity.push_back(static_cast<float>(shape(x, y)));
  }
  return map;
}

double Share(const std::vector<unsigned char>& flags) {
  return static_cast<double>(std::count(flags.begin(), flags.end(), 1)) /
         static_cast<double>(flags.size());
}

// Compares the result, which uses bounds, with every ray.
SeparableMask Checked(const DisparityMap& map, int u_count, int v_count) {
  const SeparableMask plain = FindSeparablePixels(map, u_count, v_count, kTolerancePx);
  const Eigen::ArrayXXd weights =
      Eigen::ArrayXXd::Constant(v_count, u_count, 1.0 / (u_count * v_count));
  const std::vector<unsigned char> nothing(map.disparity.size(), 0);
  const AngularBundle bundle = RenderBundle(map, weights, 1, nullptr);
  const BundleAxes axes = AxesOf(bundle, map, u_count, v_count, 1);
  const auto is_product = IsProduct(bundle, axes, map, kTolerancePx, nothing, 1);
  const std::vector<float> seen = VisibleFraction(bundle, map, nothing, 1);
  EXPECT_EQ(plain.is_product.size(), map.disparity.size());
  EXPECT_EQ(plain.is_visible.size(), map.disparity.size());
  for (std::size_t i = 0; i < nothing.size(); ++i) {
    EXPECT_LE(plain.is_product[i], is_product[i]) << i % kWidth << ", " << i / kWidth;
    if (plain.is_visible[i] == 0) continue;
    EXPECT_NEAR(seen[i], 1, 1e-5) << i % kWidth << ", " << i / kWidth;
  }
  return plain;
}

TEST(SeparableMask, IsAllOfAFlatSurfaceButItsBorder) {
  const SeparableMask plain =
      Checked(MapOf({1, 1}, [](int, int) { return 1.3; }), 5, 5);  // up to 2.6 px
  EXPECT_NEAR(Share(plain.is_product), (kWidth - 10.0) * (kHeight - 10.0) / kWidth / kHeight, 1e-9);
  EXPECT_GT(Share(plain.is_visible), 0.5);
}

TEST(SeparableMask, AreRightOnSlopesWavesStepsAndSpikes) {
  std::mt19937 engine(4);
  std::uniform_real_distribution<double> uniform(-1, 1);
  int some = 0;
  for (int run = 0; run < 60; ++run) {
    const double mean = 1.5 * uniform(engine), high = uniform(engine);
    const double slope_x = 0.03 * uniform(engine), slope_y = 0.03 * uniform(engine);
    const double wave = 4 + 20 * std::abs(uniform(engine));
    const bool has_step = run % 2 == 1, has_spike = run % 4 == 0;
    const Eigen::Vector2d step(run % 5 == 0 ? -2.0 : 1.0, run % 7 == 0 ? 0.5 : 1.0);
    const DisparityMap map = MapOf(step, [&](int x, int y) {
      double disparity = mean + slope_x * (x - 45) + slope_y * (y - 35) +
                         0.1 * high * std::sin(x / wave) * std::cos(y / wave);
      if (has_step && x > 60) disparity += high;
      if (has_spike && x == 20 && y == 40) disparity -= high;
      return disparity;
    });
    SCOPED_TRACE(::testing::Message() << "run " << run);
    const SeparableMask plain = Checked(map, run % 4 < 2 ? 5 : 4, 2 + run % 5);
    some += Share(plain.is_product) > 0.1 ? 1 : 0;
    if (has_step && std::abs(high) > 0.3) {
      EXPECT_EQ(plain.is_product[30 * kWidth + 60], 0);
    }
  }
  EXPECT_GT(some, 20);  // bounds that never hold would be right as well
}

// The axes of even counts are means of two views, which read rows above and below.
TEST(SeparableMask, AreRightForEvenCountsOfStronglyBlurredViews) {
  for (const int views : {2, 4, 5}) {
    SCOPED_TRACE(::testing::Message() << views << " views");
    Checked(MapOf({1, 1}, [](int, int y) { return y < 40 ? 6.0 : 0.0; }), 3, views);
    Checked(MapOf({1, 1}, [](int, int y) { return 8 - 0.05 * std::abs(y - 35); }), 3, views);
    Checked(MapOf({1, 1}, [](int x, int) { return x < 45 ? 6.0 : 0.0; }), views, 3);
    Checked(MapOf({1, 1}, [](int x, int) { return 8 - 0.05 * std::abs(x - 45); }), views, 3);
  }
}

// The image is smaller than the way of a ray, or a line.
TEST(SeparableMask, SaysNothingOfWhatIsTooSmall) {
  const DisparityMap map = MapOf({30, 30}, [](int, int) { return 1; });
  EXPECT_EQ(Share(FindSeparablePixels(map, 5, 5, kTolerancePx).is_product), 0);
  for (const auto& [width, height] : {std::pair{1, 50}, {50, 1}, {1, 1}}) {
    const DisparityMap line{
        width, height, std::vector<float>(static_cast<std::size_t>(width * height), 0), {1, 1}};
    EXPECT_EQ(Share(FindSeparablePixels(line, 3, 3, kTolerancePx).is_product), 0);
  }
}

}  // namespace
}  // namespace thicklens::estimator
