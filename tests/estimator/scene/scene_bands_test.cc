// An image solved in bands against the same image solved as a whole; views one by one.
#include "estimator/scene/scene_bands.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <mutex>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "support/error_message.h"
#include "support/sanitizers.h"
#include "tests/estimator/solver_runs.h"
#include "thicklens/base/error.h"
#include "thicklens/estimator/scene_solver.h"
#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator {
namespace {

using testing::ErrorOf;
using ::testing::HasSubstr;

// A near card before a slanted wall, textured, seen through 3 x 3 views, with noise. The card
// crosses the borders of bands.
EstimateInput CardBeforeWall(int width, int height, int channels) {
  EstimateInput input;
  input.weights = model::ApertureWeights(model::ApertureShape::kUniform, 3, 3);
  input.disparity = {width, height, {}, {1, 1}};
  std::mt19937 engine(4);
  std::normal_distribution<float> normal(0, 1);
  model::LinearImage scene{width, height, channels, {}};
  const double row = 2 * 3.14159 / height;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const bool card = std::abs(x - width / 2) < width / 5 && y > height / 3 && y < 0.7 * height;
      input.disparity.disparity.push_back(
          card ? 1.2F : static_cast<float>(-0.9 + 0.8 * x / width + 0.1 * std::sin(row * y)));
      for (int c = 0; c < channels; ++c) {
        const double wave = std::sin(0.9 * x + 0.2 * c) * std::sin(0.7 * y + (card ? 1 : 0));
        scene.values.push_back(static_cast<float>(0.3 + 0.15 * wave) + 0.02F * normal(engine));
      }
    }
  }
  input.image = {width, height, channels, std::vector<float>(scene.values.size(), 0.0F)};
  for (int l = 0; l < 3; ++l) {
    for (int k = 0; k < 3; ++k) {
      const model::LinearImage view =
          WarpImage(scene, input.disparity, RenderDisparity(input.disparity, k - 1.0, l - 1.0));
      for (std::size_t i = 0; i < view.values.size(); ++i) {
        input.image.values[i] += view.values[i] / 9;
      }
    }
  }
  for (float& value : input.image.values) value += 0.002F * normal(engine);
  return input;
}

struct Solved {
  model::LightField light_field;
  SceneSummary summary;
  SceneMaps maps;
};
// So little work is not worth more than one thread.
Solved SolvedIn(const EstimateInput& input, SceneOptions options, int bands, int threads = 1) {
  options.least_bands = bands;
  Solved solved;
  solved.light_field =
      EstimateScene(input, options, RunOnThreads(threads), &solved.summary, &solved.maps);
  return solved;
}

// The largest difference of encoded values, in levels of 8 bits.
double LargestLevels(const model::LightField& a, const model::LightField& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    const double difference = a.transfer.Encode(std::clamp(a.values[i], 0.0F, 1.0F)) -
                              a.transfer.Encode(std::clamp(b.values[i], 0.0F, 1.0F));
    largest = std::max(largest, 255 * std::abs(difference));
  }
  return largest;
}

void ExpectSame(const Solved& bands, const Solved& whole, int count) {
  EXPECT_EQ(whole.summary.bands, 1);
  EXPECT_EQ(bands.summary.bands, count);
  EXPECT_THAT(bands.summary.message, HasSubstr(std::to_string(count) + " bands"));
  EXPECT_THAT(whole.summary.message, ::testing::Not(HasSubstr("bands")));
  ASSERT_EQ(bands.light_field.values.size(), whole.light_field.values.size());
  EXPECT_LT(LargestLevels(bands.light_field, whole.light_field), 0.5);
  EXPECT_EQ(bands.summary.noise_sigma, whole.summary.noise_sigma);
  EXPECT_NEAR(bands.summary.strength, whole.summary.strength, 1e-3 * whole.summary.strength);
  EXPECT_NEAR(bands.summary.occluded_fraction, whole.summary.occluded_fraction, 1e-6);
  EXPECT_NEAR(bands.summary.row_share, whole.summary.row_share, 1e-6);
  EXPECT_NEAR(bands.summary.residual_rms, whole.summary.residual_rms,
              1e-3 * whole.summary.residual_rms);
  EXPECT_TRUE(bands.summary.converged);
  EXPECT_GT(bands.summary.iterations, 0);
  EXPECT_EQ(bands.maps.blur_sigma_px, whole.maps.blur_sigma_px);
  EXPECT_FALSE(whole.maps.confidence.empty());
  EXPECT_EQ(bands.maps.confidence, whole.maps.confidence);
  ASSERT_EQ(bands.maps.residual.size(), whole.maps.residual.size());
  ASSERT_EQ(bands.maps.occluded_fraction.size(), whole.maps.occluded_fraction.size());
  ASSERT_EQ(bands.maps.radiance.values.size(), whole.maps.radiance.values.size());
  EXPECT_EQ(bands.maps.radiance.height_px, whole.maps.radiance.height_px);
  for (std::size_t i = 0; i < whole.maps.residual.size(); ++i) {
    ASSERT_NEAR(bands.maps.occluded_fraction[i], whole.maps.occluded_fraction[i], 1e-6) << i;
    ASSERT_NEAR(bands.maps.residual[i], whole.maps.residual[i], 0.5 / 255) << i;
  }
}

