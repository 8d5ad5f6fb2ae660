#include "model/simulate/scene/height_field.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "model/base/random_draws.h"

namespace thicklens::model {
namespace {

constexpr int kWidth = 33, kHeight = 26;
constexpr double kScalePx = 12000, kFocusMm = 400;

double DepthOfShift(double shift) { return 1 / (1 / kFocusMm + shift / kScalePx); }

// Depths with shifts from -1 to 1 px per mm: waves, steps and noise in proportion to `roughness`.
std::vector<float> RandomDepths(unsigned seed, double roughness) {
  RandomDraws draws(seed, RandomDraws::Purpose::kTexture, 0);
  const double x_wave = draws.Uniform() - 0.5, y_wave = draws.Uniform() - 0.5;
  const double step_at = kWidth * draws.Uniform(), step = draws.Uniform() - 0.5;
  std::vector<float> depths;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double shift = 0.4 * std::sin(x_wave * x + y_wave * y) +
                           (x + y / 3 < step_at ? 0 : step) + roughness * (draws.Uniform() - 0.5);
      depths.push_back(static_cast<float>(DepthOfShift(shift)));
    }
  }
  return depths;
}

double ShiftOf(const std::vector<float>& depths, int x, int y) {
  const auto z = static_cast<double>(depths[static_cast<std::size_t>(y * kWidth + x)]);
  return kScalePx * (1 / z - 1 / kFocusMm);
}

double BilinearShift(const std::vector<float>& depths, double x, double y) {
  x = std::clamp(x, 0.0, kWidth - 1.0);
  y = std::clamp(y, 0.0, kHeight - 1.0);
  const int i = std::min(static_cast<int>(x), kWidth - 2),
            j = std::min(static_cast<int>(y), kHeight - 2);
  const double fx = x - i, fy = y - j;
  return (1 - fy) * ((1 - fx) * ShiftOf(depths, i, j) + fx * ShiftOf(depths, i + 1, j)) +
         fy * ((1 - fx) * ShiftOf(depths, i, j + 1) + fx * ShiftOf(depths, i + 1, j + 1));
}

struct RandomRay {
  explicit RandomRay(RandomDraws* draws)
      : position_px(44 * draws->Uniform() - 6, 36 * draws->Uniform() - 5),
        aperture_mm(20 * draws->Uniform() - 10, 20 * draws->Uniform() - 10) {
    // Along the rows and the columns, too.
    if (draws->Uniform() < 0.1) aperture_mm.x() = 0;
    if (draws->Uniform() < 0.1) aperture_mm.y() = 0;
  }
  Eigen::Vector2d position_px, aperture_mm;
};

TEST(HeightFieldTest, HoldsTheShiftsOfItsDepths) {
  const std::vector<float> depths = RandomDepths(1, 1);
  const HeightField field(kWidth, kHeight, depths, kScalePx, kFocusMm);
  RandomDraws draws(1, RandomDraws::Purpose::kTexture, 1);
  for (int i = 0; i < 300; ++i) {
    const RandomRay ray(&draws);
    EXPECT_NEAR(field.ShiftAt(ray.position_px),
                BilinearShift(depths, ray.position_px.x(), ray.position_px.y()), 1e-12);
  }
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      EXPECT_EQ(static_cast<float>(field.DepthMm(field.ShiftAt(Eigen::Vector2d(x, y)))),
                depths[static_cast<std::size_t>(y * kWidth + x)]);
    }
  }
}

