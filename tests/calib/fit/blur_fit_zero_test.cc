// The error of the bench offset in the results of a sweep that is short compared with it.
#include <gtest/gtest.h>

#include <cmath>

#include "calib/fit/blur_fit.h"
#include "tests/calib/focus_case.h"

namespace thicklens::calib {
namespace {

using thicklens::testing::BlurBench;
using thicklens::testing::ExactBench;
using thicklens::testing::FocusCase;

// A sweep of 20 mm and a zero with an error of 30 mm: at each end of the interval, the whole sweep
// is beside the former focus. The oracles are fits at these ends that start from their own data.
TEST(FitBlur, CarriesOnTheZerosErrorOfAShortSweep) {
  constexpr double kZeroSigmaMm = 30;
  BlurBench bench = ExactBench();
  bench.first_mm = 390;
  bench.last_mm = 410;
  bench.reference = 15;
  BlurFitSetup setup = FocusCase(bench).WithTexture(1e-4).WithTrueFloor().evidence.setup;
  setup.floor_variance_px2 = model::Estimate{bench.floor_px2, 0};
  const double zero_mm = setup.offset_mm.value;
  const auto fitted = [&](double zero, double sigma) {
    setup.offset_mm = {zero, sigma};
    return FitBlur(setup);
  };
  const BlurFitResult result = fitted(zero_mm, kZeroSigmaMm);
  const BlurFitResult above = fitted(zero_mm + kZeroSigmaMm, 0);
  const BlurFitResult below = fitted(zero_mm - kZeroSigmaMm, 0);
  ASSERT_TRUE(result.done && above.done && below.done) << result.message;
  for (const int parameter : {kFocusDepth, kBlurRatio}) {
    const double expected = 0.5 * std::abs(above.values[parameter] - below.values[parameter]);
    EXPECT_NEAR(std::sqrt(result.covariance(parameter, parameter)), expected, 0.05 * expected)
        << parameter;
  }
  EXPECT_NEAR(std::sqrt(result.covariance(kFocusDepth, kFocusDepth)), kZeroSigmaMm, 1);
}

}  // namespace
}  // namespace thicklens::calib
