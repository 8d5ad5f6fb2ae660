// Scale and offset with which the blur of a photograph agrees. The photographs are means of painted
// views, not made by the estimator.
#include "thicklens/estimator/depth_values.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "support/error_message.h"
#include "support/stepped_scene.h"
#include "thicklens/base/error.h"

namespace thicklens::estimator {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using thicklens::testing::ErrorOf;
using thicklens::testing::SteppedScene;

constexpr int kSizePx = 320;

SteppedScene SceneOf(unsigned seed, double noise_levels = 1,
                     const Eigen::ArrayXXd& weights = SteppedScene::UniformViews()) {
  return SteppedScene(seed, kSizePx, {-2, 1, 2, -1, 0}, noise_levels, weights);
}

// The map that needs `scale` and `offset_px` to be the true one.
EstimateInput InNeedOf(const SteppedScene& scene, double scale, double offset_px) {
  EstimateInput input = scene.input();
  for (float& value : input.disparity.disparity)
    value = static_cast<float>((static_cast<double>(value) - offset_px) / scale);
  return input;
}

DepthValuesFit Find(const EstimateInput& input,
                    DepthValuesSearch search = DepthValuesSearch::kNear) {
  DepthValuesOptions options;
  options.search = search;
  options.threads = 1;
  return FitDepthValues(input, options);
}

std::string TextOf(const DepthValuesFit& fit) {
  std::string text = fit.message + "\n  " + std::to_string(fit.tiles) + " tiles, best " +
                     std::to_string(fit.best.scale) + " +- " + std::to_string(fit.scale_sigma) +
                     ", " + std::to_string(fit.best.offset_px) + " +- " +
                     std::to_string(fit.offset_sigma_px) + ", evidence " +
                     std::to_string(fit.best.evidence) + ", gain " + std::to_string(fit.gain) +
                     " +- " + std::to_string(fit.gain_sigma);
  for (const DepthValuesTrial& other : fit.others) {
    text += "\n  or " + std::to_string(other.scale) + ", " + std::to_string(other.offset_px) +
            ", evidence " + std::to_string(other.evidence);
  }
  return text;
}

// Whether the values are those, within three of the stated standard deviations.
void ExpectValues(const DepthValuesFit& fit, double scale, double offset_px) {
  EXPECT_TRUE(fit.is_found) << TextOf(fit);
  EXPECT_NEAR(fit.best.scale, scale, 3 * fit.scale_sigma) << TextOf(fit);
  EXPECT_NEAR(fit.best.offset_px, offset_px, 3 * fit.offset_sigma_px) << TextOf(fit);
  EXPECT_LT(fit.scale_sigma, 0.06 * scale) << TextOf(fit);
}

TEST(DepthValues, OfAnExactMapAreItsOwn) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE(seed);
    const SteppedScene scene = SceneOf(seed, seed == 4 ? 3 : 1);
    const DepthValuesFit fit = Find(scene.input());
    ExpectValues(fit, 1, 0);
    EXPECT_LT(fit.gain, 10) << TextOf(fit);
  }
}

TEST(DepthValues, OfAWrongScaleOrOffsetAreFound) {
  const SteppedScene scene = SceneOf(1), noisy = SceneOf(2, 3);
  for (const auto& [scale, offset_px] :
       {std::pair{1 / 1.1, 0.0}, {1 / 0.9, 0.0}, {1.0, -0.2}, {1.1, 0.15}}) {
    for (const SteppedScene* from : {&scene, &noisy}) {
      const DepthValuesFit fit = Find(InNeedOf(*from, scale, offset_px));
      SCOPED_TRACE(std::to_string(scale) + " " + std::to_string(offset_px));
      ExpectValues(fit, scale, offset_px);
      EXPECT_GT(fit.gain, 2 * fit.gain_sigma) << TextOf(fit);
    }
  }
}

TEST(DepthValues, OfARelativeMapAreFoundWithoutAnyStart) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    SCOPED_TRACE(seed);
    // Grey levels of a network: near is bright.
    const SteppedScene scene = SceneOf(seed);
    EstimateInput input = InNeedOf(scene, 1 / 60.0, -1.9);
    for (float& value : input.disparity.disparity) value = std::round(value);
    const DepthValuesFit fit = Find(input, DepthValuesSearch::kAll);
    ExpectValues(fit, 1 / 60.0, -1.9);
    EXPECT_THAT(fit.others, IsEmpty()) << TextOf(fit);
  }
}

// Blur shows only how far two depths are from the plane of focus, and not on which side.
TEST(DepthValues, OfTwoDepthsAreTwo) {
  const SteppedScene scene(5, kSizePx, {-2, 1}, 1);
  const DepthValuesFit fit = Find(scene.input(), DepthValuesSearch::kAll);
  EXPECT_FALSE(fit.is_found) << TextOf(fit);
  ASSERT_THAT(fit.others, Not(IsEmpty())) << TextOf(fit);
  EXPECT_THAT(fit.message, HasSubstr("both sides of the plane of focus"));
}

TEST(DepthValues, AreNotFoundInASharpPhotograph) {
  const SteppedScene sharp = SceneOf(1, 1, SteppedScene::Pinhole());
  for (const auto search : {DepthValuesSearch::kNear, DepthValuesSearch::kAll}) {
    const DepthValuesFit fit = Find(sharp.input(), search);
    EXPECT_FALSE(fit.is_found) << TextOf(fit);
    EXPECT_THAT(fit.message, HasSubstr("does not show the blur of its aperture"));
  }
}

TEST(DepthValues, AreNotFoundThroughAnotherAperture) {
  constexpr int kViews = SteppedScene::kViews;
  // Its edge, where a Gaussian is cut off, lets so little through that it has no ripples.
  Eigen::ArrayXXd gaussian(kViews, kViews);
  for (int l = 0; l < kViews; ++l) {
    for (int k = 0; k < kViews; ++k)
      gaussian(l, k) = std::exp(-2 * (std::pow(l - 2, 2) + std::pow(k - 2, 2)));
  }
  gaussian /= gaussian.sum();
  const SteppedScene scene = SceneOf(1, 1, gaussian);
  EXPECT_FALSE(Find(scene.input()).is_found);
  EXPECT_FALSE(Find(scene.input(), DepthValuesSearch::kAll).is_found);
}

TEST(DepthValues, DoNotDependOnTheNumberOfThreads) {
  const EstimateInput input = InNeedOf(SteppedScene(3, 192, {-2, 1, 2}, 1), 1.1, 0);
  DepthValuesOptions options;
  options.threads = 1;
  const DepthValuesFit one = FitDepthValues(input, options);
  options.threads = 3;
  const DepthValuesFit three = FitDepthValues(input, options);
  EXPECT_EQ(one.best.scale, three.best.scale);
  EXPECT_EQ(one.best.offset_px, three.best.offset_px);
  EXPECT_EQ(one.best.evidence, three.best.evidence);
  EXPECT_EQ(one.message, three.message);
}

TEST(DepthValues, RefuseWhatDoesNotFit) {
  DepthValuesOptions options;
  options.threads = -1;
  const SteppedScene scene(1, 64, {1}, 1);
  EXPECT_THAT(ErrorOf([&] { FitDepthValues(scene.input(), options); }), HasSubstr("threads"));
  EXPECT_THAT(Find(scene.input()).message, HasSubstr("are needed"));
}

}  // namespace
}  // namespace thicklens::estimator
