// Views and refocused images of a scene against the solver's views and against closed forms.
#include "thicklens/estimator/scene_form.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "tests/estimator/solver_runs.h"
#include "thicklens/estimator/render.h"
#include "thicklens/estimator/scene_solver.h"

namespace thicklens::estimator {
namespace {

using ::testing::HasSubstr;
using ::thicklens::testing::ErrorOf;

constexpr int kWidth = 60, kHeight = 48;

// A near square before a slanted wall, with a random texture.
SceneForm SquareBeforeWall(int u_count, int v_count) {
  SceneForm scene;
  scene.frame.s_count = kWidth;
  scene.frame.t_count = kHeight;
  scene.frame.u_count = u_count;
  scene.frame.v_count = v_count;
  scene.frame.channels = 3;
  scene.frame.weights = model::ApertureWeights(model::ApertureShape::kUniform, u_count, v_count);
  scene.radiance = {kWidth, kHeight, 3, {}};
  scene.disparity = {kWidth, kHeight, {}, {1, 1}};
  std::mt19937 engine(11);
  std::uniform_real_distribution<float> light(0.1F, 0.9F);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool is_near = x > 20 && x < 40 && y > 15 && y < 33;
      scene.disparity.disparity.push_back(is_near ? 1.5F
                                                  : static_cast<float>(-1 + 0.01 * x + 0.004 * y));
      scene.confidence.push_back(ConfidenceOfPoint(is_near ? 1 : 0.8, is_near ? 4 : 1));
      for (int c = 0; c < 3; ++c) scene.radiance.values.push_back(light(engine));
    }
  }
  return scene;
}

// A wall of one disparity whose light is linear in x and y.
SceneForm RampOn(double disparity_px) {
  SceneForm scene = SquareBeforeWall(5, 5);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const std::size_t i = static_cast<std::size_t>(y * kWidth + x);
      scene.disparity.disparity[i] = static_cast<float>(disparity_px);
      for (std::size_t c = 0; c < 3; ++c) {
        scene.radiance.values[3 * i + c] =
            static_cast<float>(0.1 + 0.01 * x + 0.004 * y + 0.1 * static_cast<double>(c));
      }
    }
  }
  return scene;
}

TEST(SceneForm, ItsViewsAreThoseOfTheSolverBitForBit) {
  SceneForm scene = SquareBeforeWall(3, 3);
  EstimateInput input;
  input.weights = scene.frame.weights;
  input.image = scene.radiance;
  input.disparity = scene.disparity;
  SceneMaps maps;
  const model::LightField solved = EstimateScene(input, {}, RunOnThreads(2), nullptr, &maps);
  SceneForm found;
  found.frame = model::DescriptionOf(solved);
  found.radiance = maps.radiance;
  found.disparity = input.disparity;
  found.confidence = maps.of_points;
  EXPECT_EQ(ViewsOf(found, 2).values, solved.values);
  EXPECT_EQ(RayConfidenceOf(found, 2), maps.confidence);
}

TEST(SceneForm, TheSolverFindsTheSameWithoutMakingViews) {
  SceneForm scene = SquareBeforeWall(3, 3);
  EstimateInput input;
  input.weights = scene.frame.weights;
  input.image = scene.radiance;
  input.disparity = scene.disparity;
  SceneMaps with_views, without_views;
  EstimateScene(input, {}, RunOnThreads(2), nullptr, &with_views);
  SceneViewSink sink;  // `take` would throw
  sink.wants_views = false;
  SolverRun run = RunOnThreads(2);
  run.sink = &sink;
  const model::LightField frame = EstimateScene(input, {}, run, nullptr, &without_views);
  EXPECT_TRUE(frame.values.empty());
  EXPECT_EQ(without_views.radiance.values, with_views.radiance.values);
  EXPECT_EQ(without_views.of_points, with_views.of_points);
  EXPECT_EQ(without_views.residual, with_views.residual);
}