TEST(SceneBands, AreTheWholeImageForEveryPrior) {
  for (const int channels : {1, 3}) {
    const EstimateInput input = CardBeforeWall(48, 160, channels);
    for (const Prior prior :
         {Prior::kRidge, Prior::kGradient, Prior::kTotalVariation, Prior::kPatches}) {
      SCOPED_TRACE(PriorName(prior) + ", channels " + std::to_string(channels));
      SceneOptions options;
      options.prior = prior;
      // The error that the default tolerances leave is larger than the difference that bands make.
      options.tolerance = prior == Prior::kTotalVariation || prior == Prior::kPatches ? 5e-6 : 5e-5;
      options.max_iterations = 600;
      ExpectSame(SolvedIn(input, options, 4), SolvedIn(input, options, 1), 4);
    }
  }
}

TEST(SceneBands, KnowTheSlopeOfTheWholeImage) {
  EstimateInput input = CardBeforeWall(48, 200, 1);
  for (std::size_t i = 0; i < input.image.values.size(); ++i) {  // dark above, bright below
    input.image.values[i] *=
        0.2F + 1.2F * static_cast<float>(i) / static_cast<float>(input.image.values.size());
  }
  SceneOptions options;
  options.slope_weights = false;
  for (const Prior prior : {Prior::kRidge, Prior::kTotalVariation}) {
    SCOPED_TRACE(PriorName(prior));
    options.prior = prior;
    options.tolerance = prior == Prior::kTotalVariation ? 5e-6 : 5e-5;  // see above
    ExpectSame(SolvedIn(input, options, 3), SolvedIn(input, options, 1), 3);
  }
}

TEST(SceneBands, ShareOneStrengthByCrossValidation) {
  const EstimateInput input = CardBeforeWall(48, 200, 1);
  SceneOptions options;
  options.prior = Prior::kRidge;
  options.strength_rule = StrengthRule::kGcv;
  const Solved bands = SolvedIn(input, options, 3);
  options.strength_rule = StrengthRule::kGiven;
  options.strength = bands.summary.strength;
  const Solved given = SolvedIn(input, options, 3);
  EXPECT_EQ(bands.light_field.values, given.light_field.values);
  EXPECT_GT(bands.summary.iterations, 2 * given.summary.iterations);
}

TEST(SceneBands, DoNotDependOnTheNumberOfThreads) {
  const EstimateInput input = CardBeforeWall(48, 160, 3);
  SceneOptions options;
  options.prior = Prior::kRidge;
  const Solved first = SolvedIn(input, options, 3, 1);
  EXPECT_EQ(SolvedIn(input, options, 3, 3).light_field.values, first.light_field.values);
}

TEST(SceneBands, CoverEachRowOnce) {
  for (const int count : {1, 3, 7, 20}) {
    int next = 0;
    for (const SceneBand& band : BandsOf(100, count, 9)) {
      EXPECT_EQ(band.first, next);
      EXPECT_GT(band.last, band.first);
      EXPECT_EQ(band.from, std::max(0, band.first - 9));
      EXPECT_EQ(band.to, std::min(100, band.last + 9));
      next = band.last;
    }
    EXPECT_EQ(next, 100);
  }
  const std::vector<SceneBand> sample = SampleBands(100, 32, 2, 5);
  ASSERT_EQ(sample.size(), 2u);
  EXPECT_EQ(sample[0].first, 32);
  EXPECT_EQ(sample[0].last, 64);
  EXPECT_EQ(sample[0].from, 27);
  EXPECT_EQ(sample[1].first, 96);
  EXPECT_EQ(sample[1].to, 100);
  EXPECT_EQ(SampleBands(100, 32, 1, 5).size(), 4u);
}