// The result is compared with a march along the ray in steps of a thousandth of a px, in both
// directions.
TEST(HeightFieldTest, RaysMeetWhatAMarchMeets) {
  int rays = 0, missed_by_march = 0, several = 0;
  for (unsigned seed = 1; seed <= 12; ++seed) {
    const std::vector<float> depths = RandomDepths(seed, seed % 3 * 0.5);
    const HeightField field(kWidth, kHeight, depths, kScalePx, kFocusMm);
    RandomDraws draws(seed, RandomDraws::Purpose::kTexture, 1);
    for (int i = 0; i < 40; ++i) {
      const RandomRay ray(&draws);
      const ValueRange met = field.IntersectionShiftBounds({ray.position_px, ray.position_px},
                                                           {ray.aperture_mm, ray.aperture_mm});
      const auto beyond = [&](double shift) {
        const Eigen::Vector2d at = ray.position_px + shift * ray.aperture_mm;
        return BilinearShift(depths, at.x(), at.y()) - shift;
      };
      const double step = 1e-3 / std::max(ray.aperture_mm.norm(), 1e-3);
      // Every root is within the bounds.
      int roots = 0;
      double first = -2, last = 2;
      for (double shift = 2; shift > -2; shift -= step) {
        if ((beyond(shift) < 0) == (beyond(shift - step) < 0)) continue;
        if (roots++ == 0) first = shift;
        last = shift - step;
      }
      ASSERT_GE(roots, 1);
      several += roots > 1;
      EXPECT_LE(first - step, met.high);
      EXPECT_GE(last + step, met.low);
      const double nearest =
          field.FirstIntersection(ray.position_px, ray.aperture_mm, met.high, met.low);
      const double farthest =
          field.FirstIntersection(ray.position_px, ray.aperture_mm, met.low, met.high);
      ++rays;
      for (const double found : {nearest, farthest}) EXPECT_NEAR(beyond(found), 0, 1e-10);
      // Two roots within a step are missed by the march.
      EXPECT_GE(nearest, first - step - 1e-9);
      EXPECT_LE(farthest, last + step + 1e-9);
      if (nearest > first + 1e-9 || farthest < last - 1e-9) ++missed_by_march;
      // A search that starts at a shift between two roots finds the next root in the direction of
      // the crossing.
      const double middle = field.ShiftAt(ray.position_px);
      const ValueRange wide = {-2, 2};
      const double near_middle =
          field.IntersectionNearShift(ray.position_px, ray.aperture_mm, middle, wide);
      EXPECT_NEAR(beyond(near_middle), 0, 1e-10);
      const double toward = beyond(middle) < 0 ? -step : step;
      double marched = middle;
      while ((beyond(marched + toward) < 0) == (beyond(middle) < 0)) marched += toward;
      EXPECT_LE(std::abs(near_middle - middle), std::abs(marched + toward - middle) + 1e-9);
      missed_by_march += std::abs(near_middle - middle) < std::abs(marched - middle) - 1e-9;
    }
  }
  EXPECT_LE(missed_by_march, rays / 100);
  EXPECT_GT(several, rays / 10);
}

TEST(HeightFieldTest, SlopesAndBendsAreBounded) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const std::vector<float> depths = RandomDepths(seed, seed % 2 * 0.2);
    const HeightField field(kWidth, kHeight, depths, kScalePx, kFocusMm);
    RandomDraws draws(seed, RandomDraws::Purpose::kTexture, 1);
    double steepest = 0, sharpest = 0;
    const Eigen::Vector2d low(4 + 10 * draws.Uniform(), 4 + 10 * draws.Uniform());
    const ImageRegion region = {low, low + Eigen::Vector2d(9, 7)};
    constexpr double kStep = 1e-4;
    for (int i = 0; i < 3000; ++i) {
      const Eigen::Vector2d at = low + Eigen::Vector2d(kStep + (9 - 2 * kStep) * draws.Uniform(),
                                                       kStep + (7 - 2 * kStep) * draws.Uniform());
      const auto slope = [&](const Eigen::Vector2d& place) {
        return Eigen::Vector2d(
            (field.ShiftAt(place + Eigen::Vector2d(kStep, 0)) - field.ShiftAt(place)) / kStep,
            (field.ShiftAt(place + Eigen::Vector2d(0, kStep)) - field.ShiftAt(place)) / kStep);
      };
      steepest = std::max(steepest, slope(at).norm());
      // Across the next border between cells.
      Eigen::Vector2d left = at, right = at;
      left.x() = std::floor(at.x()) - 2 * kStep;
      right.x() = std::floor(at.x()) + kStep;
      if (left.x() > low.x()) {
        sharpest = std::max(sharpest, std::abs(slope(right).x() - slope(left).x()));
      }
    }
    EXPECT_LE(steepest, field.SteepestOver(region) + 1e-9);
    EXPECT_LE(sharpest, field.SharpestOver(region) + 1e-3);
    EXPECT_GT(steepest, field.SteepestOver(region) / 6);
  }
}

// The surface beyond the last pixels continues with their depth, as far as a ray may go.
TEST(HeightFieldTest, BeyondTheMapItIsAsAtItsEnd) {
  std::vector<float> depths(kWidth * kHeight, static_cast<float>(DepthOfShift(0.5)));
  for (int y = 0; y < kHeight; ++y) {
    depths[static_cast<std::size_t>(y * kWidth)] = static_cast<float>(DepthOfShift(-0.25));
  }
  const HeightField field(kWidth, kHeight, depths, kScalePx, kFocusMm);
  const Eigen::Vector2d aperture_mm(3, 40);
  const ValueRange met =
      field.IntersectionShiftBounds({{-50, 400}, {-50, 400}}, {{-3, -3}, aperture_mm});
  EXPECT_NEAR(field.FirstIntersection({-50, 400}, aperture_mm, met.high, met.low), -0.25, 1e-5);
  EXPECT_NEAR(field.FirstIntersection({90, -300}, aperture_mm, 1, -1), 0.5, 1e-5);
  EXPECT_NEAR(field.FirstIntersection({5, 5}, {0, 0}, 1, -1), 0.5, 1e-5);
}

}  // namespace
}  // namespace thicklens::model
