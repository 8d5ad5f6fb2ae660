// How long an estimate takes, from few measured ones.
#include "tools/options/time_law.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <random>
#include <vector>

#include "thicklens/base/error.h"
#include "tools/options/estimate_plan.h"
#include "tools/options/picture_load.h"

namespace thicklens::tools {
namespace {

using ::testing::DoubleNear;
using ::testing::Each;
using ::testing::ElementsAre;

std::vector<PictureLoad> Loads(int count, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> megapixels(0.01, 0.3), blur(0.03, 3), files(0, 1);
  std::uniform_int_distribution<int> across(1, 4), colour(0, 1);
  std::vector<PictureLoad> loads;
  for (int i = 0; i < count; ++i) {
    const int views = 2 * across(engine) + 1;
    loads.push_back({megapixels(engine), colour(engine) == 1 ? 3 : 1, views * views, blur(engine),
                     files(engine)});
  }
  return loads;
}

// A law for each part of a run, of terms that such work has.
struct PartLaws {
  TimeLaw setup, solve, files, rest;

  // Reading takes what it takes, which no law knows.
  TimedLoad Timed(const PictureLoad& load) const {
    const PartSeconds parts = {0.1 + std::fmod(1000 * load.blur_sigma_px, 1), setup.Seconds(load),
                               solve.Seconds(load), files.Seconds(load)};
    return {load, parts.read + parts.setup + parts.solve + parts.files + rest.Seconds(load), parts};
  }
  std::vector<TimedLoad> Timed(const std::vector<PictureLoad>& loads) const {
    std::vector<TimedLoad> timed;
    for (const PictureLoad& load : loads) timed.push_back(Timed(load));
    return timed;
  }
  TimeLaw::Terms Sum() const {
    return setup.coefficients() + solve.coefficients() + files.coefficients() + rest.coefficients();
  }
};

TimeLaw LawOf(const std::map<TimeLaw::Term, double>& coefficients) {
  TimeLaw::Terms terms = TimeLaw::Terms::Zero();
  for (const auto& [term, coefficient] : coefficients) terms[term] = coefficient;
  return TimeLaw(terms);
}

PartLaws SomeLaws() {
  using Law = TimeLaw;
  return {LawOf({{Law::kStart, 0.01}, {Law::kPixels, 0.1}, {Law::kPixelsViewsBlur, 0.007}}),
          LawOf({{Law::kPixelsChannels, 0.06},
                 {Law::kPixelsChannelsBlur, 0.02},
                 {Law::kPixelsViewsChannelsIterations, 0.15},
                 {Law::kPixelsChannelsIterations, 0.08},
                 {Law::kPixelsViewsBlurArea, 0.003}}),
          LawOf({{Law::kViews, 0.0006}, {Law::kPixelsViews, 0.01}, {Law::kFileSeconds, 0.55}}),
          LawOf({{Law::kPixels, 0.02}, {Law::kPixelsViewsChannels, 0.003}})};
}

TEST(TimeLaw, IsFoundAgainFromExactTimes) {
  const PartLaws laws = SomeLaws();
  const TimeLaw found = FitTimeLaws({laws.Timed(Loads(30, 1))}).front();
  EXPECT_LT((found.coefficients() - laws.Sum()).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_THAT(LeftOutRatios({laws.Timed(Loads(20, 2))}), ElementsAre(Each(DoubleNear(1, 1e-6))));
}

// By hand: 2 megapixels in three channels, 5 x 5 views, a blur of 3 px, files of 4 s.
TEST(TimeLaw, IsTheSumOfItsTerms) {
  const std::map<TimeLaw::Term, double> of_one = {{TimeLaw::kStart, 1},
                                                  {TimeLaw::kPixels, 2},
                                                  {TimeLaw::kPixelsChannels, 6},
                                                  {TimeLaw::kPixelsViews, 50},
                                                  {TimeLaw::kPixelsViewsChannels, 150},
                                                  {TimeLaw::kPixelsChannelsBlur, 18},
                                                  {TimeLaw::kPixelsViewsBlur, 150},
                                                  {TimeLaw::kFileSeconds, 4},
                                                  {TimeLaw::kViews, 25},
                                                  {TimeLaw::kPixelsViewsChannelsIterations, 112.5},
                                                  {TimeLaw::kPixelsChannelsIterations, 5.625},
                                                  {TimeLaw::kPixelsViewsBlurArea, 450}};
  ASSERT_EQ(of_one.size(), static_cast<std::size_t>(TimeLaw::kTerms));
  for (const auto& [term, seconds] : of_one) {
    EXPECT_DOUBLE_EQ(LawOf({{term, 1}}).Seconds({2, 3, 25, 3, 4}), seconds) << term;
  }
}

// The oracle: no law without negative terms near it has a smaller error.
TEST(TimeLaw, IsTheBestWithoutNegativeTerms) {
  constexpr std::array kTermsOfSolving = {TimeLaw::kStart,
                                          TimeLaw::kPixels,
                                          TimeLaw::kPixelsChannels,
                                          TimeLaw::kPixelsViews,
                                          TimeLaw::kPixelsChannelsBlur,
                                          TimeLaw::kPixelsViewsBlur,
                                          TimeLaw::kPixelsViewsChannelsIterations,
                                          TimeLaw::kPixelsChannelsIterations,
                                          TimeLaw::kPixelsViewsBlurArea};
  std::vector<TimedLoad> timed;
  std::mt19937 engine(4);
  std::lognormal_distribution<double> noise(0, 0.5);
  for (const PictureLoad& load : Loads(12, 3)) {
    const double seconds = (0.02 + SomeLaws().solve.Seconds(load)) * noise(engine);
    timed.push_back({load, seconds, {0, 0, seconds, 0}});
  }
  const auto error = [&](const TimeLaw& law) {
    double sum = 0;
    for (const TimedLoad& load : timed) {
      sum += std::pow(law.Seconds(load.load) / load.seconds - 1, 2);
    }
    return sum;
  };
  const TimeLaw found = FitTimeLaws({timed}).front();
  EXPECT_GE(found.coefficients().minCoeff(), 0);
  int zeros = 0;  // a plain fit would go below
  for (const TimeLaw::Term term : kTermsOfSolving) zeros += found.coefficients()[term] == 0 ? 1 : 0;
  EXPECT_GE(zeros, 1);
  std::normal_distribution<double> step(0, 1);
  for (int i = 0; i < 20000; ++i) {
    const double size = std::pow(10, -1 - i % 5);
    TimeLaw::Terms other = found.coefficients();
    for (const TimeLaw::Term term : kTermsOfSolving) {
      other[term] = std::max(0.0, other[term] + size * step(engine));
    }
    ASSERT_GE(error(TimeLaw(other)), error(found) * (1 - 1e-9));
  }
}

// What plans have in common does not tell them apart, however noisy it is.
TEST(TimeLaw, PlansDifferByWhatTheySolveAlone) {
  const std::vector<PictureLoad> loads = Loads(15, 6);
  const PartLaws exact = SomeLaws();
  std::mt19937 engine(7);
  std::lognormal_distribution<double> noise(0, 0.3);
  TimesOfPlans plans(2);
  for (const PictureLoad& load : loads) {
    for (const double factor : {1.0, 1.1}) {
      TimedLoad timed = exact.Timed(load);
      timed.seconds -= timed.parts.solve;
      timed.seconds *= 1 + noise(engine);
      timed.parts.solve *= factor;
      timed.seconds += timed.parts.solve;
      plans[factor == 1 ? 0 : 1].push_back(timed);
    }
  }
  const std::vector<TimeLaw> laws = FitTimeLaws(plans);
  for (const PictureLoad& load : Loads(20, 8)) {
    EXPECT_NEAR(laws[1].Seconds(load) - laws[0].Seconds(load), 0.1 * exact.solve.Seconds(load),
                1e-9);
  }
  EXPECT_EQ(LeftOutRatios(plans).size(), 2U);
  EXPECT_EQ(LeftOutRatios(plans)[1].size(), loads.size());
}

// A part has no terms that its work has not, even where they fit it.
TEST(TimeLaw, PartsHaveTheTermsOfTheirWorkAlone) {
  std::vector<TimedLoad> timed;
  for (const PictureLoad& load : Loads(20, 9)) {
    const double seconds = 0.1 + load.file_seconds;
    timed.push_back({load, seconds, {0, 0, seconds, 0}});
  }
  EXPECT_EQ(FitTimeLaws({timed}).front().coefficients()[TimeLaw::kFileSeconds], 0);
  for (TimedLoad& load : timed) load.parts = {0, 0, 0, load.seconds};
  EXPECT_NEAR(FitTimeLaws({timed}).front().coefficients()[TimeLaw::kFileSeconds], 1, 1e-9);
}

TEST(TimeLaw, RefusesWhatNoLawCanBeMadeFrom) {
  EXPECT_THROW(FitTimeLaws({{}}), Error);
  const std::vector<TimedLoad> good = SomeLaws().Timed(Loads(3, 5));
  EXPECT_THROW(FitTimeLaws({good, {good[0], good[1]}}), Error);
  const auto refuses = [&](const auto& spoil) {
    std::vector<TimedLoad> timed = good;
    spoil(&timed[1]);
    EXPECT_THROW(FitTimeLaws({good, timed}), Error);
  };
  refuses([](TimedLoad* timed) { timed->seconds = 0; });
  refuses([](TimedLoad* timed) { timed->parts.solve = 2 * timed->seconds; });
  refuses([](TimedLoad* timed) { timed->parts.solve = -1; });
  refuses([](TimedLoad* timed) { timed->parts.setup = std::nan(""); });
  refuses([](TimedLoad* timed) { timed->parts.read = -0.1; });
  // Each less than the whole, together more.
  refuses([](TimedLoad* timed) { timed->parts.files = timed->parts.setup = 0.6 * timed->seconds; });
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
