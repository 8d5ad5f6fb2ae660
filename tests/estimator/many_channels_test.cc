// Images of other bands than one or three: every solver takes each band as it takes a grey
// image.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <vector>

#include "estimator/scene/encoding_slope.h"
#include "tests/estimator/solver_inputs.h"
#include "thicklens/estimator/block_solver.h"
#include "thicklens/estimator/functional_solver.h"
#include "thicklens/estimator/grid_solver.h"
#include "thicklens/estimator/scene_solver.h"
#include "thicklens/estimator/solve.h"
#include "thicklens/kernels/device.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::estimator {
namespace {

constexpr int kWidth = 26, kHeight = 21;

// A slant with a near patch.
EstimateInput InputOf(int channels) {
  return testing::NoiseInput(
      kWidth, kHeight, channels, testing::GaussianWeights(3, 3),
      [](int x, int y) {
        const bool patch = x > 9 && x < 17 && y > 6 && y < 15;
        return patch ? 1.4F : 0.04F * static_cast<float>(x) - 0.7F;
      },
      5);
}

model::LinearImage Band(const model::LinearImage& image, int channel) {
  model::LinearImage band{image.width_px, image.height_px, 1, {}};
  for (int y = 0; y < image.height_px; ++y) {
    for (int x = 0; x < image.width_px; ++x) band.values.push_back(image.at(x, y, channel));
  }
  return band;
}

using Estimator = std::function<model::LightField(const EstimateInput& input)>;

void ExpectBandByBand(const Estimator& estimate, double accuracy) {
  for (const int channels : {2, 4, 5}) {
    const EstimateInput input = InputOf(channels);
    const model::LightField all = estimate(input);
    ASSERT_EQ(all.channels, channels);
    for (int channel = 0; channel < channels; ++channel) {
      EstimateInput grey = input;
      grey.image = Band(input.image, channel);
      const model::LightField one = estimate(grey);
      const float* found = all.values.data() + all.ViewStart(channel, 0, 0);
      for (std::size_t i = 0; i < one.values.size(); ++i) {
        ASSERT_NEAR(found[i], one.values[i], accuracy) << channels << " channels, " << channel;
      }
    }
  }
}

TEST(ManyChannels, TheBlockSolverTakesEachBandAlone) {
  ExpectBandByBand(
      [](const EstimateInput& input) {
        BlockSummary summary;
        return EstimateByBlocks(input, {}, {}, &summary);
      },
      0);
}

TEST(ManyChannels, TheFunctionalTakesEachBandAlone) {
  for (const SolverOptions& solver :
       {SolverOptions(FunctionalOptions()), SolverOptions(GridOptions())}) {
    SCOPED_TRACE(SolverName(solver));
    ExpectBandByBand([&](const EstimateInput& input) { return Solve(input, solver, {}, nullptr); },
                     0);
  }
}

TEST(ManyChannels, WarpingTakesEachBandAlone) {
  ExpectBandByBand([](const EstimateInput& input) { return WarpedLightField(input, true, 2); }, 0);
}

// All pixels have equal weights, and the prior does not couple the bands.
TEST(ManyChannels, TheSceneSolverTakesEachBandAlone) {
  ExpectBandByBand(
      [](const EstimateInput& input) {
        SceneOptions options;
        options.prior = Prior::kRidge;
        options.strength_rule = StrengthRule::kGiven;
        options.strength = 0.05;
        options.slope_weights = false;
        options.double_precision = true;
        options.tolerance = 1e-9;
        options.max_iterations = 2000;
        SceneSummary summary;
        return EstimateScene(input, options, {}, &summary);
      },
      1e-6);
}

TEST(ManyChannels, TheSceneSolverWithItsDefaultsKeepsSixBands) {
  const EstimateInput input = InputOf(6);
  SceneSummary summary;
  SceneMaps maps;
  const model::LightField found = EstimateScene(input, {}, {}, &summary, &maps);
  std::string why;
  EXPECT_TRUE(found.IsValid(&why)) << why;
  EXPECT_EQ(found.channels, 6);
  EXPECT_EQ(maps.residual.size(), static_cast<std::size_t>(kWidth * kHeight));
  EXPECT_TRUE(std::all_of(found.values.begin(), found.values.end(),
                          [](float value) { return std::isfinite(value); }));
}

TEST(ManyChannels, TheSlopeIsTheirMeans) {
  const model::LinearImage bands = InputOf(4).image;
  model::LinearImage mean{kWidth, kHeight, 1, {}};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      mean.values.push_back(
          (bands.at(x, y, 0) + bands.at(x, y, 1) + bands.at(x, y, 2) + bands.at(x, y, 3)) / 4);
    }
  }
  const model::TransferCurve srgb = model::TransferCurve::Srgb();
  const std::vector<double> found = EncodingSlopes(bands, srgb, 1);
  const std::vector<double> expected = EncodingSlopes(mean, srgb, 1);
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) ASSERT_NEAR(found[i], expected[i], 1e-5);
}

}  // namespace
}  // namespace thicklens::estimator
