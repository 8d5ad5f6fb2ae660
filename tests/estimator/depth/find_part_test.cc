// The part of a photograph that a depth map of another aspect ratio shows.
#include "thicklens/estimator/find_part.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

namespace thicklens::estimator {
namespace {

constexpr int kWidth = 192, kHeight = 144;

struct Discs {
  std::vector<Eigen::Vector3d> discs;  // centre and radius, px
  explicit Discs(unsigned seed) {
    std::mt19937 engine(seed);
    std::uniform_real_distribution<double> even(0, 1);
    for (int n = 0; n < 14; ++n)
      discs.emplace_back(kWidth * even(engine), kHeight * even(engine), 8 + 14 * even(engine));
  }
  int At(double x, double y) const {
    int top = -1;
    for (std::size_t n = 0; n < discs.size(); ++n) {
      if (std::hypot(x - discs[n].x(), y - discs[n].y()) < discs[n].z()) top = static_cast<int>(n);
    }
    return top;
  }
};

model::LinearImage PhotoOf(const Discs& scene) {
  model::LinearImage photo{kWidth, kHeight, 1, {}};
  std::mt19937 engine(3);
  std::normal_distribution<double> noise(0, 0.01);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const int disc = scene.At(x, y);
      photo.values.push_back(
          static_cast<float>(0.3 + (disc < 0 ? 0 : 0.2 + 0.03 * (disc * 5 % 14)) + noise(engine)));
    }
  }
  return photo;
}
// 64 x 36 samples of the rectangle.
DepthSampling MapOf(const Discs& scene, double left, double top, double step) {
  DepthSampling map{64, 36, {}, {}};
  for (int j = 0; j < 36; ++j) {
    for (int i = 0; i < 64; ++i) {
      const int disc = scene.At(left + (i + 0.5) * step - 0.5, top + (j + 0.5) * step - 0.5);
      map.values.push_back(static_cast<float>(disc < 0 ? 0 : 2 + disc * 3 % 14));
    }
  }
  return map;
}

TEST(FindPart, FindsTheRectangleOfAnotherAspect) {
  const Discs scene(5);
  const model::LinearImage photo = PhotoOf(scene);
  struct Rectangle {
    double left, top, step;
  };
  for (const Rectangle& truth : {Rectangle{0, 18, 3}, Rectangle{21, 30, 2.25}}) {
    const FoundPart found = FindPart(MapOf(scene, truth.left, truth.top, truth.step), photo);
    EXPECT_GT(found.sigma, 4);
    EXPECT_NEAR(found.corner_px.x(), truth.left, truth.step) << truth.step;
    EXPECT_NEAR(found.corner_px.y(), truth.top, truth.step) << truth.step;
    EXPECT_NEAR(found.size_px.x(), 64 * truth.step, 2 * truth.step) << truth.step;
  }
}

TEST(FindPart, DecidesNothingForTheMapOfAnotherScene) {
  for (unsigned seed = 20; seed < 26; ++seed) {
    const FoundPart found = FindPart(MapOf(Discs(seed), 0, 18, 3), PhotoOf(Discs(5)));
    EXPECT_LT(found.sigma, 4) << seed;
  }
}

TEST(FindPart, DecidesNothingWithoutEdges) {
  DepthSampling plane{64, 36, {}, {}};
  for (int i = 0; i < 64 * 36; ++i) plane.values.push_back(static_cast<float>(i % 64));
  EXPECT_EQ(FindPart(plane, PhotoOf(Discs(5))).sigma, 0);
}

}  // namespace
}  // namespace thicklens::estimator