TEST(SceneBands, ReachAsFarAsTheOutermostView) {
  DisparityMap map{2, 1, {-0.75F, 0.5F}, {1, 2}};
  // Two views from the centre, each 1.5 px, and the reach of interpolation between pixels.
  EXPECT_EQ(ReachPx(map, 0, 5), 3 + 2);
  EXPECT_EQ(ReachPx(map, -1, 5), 4 + 2);  // 1 + 1 px
  EXPECT_EQ(ReachPx(map, 0, 1), 2);
}

TEST(SceneBands, AreAsManyAsTheMemoryAsksFor) {
  if (testing::kIsSanitized) GTEST_SKIP() << "a sanitizer holds back what was freed";
  const EstimateInput input = CardBeforeWall(320, 800, 3);
  SceneOptions options;
  options.prior = Prior::kRidge;
  options.tolerance = 5e-5;  // the default tolerance leaves a larger error than bands make
  std::vector<float> middle;
  SceneViewSink sink;
  sink.take = [&](int k, int l, const model::LinearImage& view, const std::vector<Confidence>&) {
    if (k == 1 && l == 1) middle = view.values;
  };
  SolverRun run = RunTo(sink);
  run.threads = 1;
  SceneSummary whole, bands;
  EstimateScene(input, options, run, &whole);
  const std::vector<float> of_whole = middle;
  run.memory_limit_mib = 1;
  const std::string refusal = ErrorOf([&] { EstimateScene(input, options, run, &bands); });
  ASSERT_THAT(refusal, HasSubstr("memory limit 1 MiB: with any number of bands "));
  ASSERT_THAT(refusal, HasSubstr("must be at least as large"));
  const double least = std::stod(refusal.substr(refusal.find("of bands ") + 9));
  ASSERT_LT(least + 5, whole.predicted_memory_mib);
  run.memory_limit_mib = (least + whole.predicted_memory_mib) / 2;
  EstimateScene(input, options, run, &bands);
  EXPECT_GT(bands.bands, 1);
  EXPECT_LE(bands.predicted_memory_mib, *run.memory_limit_mib);
  ASSERT_EQ(middle.size(), of_whole.size());
  for (std::size_t i = 0; i < middle.size(); ++i) ASSERT_NEAR(middle[i], of_whole[i], 1e-3) << i;
}

TEST(SceneViews, ComeOneByOneAndAreTheLightField) {
  const EstimateInput input = CardBeforeWall(40, 36, 3);
  SceneSummary summary, of_all;
  SceneMaps maps;
  const model::LightField all = EstimateScene(input, {}, RunOnThreads(3), &of_all, &maps);
  std::mutex mutex;
  std::map<std::pair<int, int>, std::vector<model::LinearImage>> views;
  SceneViewSink sink;
  sink.take = [&](int k, int l, const model::LinearImage& view,
                  const std::vector<Confidence>& confidence) {
    const std::lock_guard<std::mutex> lock(mutex);
    views[{k, l}].push_back(view);
    EXPECT_TRUE(std::equal(confidence.begin(), confidence.end(),
                           maps.confidence.begin() + (l * 3 + k) * 40 * 36));
    EXPECT_EQ(confidence.size(), 40 * 36u);
  };
  SolverRun run = RunTo(sink);
  run.threads = 3;
  const model::LightField described = EstimateScene(input, {}, run, &summary);
  EXPECT_TRUE(described.values.empty());
  EXPECT_EQ(described.u_count, 3);
  EXPECT_EQ(described.v_count, 3);
  EXPECT_EQ(described.s_count, 40);
  EXPECT_EQ(described.t_count, 36);
  EXPECT_EQ(described.channels, 3);
  EXPECT_EQ(described.origin.strength, all.origin.strength);
  EXPECT_EQ(described.origin.method, "scene");
  ASSERT_EQ(views.size(), 9u);
  for (const auto& [place, taken] : views) {
    ASSERT_EQ(taken.size(), 1u);
    EXPECT_EQ(taken[0].values, model::ViewImage(all, place.first, place.second).values);
  }
  sink.take = [](int, int, const model::LinearImage&, const std::vector<Confidence>&) {
    throw Interrupted();
  };
  EXPECT_THROW(EstimateScene(input, {}, run, &summary), Interrupted);
}

}  // namespace
}  // namespace thicklens::estimator
