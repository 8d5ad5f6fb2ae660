// Readings that are a nonlinear function of the image scale, on synthetic samples.
#include "calib/registration/scale_nonlinearity.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace thicklens::calib {
namespace {

using model::BenchDirection;

constexpr double kNearestMm = 320, kFarthestMm = 480, kReferenceMm = 400, kOffsetMm = 30;

// Parameters of a synthetic sweep. The reading is that of the law, plus `square_mm` times the
// square of the distance from the middle relative to that of the ends, plus its error.
struct Recipe {
  BenchDirection direction = BenchDirection::kAway;
  int frames = 41;
  double square_mm = 0;
  double reading_sigma_mm = 0.07;
  double scale_sigma = 2e-5;      // relative, independent for each frame
  double stated_sigma_mm = 0.07;  // for the readings
  double shared_mm = 0;           // common to runs of five neighbours
  unsigned seed = 1;
};

struct Made {
  FocusSweep sweep;
  std::vector<ScaleSample> samples;
  ScaleModel law;
};

Made Make(const Recipe& recipe) {
  Made made;
  std::mt19937 random(recipe.seed);
  std::normal_distribution<double> normal(0, 1);
  const double sign = model::DirectionSign(recipe.direction);
  made.sweep.direction = recipe.direction;
  made.sweep.reading_sigma_mm = recipe.stated_sigma_mm;
  double shared_mm = 0;
  for (int i = 0; i < recipe.frames; ++i) {
    const double u = 2.0 * i / (recipe.frames - 1) - 1;
    const double depth_mm = 0.5 * (kNearestMm + kFarthestMm) + 0.5 * u * (kFarthestMm - kNearestMm);
    if (i % 5 == 0) shared_mm = recipe.shared_mm * normal(random);
    ScaleSample sample;
    sample.frame = static_cast<std::size_t>(i);
    sample.reading_mm = sign * (depth_mm - kOffsetMm) + recipe.square_mm * u * u + shared_mm +
                        recipe.reading_sigma_mm * normal(random);
    sample.scale = kReferenceMm / depth_mm;
    sample.registration.scale_sigma = recipe.scale_sigma * sample.scale;
    sample.scale *= 1 + recipe.scale_sigma * normal(random);
    made.samples.push_back(sample);
  }
  made.law.done = true;
  made.law.kind = ScaleKind::kInverseDepth;
  made.law.offset_mm = {kOffsetMm, 0.1, {}};
  made.law.reference_depth_mm = kReferenceMm;
  made.law.reading_rms_mm = recipe.reading_sigma_mm;
  return made;
}

std::optional<ScaleNonlinearity> Find(const Recipe& recipe) {
  const Made made = Make(recipe);
  return FindScaleNonlinearity(made.samples, made.law, made.sweep);
}

int Found(Recipe recipe, int runs) {
  int found = 0;
  for (int run = 0; run < runs; ++run) {
    recipe.seed = 100U + static_cast<unsigned>(run);
    found += Find(recipe) ? 1 : 0;
  }
  return found;
}

// The straight line through two points of the curve, and the reading at which it has depth 0.
double ZeroMm(double sign, double from_u, double to_u, double square_mm) {
  const auto depth = [](double u) { return 400 + 80 * u; };
  const auto reading = [&](double u) { return sign * (depth(u) - kOffsetMm) + square_mm * u * u; };
  const double slope = (reading(to_u) - reading(from_u)) / (depth(to_u) - depth(from_u));
  return -sign * (reading(from_u) - slope * depth(from_u));
}

TEST(FindScaleNonlinearity, MeasuresTheBowAndItsMeaningInBothDirections) {
  for (const BenchDirection direction : {BenchDirection::kAway, BenchDirection::kToward}) {
    for (const double square_mm : {0.8, -0.8}) {
      Recipe recipe;
      recipe.direction = direction;
      recipe.square_mm = square_mm;
      const std::optional<ScaleNonlinearity> nonlinearity = Find(recipe);
      ASSERT_TRUE(nonlinearity) << square_mm;
      // The middle of the curve is at 0, and the chord through its ends is at square_mm there.
      EXPECT_NEAR(nonlinearity->bow_mm.value, -square_mm, 4 * nonlinearity->bow_mm.sigma);
      EXPECT_LT(nonlinearity->bow_mm.sigma, 0.1);
      const double sign = model::DirectionSign(direction);
      const double spread_mm = ZeroMm(sign, 0, 1, square_mm) - ZeroMm(sign, -1, 0, square_mm);
      EXPECT_NEAR(nonlinearity->zero_spread_mm / spread_mm, 1,
                  4 * nonlinearity->bow_mm.sigma / 0.8);
    }
  }
}

// The shares are of 200 seeded sweeps each.
TEST(FindScaleNonlinearity, AStraightModelIsLeftAlone) {
  constexpr int kRuns = 200;
  Recipe recipe;
  EXPECT_EQ(Found(recipe, kRuns), 0) << "readings as good as stated";
  recipe.stated_sigma_mm = 0;
  EXPECT_EQ(Found(recipe, kRuns), 0) << "nothing stated";
  recipe.stated_sigma_mm = 0.02;
  EXPECT_EQ(Found(recipe, kRuns), 0) << "readings worse than stated";
  recipe = {};
  recipe.frames = 9;
  EXPECT_LE(Found(recipe, kRuns), 1) << "few frames";
  recipe = {};
  recipe.shared_mm = 0.15;
  EXPECT_LE(Found(recipe, kRuns), 4) << "errors that neighbours share";
}

// Remaining radial distortion k changes the scales by k (1 - 1/s^2), each by less than its stated
// error, but all along one curve.
TEST(FindScaleNonlinearity, ACurveThatTheErrorsOfTheScalesAllowIsNone) {
  Recipe recipe;
  recipe.reading_sigma_mm = recipe.stated_sigma_mm = 0.005;
  recipe.scale_sigma = 1e-6;
  for (const bool is_stated : {true, false}) {
    Made made = Make(recipe);
    for (ScaleSample& sample : made.samples) {
      const double k = 2e-3 * (1 - 1 / (sample.scale * sample.scale));
      if (is_stated) sample.registration.scale_sigma += std::abs(k) * sample.scale / 2;
      sample.scale *= 1 + k;
    }
    EXPECT_EQ(FindScaleNonlinearity(made.samples, made.law, made.sweep).has_value(), !is_stated);
  }
}

// A curve of 4.2 standard errors of the scales. A second run through the same positions has the
// same errors and does not make it certain; other positions do.
TEST(FindScaleNonlinearity, FramesAtOnePositionShareTheErrorOfTheirScale) {
  Recipe recipe;
  recipe.frames = 21;
  recipe.reading_sigma_mm = recipe.stated_sigma_mm = 0.005;
  recipe.scale_sigma = 0;
  recipe.square_mm = 0.25;
  const auto with_errors = [](Made made) {
    for (ScaleSample& sample : made.samples) sample.registration.scale_sigma = 2e-4 * sample.scale;
    return made;
  };
  Made there = with_errors(Make(recipe));
  EXPECT_FALSE(FindScaleNonlinearity(there.samples, there.law, there.sweep));
  recipe.seed = 2;
  const Made back = with_errors(Make(recipe));
  there.samples.insert(there.samples.end(), back.samples.begin(), back.samples.end());
  EXPECT_FALSE(FindScaleNonlinearity(there.samples, there.law, there.sweep));
  recipe.frames = 42;
  const Made denser = with_errors(Make(recipe));
  EXPECT_TRUE(FindScaleNonlinearity(denser.samples, denser.law, denser.sweep));
}

TEST(FindScaleNonlinearity, SingleWrongReadingsNeitherFeignNorHideIt) {
  for (const double square_mm : {0.0, 0.45}) {
    int found = 0;
    for (unsigned seed = 1; seed <= 20; ++seed) {
      Recipe recipe;
      recipe.square_mm = square_mm;
      recipe.seed = seed;
      Made made = Make(recipe);
      made.samples[0].reading_mm += 1;
      made.samples[20].reading_mm -= 1;
      made.samples[30].reading_mm += 1;
      found += FindScaleNonlinearity(made.samples, made.law, made.sweep) ? 1 : 0;
    }
    if (square_mm > 0) {
      EXPECT_GE(found, 18);
    } else {
      EXPECT_EQ(found, 0);
    }
  }
}

TEST(FindScaleNonlinearity, NeedsAModelAndNineFrames) {
  Recipe recipe;
  recipe.square_mm = 2;
  Made made = Make(recipe);
  EXPECT_TRUE(FindScaleNonlinearity(made.samples, made.law, made.sweep));
  made.law.done = false;
  EXPECT_FALSE(FindScaleNonlinearity(made.samples, made.law, made.sweep));
  recipe.frames = 8;
  EXPECT_FALSE(Find(recipe));
  recipe.frames = 9;
  EXPECT_TRUE(Find(recipe));
}

// The result is the same to the last bit for the same samples in any order.
TEST(FindScaleNonlinearity, DoesNotDependOnTheOrderOfTheFrames) {
  Recipe recipe;
  recipe.square_mm = 0.8;
  Made made = Make(recipe);
  const std::optional<ScaleNonlinearity> nonlinearity =
      FindScaleNonlinearity(made.samples, made.law, made.sweep);
  std::shuffle(made.samples.begin(), made.samples.end(), std::mt19937(5));
  const std::optional<ScaleNonlinearity> other =
      FindScaleNonlinearity(made.samples, made.law, made.sweep);
  ASSERT_TRUE(nonlinearity && other);
  EXPECT_EQ(nonlinearity->bow_mm.value, other->bow_mm.value);
  EXPECT_EQ(nonlinearity->bow_mm.sigma, other->bow_mm.sigma);
}

}  // namespace
}  // namespace thicklens::calib
