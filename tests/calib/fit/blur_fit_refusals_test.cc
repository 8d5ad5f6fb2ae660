// Messages of FitBlur if the data do not determine the answer.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "calib/fit/blur_fit.h"
#include "tests/calib/blur_samples.h"

namespace thicklens::calib {
namespace {

using ::testing::HasSubstr;
using thicklens::testing::BlurBench;
using thicklens::testing::ExactBench;
using thicklens::testing::WithEdge;
using thicklens::testing::WithTexture;

TEST(FitBlur, TheFloorOfATextureIsNamedAsUndetermined) {
  const BlurBench bench = ExactBench();
  std::mt19937 random(1);
  BlurFitSetup setup = WithTexture(bench, 0.02, 0, &random);
  setup.floor_variance_px2.reset();
  const BlurFitResult fit = FitBlur(setup);
  EXPECT_FALSE(fit.done);
  EXPECT_THAT(fit.message, HasSubstr("the data do not distinguish"));
  EXPECT_THAT(fit.weak_direction, HasSubstr("blur_floor_px"));
}

TEST(FitBlur, TwoDepthsDoNotFixThreeParameters) {
  const BlurBench bench = ExactBench();
  std::mt19937 random(1);
  BlurFitSetup setup = WithEdge(bench, 0.02, &random);
  for (std::size_t i = 0; i < setup.frames.size(); ++i) {
    const double depth_mm = i % 2 == 0 ? 350 : 450;
    setup.frames[i].reading_mm = depth_mm - bench.offset_mm;
    setup.frames[i].scale = bench.Scale(depth_mm);
    setup.estimators[0].variances_px2[static_cast<Eigen::Index>(i)] = bench.OnTarget(depth_mm);
  }
  EXPECT_FALSE(FitBlur(setup).done);
  BlurFitResult start;
  start.done = true;
  start.values = {bench.focus_mm, bench.ratio, bench.floor_px2, bench.offset_mm};
  const BlurFitResult fit = FitBlur(setup, &start);
  EXPECT_FALSE(fit.done);
  EXPECT_THAT(fit.message, HasSubstr("do not distinguish"));
  EXPECT_NE(fit.weak_direction, "");
}

TEST(FitBlur, TheWorstKnownCombinationIsNamedWithItsCorrelation) {
  const BlurBench bench = ExactBench();
  std::mt19937 random(1);
  // If there is only a texture, zf and the floor are almost completely correlated, because a wrong
  // floor moves the focus.
  const BlurFitResult fit = FitBlur(WithTexture(bench, 1e-3, 0.5, &random));
  ASSERT_TRUE(fit.done);
  EXPECT_THAT(fit.weak_direction, HasSubstr("blur_floor_px"));
  EXPECT_THAT(fit.weak_direction, HasSubstr("(correlation "));
  EXPECT_THAT(fit.weak_direction, HasSubstr("1.00)"));
}

TEST(FitBlur, FewerThanFourFramesAreRefused) {
  BlurBench bench;
  bench.count = 3;
  bench.reference = 1;
  std::mt19937 random(1);
  const BlurFitResult fit = FitBlur(WithEdge(bench, 0.02, &random));
  EXPECT_FALSE(fit.done);
  EXPECT_THAT(fit.message, HasSubstr("3 frames, but at least 4"));
  EXPECT_FALSE(FitBlur({}).done);
}

TEST(FitBlur, BlurWithoutAMinimumIsRefused) {
  const BlurBench bench = ExactBench();
  std::mt19937 random(1);
  BlurFitSetup setup = WithTexture(bench, 0.02, 0, &random);
  setup.estimators[0].variances_px2 *= -1;
  const BlurFitResult fit = FitBlur(setup);
  EXPECT_FALSE(fit.done);
  EXPECT_THAT(fit.message, HasSubstr("no minimum in depth"));
}

}  // namespace
}  // namespace thicklens::calib
