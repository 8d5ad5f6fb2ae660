// The search for depth maps whose rows or columns are stored the other way.
#include "thicklens/estimator/depth_flips.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

#include "thicklens/base/error.h"

namespace thicklens::estimator {
namespace {

constexpr int kSizePx = 128;
constexpr int kViews = 5;
constexpr double kNoise = 1.0 / 255;

// A near square in the upper left quarter of a scene in focus. The photograph is made without the
// estimator: views in which the square is shifted before its background are averaged.
struct SquareScene {
  EstimateInput input;
  explicit SquareScene(double near_px = 1.5, unsigned seed = 1) {
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0, kNoise);
    input.weights = Eigen::ArrayXXd::Constant(kViews, kViews, 1.0 / (kViews * kViews));
    input.transfer = model::TransferCurve::Linear();
    input.image = {kSizePx, kSizePx, 1, {}};
    input.disparity.width_px = input.disparity.height_px = kSizePx;
    for (int y = 0; y < kSizePx; ++y) {
      for (int x = 0; x < kSizePx; ++x) {
        double sum = 0;
        for (int view = 0; view < kViews * kViews; ++view) {
          const int column = view % kViews - kViews / 2, row = view / kViews - kViews / 2;
          const double near_x = x + near_px * column;
          const double near_y = y + near_px * row;
          sum += IsNear(near_x, near_y) ? Texture(near_x, near_y) : Texture(x + 512, y);
        }
        input.image.values.push_back(static_cast<float>(sum / (kViews * kViews) + noise(random)));
        input.disparity.disparity.push_back(IsNear(x, y) ? static_cast<float>(near_px) : 0.0F);
      }
    }
  }
  static bool IsNear(double x, double y) { return x >= 16 && x < 64 && y >= 8 && y < 56; }
  // Fine details in every other square of 32 px; the others show the noise.
  static double Texture(double x, double y) {
    const auto square = static_cast<int>(std::floor(x / 32) + std::floor(y / 32));
    const double fine = square % 2 == 0 ? 0.15 * std::sin(1.9 * x) * std::cos(1.3 * y) : 0;
    return 0.5 + fine + 0.05 * std::sin(0.1 * x + 0.15 * y);
  }
  void Flip(model::DepthFlip flip) { model::FlipDepth(flip, kSizePx, &input.disparity.disparity); }
};

TEST(DepthFlips, TheReversedOrderIsFoundAndNoOther) {
  for (const model::DepthFlip flip :
       {model::DepthFlip::kRows, model::DepthFlip::kColumns, model::DepthFlip::kBoth}) {
    SquareScene scene;
    scene.Flip(flip);
    const DepthFlipCheck check = CheckDepthFlips(scene.input, {});
    ASSERT_EQ(check.trials.size(), 4U);
    ASSERT_TRUE(check.better) << model::DepthFlipName(flip) << ", noise " << check.noise_sigma
                              << ", residuals " << check.trials[0].residual_rms << " "
                              << check.trials[1].residual_rms << " " << check.trials[2].residual_rms
                              << " " << check.trials[3].residual_rms;
    EXPECT_EQ(check.better->flip, flip) << model::DepthFlipName(flip);
    EXPECT_EQ(check.trials.front().flip, model::DepthFlip::kNone);
    EXPECT_GT(check.trials.front().residual_rms, 1.5 * check.better->residual_rms);
  }
}

TEST(DepthFlips, NoiseDecidesNothing) {
  using model::DepthFlip;
  const auto better = [](double given, double rows, double columns, double both) {
    const auto found = BetterFlip({{DepthFlip::kNone, given},
                                   {DepthFlip::kRows, rows},
                                   {DepthFlip::kColumns, columns},
                                   {DepthFlip::kBoth, both}},
                                  1);
    return found ? model::DepthFlipName(found->flip) : "";
  };
  EXPECT_EQ(better(0.95, 0.97, 0.97, 0.97), "");
  EXPECT_EQ(better(0.8, 0.97, 0.97, 0.97), "");
  EXPECT_EQ(better(1.2, 1.15, 1.16, 1.15), "");
  EXPECT_EQ(better(5, 4, 4, 4), "");
  EXPECT_EQ(better(5, 2.5, 4, 4), "");  // far above the noise
  EXPECT_EQ(better(3, 2.9, 1.2, 2.9), "columns");
  EXPECT_EQ(better(3, 1.2, 2.9, 1.15), "rows");  // the first that does about as well
  EXPECT_EQ(better(3, 1.6, 2.9, 1.2), "both");
  EXPECT_FALSE(BetterFlip({}, 1));
}

TEST(DepthFlips, TheRightOrderStays) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    EXPECT_FALSE(CheckDepthFlips(SquareScene(1.5, seed).input, {}).better) << seed;
  }
}

// Other causes of an unexplained photograph are no reversed map.
TEST(DepthFlips, AWrongScaleOrPlaceIsNoReversedMap) {
  SquareScene doubled;
  for (float& value : doubled.input.disparity.disparity) value = value * 2 + 1;
  EXPECT_FALSE(CheckDepthFlips(doubled.input, {}).better);
  SquareScene elsewhere;  // the map of another scene
  for (std::size_t i = 0; i < elsewhere.input.disparity.disparity.size(); ++i) {
    elsewhere.input.disparity.disparity[i] = (i / 16) % 3 == 0 ? 1.5F : 0.0F;
  }
  EXPECT_FALSE(CheckDepthFlips(elsewhere.input, {}).better);
}

TEST(DepthFlips, ASharpPhotographIsNoReversedMap) {
  SquareScene sharp(0);
  std::vector<float>& disparity = sharp.input.disparity.disparity;
  for (std::size_t i = 0; i < disparity.size(); ++i)
    disparity[i] = 2 * i < disparity.size() ? 1.5F : 0.5F;
  EXPECT_FALSE(CheckDepthFlips(sharp.input, {}).better);
}

}  // namespace
}  // namespace thicklens::estimator
