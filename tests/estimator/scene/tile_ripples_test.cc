// The blur of tiles by the frequencies that their aperture does not let through.
#include "estimator/scene/tile_ripples.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace thicklens::estimator {
namespace {

constexpr int kSizePx = 160, kViews = 5;

// White noise, seen through views that move by a whole number of px: the photograph in closed form.
RipplePhoto PhotoOfOneDepth(int disparity_px) {
  std::mt19937 random(3);
  std::normal_distribution<double> value(0.5, 0.15), noise(0, 0.5 / 255);
  constexpr int kMargin = 16, kWide = kSizePx + 2 * kMargin;
  std::vector<double> scene(kWide * kWide);
  for (double& at : scene) at = value(random);
  RipplePhoto photo;
  photo.image = {kSizePx, kSizePx, 1, {}};
  photo.disparity = {kSizePx,
                     kSizePx,
                     std::vector<float>(kSizePx * kSizePx, static_cast<float>(disparity_px)),
                     {1, 1}};
  for (int y = 0; y < kSizePx; ++y) {
    for (int x = 0; x < kSizePx; ++x) {
      double sum = 0;
      for (int b = -2; b <= 2; ++b) {
        for (int a = -2; a <= 2; ++a) {
          sum += scene[static_cast<std::size_t>(kMargin + y + b * disparity_px) * kWide +
                       static_cast<std::size_t>(kMargin + x + a * disparity_px)];
        }
      }
      photo.image.values.push_back(static_cast<float>(sum / (kViews * kViews) + noise(random)));
    }
  }
  return photo;
}

// The disparity for which the tiles have most evidence.
double BestOf(const TileRipples& ripples) {
  double best = 0, most = -1e300;
  for (double disparity = 0; disparity < 3; disparity += 0.02) {
    double sum = 0;
    for (std::size_t i = 0; i < ripples.tiles().size(); ++i) sum += ripples.Of(i, disparity);
    if (sum > most) {
      most = sum;
      best = disparity;
    }
  }
  return best;
}

TEST(TileRipples, ShowTheBlurOfATile) {
  const Eigen::ArrayXXd weights =
      Eigen::ArrayXXd::Constant(kViews, kViews, 1.0 / (kViews * kViews));
  for (const int disparity : {1, 2}) {
    TileRipples ripples(PhotoOfOneDepth(disparity), model::TransferCurve::Linear(), weights, {},
                        0.5 / 255, 1);
    ASSERT_GT(ripples.tiles().size(), 8U);
    // A square of the same standard deviation: sqrt(12 * 2).
    EXPECT_NEAR(ripples.width_px(), std::sqrt(24.0), 1e-9);
    ripples.Look(RippleAperture::kSampled);
    EXPECT_NEAR(BestOf(ripples), disparity, 0.04 * disparity);
    // Every tile prefers its blur to none, and its sign does not matter.
    double sum = 0;
    for (std::size_t i = 0; i < ripples.tiles().size(); ++i) {
      sum += ripples.Of(i, disparity);
      EXPECT_GT(ripples.Of(i, disparity), 0) << i;
      EXPECT_EQ(ripples.Of(i, disparity), ripples.Of(i, -disparity));
    }
    EXPECT_GT(sum, 4.0 * static_cast<double>(ripples.tiles().size()));
  }
}

TEST(TileRipples, AreNotThoseOfAnotherAperture) {
  const Eigen::ArrayXXd weights =
      Eigen::ArrayXXd::Constant(kViews, kViews, 1.0 / (kViews * kViews));
  TileRipples ripples(PhotoOfOneDepth(2), model::TransferCurve::Linear(), weights, {}, 0.5 / 255,
                      1);
  const auto evidence = [&](RippleAperture aperture) {
    ripples.Look(aperture);
    double sum = 0;
    for (std::size_t i = 0; i < ripples.tiles().size(); ++i) sum += ripples.Of(i, 2);
    return sum;
  };
  const double sampled = evidence(RippleAperture::kSampled);
  EXPECT_GT(evidence(RippleAperture::kSquare), 0.5 * sampled);
  EXPECT_LT(evidence(RippleAperture::kDisc), 0.5 * sampled);
}

}  // namespace
}  // namespace thicklens::estimator
