// How long an estimate takes, from few measured ones.
#include "thicklens/estimator/time_model.h"

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
#include "thicklens/estimator/estimate_input.h"

namespace thicklens::estimator {
namespace {

using ::testing::DoubleNear;
using ::testing::Each;
using ::testing::ElementsAre;

std::vector<Workload> Loads(int count, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> megapixels(0.01, 0.3), blur(0.03, 3), files(0, 1);
  std::uniform_int_distribution<int> across(1, 4), colour(0, 1);
  std::vector<Workload> loads;
  for (int i = 0; i < count; ++i) {
    const int views = 2 * across(engine) + 1;
    loads.push_back({megapixels(engine), colour(engine) == 1 ? 3 : 1, views * views, blur(engine),
                     files(engine)});
  }
  return loads;
}

// A law for each part of a run, of terms that such work has.
struct PartLaws {
  TimeModel setup, solve, files, rest;

  // Reading takes what it takes, which no law knows.
  TimedWorkload Timed(const Workload& load) const {
    const PartSeconds parts = {0.1 + std::fmod(1000 * load.blur_sigma_px, 1), setup.Seconds(load),
                               solve.Seconds(load), files.Seconds(load)};
    return {load, parts.read + parts.setup + parts.solve + parts.files + rest.Seconds(load), parts};
  }
  std::vector<TimedWorkload> Timed(const std::vector<Workload>& loads) const {
    std::vector<TimedWorkload> timed;
    for (const Workload& load : loads) timed.push_back(Timed(load));
    return timed;
  }
  TimeModel::Terms Sum() const {
    return setup.coefficients() + solve.coefficients() + files.coefficients() + rest.coefficients();
  }
};

TimeModel LawOf(const std::map<TimeModel::Term, double>& coefficients) {
  TimeModel::Terms terms = TimeModel::Terms::Zero();
  for (const auto& [term, coefficient] : coefficients) terms[term] = coefficient;
  return TimeModel(terms);
}

PartLaws SomeLaws() {
  using Law = TimeModel;
  return {LawOf({{Law::kStart, 0.01}, {Law::kPixels, 0.1}, {Law::kPixelsViewsBlur, 0.007}}),
          LawOf({{Law::kPixelsChannels, 0.06},
                 {Law::kPixelsChannelsBlur, 0.02},
                 {Law::kPixelsViewsChannelsIterations, 0.15},
                 {Law::kPixelsChannelsIterations, 0.08},
                 {Law::kPixelsViewsBlurArea, 0.003}}),
          LawOf({{Law::kViews, 0.0006}, {Law::kPixelsViews, 0.01}, {Law::kFileSeconds, 0.55}}),
          LawOf({{Law::kPixels, 0.02}, {Law::kPixelsViewsChannels, 0.003}})};
}

TEST(TimeModel, IsFoundAgainFromExactTimes) {
  const PartLaws laws = SomeLaws();
  const TimeModel found = FitTimeModels({laws.Timed(Loads(30, 1))}).front();
  EXPECT_LT((found.coefficients() - laws.Sum()).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_THAT(LeftOutRatios({laws.Timed(Loads(20, 2))}), ElementsAre(Each(DoubleNear(1, 1e-6))));
}

// The expected terms are computed by hand for 2 megapixels in three channels, 5 x 5 views, a blur
// of 3 px and files of 4 s.
TEST(TimeModel, IsTheSumOfItsTerms) {
  const std::map<TimeModel::Term, double> of_one = {
      {TimeModel::kStart, 1},
      {TimeModel::kPixels, 2},
      {TimeModel::kPixelsChannels, 6},
      {TimeModel::kPixelsViews, 50},
      {TimeModel::kPixelsViewsChannels, 150},
      {TimeModel::kPixelsChannelsBlur, 18},
      {TimeModel::kPixelsViewsBlur, 150},
      {TimeModel::kFileSeconds, 4},
      {TimeModel::kViews, 25},
      {TimeModel::kPixelsViewsChannelsIterations, 112.5},
      {TimeModel::kPixelsChannelsIterations, 5.625},
      {TimeModel::kPixelsViewsBlurArea, 450}};
  ASSERT_EQ(of_one.size(), static_cast<std::size_t>(TimeModel::kTerms));
  for (const auto& [term, seconds] : of_one) {
    EXPECT_DOUBLE_EQ(LawOf({{term, 1}}).Seconds({2, 3, 25, 3, 4}), seconds) << term;
  }
}

// The oracle: no law without negative terms near it has a smaller error.
TEST(TimeModel, IsTheBestWithoutNegativeTerms) {
  constexpr std::array kTermsOfSolving = {TimeModel::kStart,
                                          TimeModel::kPixels,
                                          TimeModel::kPixelsChannels,
                                          TimeModel::kPixelsViews,
                                          TimeModel::kPixelsChannelsBlur,
                                          TimeModel::kPixelsViewsBlur,
                                          TimeModel::kPixelsViewsChannelsIterations,
                                          TimeModel::kPixelsChannelsIterations,
                                          TimeModel::kPixelsViewsBlurArea};
  std::vector<TimedWorkload> timed;
  std::mt19937 engine(4);
  std::lognormal_distribution<double> noise(0, 0.5);
  for (const Workload& load : Loads(12, 3)) {
    const double seconds = (0.02 + SomeLaws().solve.Seconds(load)) * noise(engine);
    timed.push_back({load, seconds, {0, 0, seconds, 0}});
  }
  const auto error = [&](const TimeModel& law) {
    double sum = 0;
    for (const TimedWorkload& load : timed) {
      sum += std::pow(law.Seconds(load.load) / load.seconds - 1, 2);
    }
    return sum;
  };
  const TimeModel found = FitTimeModels({timed}).front();
  EXPECT_GE(found.coefficients().minCoeff(), 0);
  int zeros = 0;  // a plain fit would go below
  for (const TimeModel::Term term : kTermsOfSolving)
    zeros += found.coefficients()[term] == 0 ? 1 : 0;
  EXPECT_GE(zeros, 1);
  std::normal_distribution<double> step(0, 1);
  for (int i = 0; i < 20000; ++i) {
    const double size = std::pow(10, -1 - i % 5);
    TimeModel::Terms other = found.coefficients();
    for (const TimeModel::Term term : kTermsOfSolving) {
      other[term] = std::max(0.0, other[term] + size * step(engine));
    }
    ASSERT_GE(error(TimeModel(other)), error(found) * (1 - 1e-9));
  }
}

// Costs that plans have in common do not distinguish them, however noisy the costs are.
TEST(TimeModel, PlansDifferByWhatTheySolveAlone) {
  const std::vector<Workload> loads = Loads(15, 6);
  const PartLaws exact = SomeLaws();
  std::mt19937 engine(7);
  std::lognormal_distribution<double> noise(0, 0.3);
  TimesOfPlans plans(2);
  for (const Workload& load : loads) {
    for (const double factor : {1.0, 1.1}) {
      TimedWorkload timed = exact.Timed(load);
      timed.seconds -= timed.parts.solve;
      timed.seconds *= 1 + noise(engine);
      timed.parts.solve *= factor;
      timed.seconds += timed.parts.solve;
      plans[factor == 1 ? 0 : 1].push_back(timed);
    }
  }
  const std::vector<TimeModel> laws = FitTimeModels(plans);
  for (const Workload& load : Loads(20, 8)) {
    EXPECT_NEAR(laws[1].Seconds(load) - laws[0].Seconds(load), 0.1 * exact.solve.Seconds(load),
                1e-9);
  }
  EXPECT_EQ(LeftOutRatios(plans).size(), 2U);
  EXPECT_EQ(LeftOutRatios(plans)[1].size(), loads.size());
}

// A part has no terms that its work has not, even where they fit it.
TEST(TimeModel, PartsHaveTheTermsOfTheirWorkAlone) {
  std::vector<TimedWorkload> timed;
  for (const Workload& load : Loads(20, 9)) {
    const double seconds = 0.1 + load.file_seconds;
    timed.push_back({load, seconds, {0, 0, seconds, 0}});
  }
  EXPECT_EQ(FitTimeModels({timed}).front().coefficients()[TimeModel::kFileSeconds], 0);
  for (TimedWorkload& load : timed) load.parts = {0, 0, 0, load.seconds};
  EXPECT_NEAR(FitTimeModels({timed}).front().coefficients()[TimeModel::kFileSeconds], 1, 1e-9);
}

TEST(TimeModel, RefusesWhatNoModelCanBeMadeFrom) {
  EXPECT_THROW(FitTimeModels({{}}), Error);
  const std::vector<TimedWorkload> good = SomeLaws().Timed(Loads(3, 5));
  EXPECT_THROW(FitTimeModels({good, {good[0], good[1]}}), Error);
  const auto refuses = [&](const auto& spoil) {
    std::vector<TimedWorkload> timed = good;
    spoil(&timed[1]);
    EXPECT_THROW(FitTimeModels({good, timed}), Error);
  };
  refuses([](TimedWorkload* timed) { timed->seconds = 0; });
  refuses([](TimedWorkload* timed) { timed->parts.solve = 2 * timed->seconds; });
  refuses([](TimedWorkload* timed) { timed->parts.solve = -1; });
  refuses([](TimedWorkload* timed) { timed->parts.setup = std::nan(""); });
  refuses([](TimedWorkload* timed) { timed->parts.read = -0.1; });
  // Each less than the whole, together more.
  refuses(
      [](TimedWorkload* timed) { timed->parts.files = timed->parts.setup = 0.6 * timed->seconds; });
}

// An image of which each point is seen at the same disparity.
EstimateInput Flat(int u_count, int v_count, float disparity) {
  EstimateInput input;
  input.image = model::LinearImage{40, 30, 3, std::vector<float>(40 * 30 * 3, 0.5F)};
  input.disparity.width_px = 40;
  input.disparity.height_px = 30;
  input.disparity.disparity.assign(40 * 30, disparity);
  input.weights = Eigen::ArrayXXd::Constant(v_count, u_count, 1.0 / (u_count * v_count));
  return input;
}

TEST(Workload, HasTheBlurOfEqualViews) {
  const Workload load = WorkloadOf(Flat(5, 5, 0.8F), 0.25);
  EXPECT_DOUBLE_EQ(load.megapixels, 0.0012);
  EXPECT_EQ(load.channels, 3);
  EXPECT_EQ(load.views, 25);
  EXPECT_EQ(load.file_seconds, 0.25);
  // The variance of five equal places is two.
  EXPECT_NEAR(load.blur_sigma_px, 0.8 * std::sqrt(2.0), 1e-6);
  // Along one axis alone, half of it in the mean of both.
  EXPECT_NEAR(WorkloadOf(Flat(5, 1, 0.8F), 0).blur_sigma_px, 0.8, 1e-6);
}

}  // namespace
}  // namespace thicklens::estimator
