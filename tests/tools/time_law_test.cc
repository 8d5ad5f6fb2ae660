// How long an estimate takes, from few measured ones.
#include "time_law.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "estimate_plan.h"
#include "picture_load.h"
#include "thicklens/error.h"

namespace thicklens::tools {
namespace {

using ::testing::DoubleNear;
using ::testing::Each;
using ::testing::ElementsAre;

std::vector<PictureLoad> Loads(int count, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> megapixels(0.01, 0.3), blur(0.3, 3), files(0, 1);
  std::uniform_int_distribution<int> across(1, 4), colour(0, 1);
  std::vector<PictureLoad> loads;
  for (int i = 0; i < count; ++i) {
    const int views = 2 * across(engine) + 1;
    loads.push_back({megapixels(engine), colour(engine) == 1 ? 3 : 1, views * views, blur(engine),
                     files(engine)});
  }
  return loads;
}

std::vector<TimedLoad> Timed(const TimeLaw& law, const std::vector<PictureLoad>& loads) {
  std::vector<TimedLoad> timed;
  for (const PictureLoad& load : loads) timed.push_back({load, law.Seconds(load), 0});
  return timed;
}

TimeLaw SomeLaw() {
  TimeLaw::Terms terms = TimeLaw::Terms::Constant(0.1);
  terms[0] = 0.02;
  terms[1] = 0.5;
  terms[2] = 0;
  return TimeLaw(terms);
}

TEST(TimeLaw, IsFoundAgainFromExactTimes) {
  const TimeLaw law = SomeLaw();
  const TimeLaw found = FitTimeLaws({Timed(law, Loads(30, 1))}).front();
  EXPECT_LT((found.coefficients() - law.coefficients()).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_THAT(LeftOutRatios({Timed(law, Loads(20, 2))}), ElementsAre(Each(DoubleNear(1, 1e-6))));
}

// The oracle: no law without negative terms near it has a smaller error.
TEST(TimeLaw, IsTheBestWithoutNegativeTerms) {
  std::vector<TimedLoad> timed = Timed(SomeLaw(), Loads(12, 3));
  std::mt19937 engine(4);
  std::lognormal_distribution<double> noise(0, 0.5);
  for (TimedLoad& load : timed) load.seconds *= noise(engine);
  const auto error = [&](const TimeLaw& law) {
    double sum = 0;
    for (const TimedLoad& load : timed) {
      sum += std::pow(law.Seconds(load.load) / load.seconds - 1, 2);
    }
    return sum;
  };
  const TimeLaw found = FitTimeLaws({timed}).front();
  EXPECT_GE(found.coefficients().minCoeff(), 0);
  EXPECT_EQ(found.coefficients().minCoeff(), 0);  // a plain fit would go below
  std::normal_distribution<double> step(0, 1);
  for (int i = 0; i < 20000; ++i) {
    const double size = std::pow(10, -1 - i % 5);
    TimeLaw::Terms other = found.coefficients();
    for (int term = 0; term < TimeLaw::kTerms; ++term) {
      other[term] = std::max(0.0, other[term] + size * step(engine));
    }
    ASSERT_GE(error(TimeLaw(other)), error(found) * (1 - 1e-9));
  }
}

// What plans have in common does not tell them apart, however noisy it is.
TEST(TimeLaw, PlansDifferByWhatTheySolveAlone) {
  const std::vector<PictureLoad> loads = Loads(15, 6);
  const TimeLaw common = SomeLaw();
  TimeLaw::Terms solve = TimeLaw::Terms::Zero();
  solve[2] = 0.2;
  std::mt19937 engine(7);
  std::lognormal_distribution<double> noise(0, 0.3);
  TimesOfPlans plans(2);
  for (const PictureLoad& load : loads) {
    for (const double factor : {1.0, 1.1}) {
      const double own = factor * TimeLaw(solve).Seconds(load);
      plans[factor == 1 ? 0 : 1].push_back({load, own + common.Seconds(load) * noise(engine), own});
    }
  }
  const std::vector<TimeLaw> laws = FitTimeLaws(plans);
  for (const PictureLoad& load : Loads(20, 8)) {
    EXPECT_NEAR(laws[1].Seconds(load) - laws[0].Seconds(load), 0.1 * TimeLaw(solve).Seconds(load),
                1e-9);
  }
  EXPECT_EQ(LeftOutRatios(plans).size(), 2U);
  EXPECT_EQ(LeftOutRatios(plans)[1].size(), loads.size());
}

TEST(TimeLaw, RefusesWhatNoLawCanBeMadeFrom) {
  EXPECT_THROW(FitTimeLaws({{}}), Error);
  const std::vector<TimedLoad> good = Timed(SomeLaw(), Loads(3, 5));
  EXPECT_THROW(FitTimeLaws({good, {good[0], good[1]}}), Error);
  std::vector<TimedLoad> timed = good;
  timed[1].seconds = 0;
  EXPECT_THROW(FitTimeLaws({timed}), Error);
  timed = good;
  timed[1].solve_seconds = 2 * timed[1].seconds;
  EXPECT_THROW(FitTimeLaws({timed}), Error);
  timed[1].solve_seconds = -1;
  EXPECT_THROW(FitTimeLaws({good, timed}), Error);
}

// A picture of which each point is seen at the same disparity.
estimator::EstimateInput Flat(int u_count, int v_count, float disparity) {
  estimator::EstimateInput input;
  input.picture = model::LinearPicture{40, 30, 3, std::vector<float>(40 * 30 * 3, 0.5F)};
  input.disparity.width_px = 40;
  input.disparity.height_px = 30;
  input.disparity.disparity.assign(40 * 30, disparity);
  input.weights = Eigen::ArrayXXd::Constant(v_count, u_count, 1.0 / (u_count * v_count));
  return input;
}

TEST(PictureLoad, HasTheBlurOfEqualViews) {
  const PictureLoad load = PictureLoadOf(Flat(5, 5, 0.8F));
  EXPECT_DOUBLE_EQ(load.megapixels, 0.0012);
  EXPECT_EQ(load.channels, 3);
  EXPECT_EQ(load.views, 25);
  // The variance of five equal places is two.
  EXPECT_NEAR(load.blur_sigma_px, 0.8 * std::sqrt(2.0), 1e-6);
  // Made of 40 x 30 x 3 x 25 values.
  EXPECT_GT(load.file_seconds, 1e-9 * 40 * 30 * 3 * 25);
  // Along one axis alone, half of it in the mean of both.
  EXPECT_NEAR(PictureLoadOf(Flat(5, 1, 0.8F)).blur_sigma_px, 0.8, 1e-6);
}

}  // namespace
}  // namespace thicklens::tools