TEST(SceneForm, AViewBetweenViewsShowsADisplacedRamp) {
  const double disparity_px = 1.3;
  const SceneForm scene = RampOn(disparity_px);
  const SceneRenderer renderer(scene);
  for (const auto& [a, b] : {std::pair(0.0, 0.0), {1.0, -2.0}, {0.37, 1.61}, {-1.83, -0.29}}) {
    const model::LinearImage view = renderer.View(a, b);
    for (int y = 8; y < kHeight - 8; ++y) {
      for (int x = 8; x < kWidth - 8; ++x) {
        const double expected =
            0.1 + 0.01 * (x + a * disparity_px) + 0.004 * (y + b * disparity_px);
        const std::size_t i = 3 * static_cast<std::size_t>(y * kWidth + x);
        ASSERT_NEAR(view.values[i], expected, 2e-6) << a << ' ' << b << ' ' << x << ' ' << y;
        ASSERT_NEAR(view.values[i + 2], expected + 0.2, 2e-6);
      }
    }
  }
}

// Views are displaced by whole pixels where the disparity in focus is whole, and their mean needs
// no interpolation.
TEST(SceneForm, ARefocusedImageIsTheMeanOfDisplacedViews) {
  const SceneForm scene = SquareBeforeWall(5, 3);
  Eigen::ArrayXXd weights = scene.frame.weights;
  weights(0, 1) = 0;
  weights(2, 4) *= 3;
  for (const int focus_px : {-2, 0, 1}) {
    const model::LinearImage image = RefocusScene(scene, focus_px, weights, 2);
    const model::LinearImage by_views =
        Refocus(ViewsOf(scene, 2), focus_px, focus_px, weights / weights.sum(), 2);
    constexpr int kBorderPx = 8;  // stored views have no light beyond their borders
    for (int y = kBorderPx; y < kHeight - kBorderPx; ++y) {
      for (int x = kBorderPx; x < kWidth - kBorderPx; ++x) {
        const std::size_t i = 3 * static_cast<std::size_t>(y * kWidth + x);
        ASSERT_NEAR(image.values[i], by_views.values[i], 3e-6) << focus_px << ": " << x << ' ' << y;
      }
    }
  }
}

// Where everything is in focus, all views show the same point, and the image is the radiance.
TEST(SceneForm, ASharpPointHasItsRadiance) {
  SceneForm scene = SquareBeforeWall(7, 7);
  std::fill(scene.disparity.disparity.begin(), scene.disparity.disparity.end(), 1.37F);
  const model::LinearImage image =
      RefocusScene(scene, static_cast<double>(1.37F), scene.frame.weights, 1);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    ASSERT_NEAR(image.values[i], scene.radiance.values[i], 1e-6) << i;
  }
}

// Steps in mm and disparities in px per mm describe the same views.
TEST(SceneForm, TheUnitOfTheDisparityDoesNotMatter) {
  const SceneForm scene = SquareBeforeWall(5, 5);
  SceneForm in_mm = scene;
  in_mm.disparity.step = {0.5, 0.5};
  for (float& value : in_mm.disparity.disparity) value *= 2;
  const model::LinearImage view = SceneRenderer(scene).View(1.5, -0.75);
  EXPECT_EQ(SceneRenderer(in_mm).View(1.5, -0.75).values, view.values);
  const model::LinearImage focus = RefocusScene(scene, 0.5, scene.frame.weights, 1);
  EXPECT_EQ(RefocusScene(in_mm, 1, scene.frame.weights, 1).values, focus.values);
}

TEST(SceneForm, TheNumberOfThreadsDoesNotMatter) {
  const SceneForm scene = SquareBeforeWall(5, 5);
  const std::vector<float> one = RefocusScene(scene, 0.4, scene.frame.weights, 1).values;
  for (const int threads : {2, 3, 7}) {
    EXPECT_EQ(RefocusScene(scene, 0.4, scene.frame.weights, threads).values, one) << threads;
  }
}

TEST(SceneForm, AFewViewsTellTheSharesOfAllRays) {
  for (const int count : {2, 4, 7, 12}) {
    const SceneForm scene = SquareBeforeWall(count, count);
    std::array<std::size_t, 256> counts{};
    for (const Confidence confidence : RayConfidenceOf(scene, 2)) ++counts[confidence];
    const ConfidenceShares all = SharesOf(counts), found = RaySharesOf(scene, 2);
    const double bound =
        count <= 4 ? 1e-12 : 0.01;  // a sample is seen or not: small images are coarse
    EXPECT_NEAR(found.visible, all.visible, bound) << count;
    EXPECT_NEAR(found.partly_visible, all.partly_visible, bound) << count;
    EXPECT_NEAR(found.blurred, all.blurred, bound) << count;
    EXPECT_NEAR(found.filled_in, all.filled_in, bound) << count;
    EXPECT_GT(all.filled_in, count > 4 ? 0.05 : 0.005);
    EXPECT_GT(all.blurred, 0.1);
  }
}

TEST(SceneForm, WithoutConfidenceThereAreNoShares) {
  SceneForm scene = SquareBeforeWall(3, 3);
  scene.confidence.clear();
  EXPECT_TRUE(RayConfidenceOf(scene, 1).empty());
  EXPECT_TRUE(SceneRenderer(scene).ViewConfidence(1, 1).empty());
  EXPECT_EQ(RaySharesOf(scene, 1).visible, 0);
}

TEST(SceneForm, EveryErrorNamesTheMember) {
  const SceneForm good = SquareBeforeWall(3, 3);
  const auto error_with = [&good](auto change) {
    SceneForm bad = good;
    change(&bad);
    return ErrorOf([&bad] { SceneRenderer renderer(bad); });
  };
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_TRUE(good.IsValid(nullptr));
  EXPECT_THAT(error_with([](SceneForm* s) { s->frame.values.resize(4); }), HasSubstr("4 values"));
  EXPECT_THAT(error_with([](SceneForm* s) { s->frame.u_count = 0; }), HasSubstr("frame.u_count"));
  EXPECT_THAT(error_with([](SceneForm* s) { s->frame.weights *= 2; }), HasSubstr("weights"));
  EXPECT_THAT(error_with([](SceneForm* s) {
                s->frame.present.assign(9, true);
                s->frame.present[3] = false;
              }),
              HasSubstr("frame.present"));
  EXPECT_THAT(error_with([](SceneForm* s) { s->radiance.channels = 1; }), HasSubstr("radiance"));
  EXPECT_THAT(error_with([](SceneForm* s) { s->radiance.values.pop_back(); }),
              HasSubstr("8639 values: 8640"));
  EXPECT_THAT(error_with([](SceneForm* s) { s->radiance.values[3 * kWidth + 7] = kNan; }),
              HasSubstr("radiance: the value at (2, 1) is nan"));
  EXPECT_THAT(error_with([](SceneForm* s) { s->disparity.width_px = 4; }), HasSubstr("disparity"));
  EXPECT_THAT(error_with([](SceneForm* s) { s->disparity.disparity[5] = kNan; }),
              HasSubstr("disparity: the value at (5, 0) is nan"));
  EXPECT_THAT(error_with([](SceneForm* s) { s->disparity.step.x() = kNan; }),
              HasSubstr("disparity.step"));
  EXPECT_THAT(error_with([](SceneForm* s) { s->confidence.pop_back(); }), HasSubstr("2879 bytes"));
  EXPECT_THAT(ErrorOf([&] { RefocusScene(good, kNan, good.frame.weights, 1); }),
              HasSubstr("disparity is nan"));
  EXPECT_THAT(ErrorOf([&] { RefocusScene(good, 0, Eigen::ArrayXXd::Zero(3, 3), 1); }),
              HasSubstr("one of them > 0"));
  EXPECT_THAT(ErrorOf([&] { RefocusScene(good, 0, Eigen::ArrayXXd::Ones(3, 2), 1); }),
              HasSubstr("3 rows of 2"));
}

}  // namespace
}  // namespace thicklens::estimator
