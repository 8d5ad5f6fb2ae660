// Causes of the readings' errors, on scales and blurs that are computed from the law with noise.
#include "calib/registration/stage_comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <vector>

namespace thicklens::calib {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;

// A made-up sweep in the order of exposure, with the right readings and what the frames show.
struct Bench {
  FocusSweep sweep;
  Eigen::VectorXd right_mm, error_mm;
  ReadingEvidence scales, blur;
};

enum class Order { kOneWay, kThereAndBack, kTwice };

// 42 frames, 1 mm apart from 100 mm on, whose target is 300 mm farther away. `error` is added to
// the readings: a function of the right reading, the frame, and whether it is approached by falling
// readings. The blur's vertex is at 118 mm.
Bench MakeBench(Order order, unsigned seed, double sigma_mm,
                const std::function<double(double, int, bool)>& error) {
  constexpr int kFrames = 42;
  std::mt19937 engine(seed);
  std::normal_distribution<double> normal;
  Bench bench;
  bench.right_mm.resize(kFrames);
  bench.error_mm.resize(kFrames);
  bench.scales.values.resize(kFrames);
  bench.blur.values.resize(kFrames);
  bench.scales.sigmas = Eigen::VectorXd::Constant(kFrames, 2e-5);
  bench.blur.sigmas = Eigen::VectorXd::Constant(kFrames, 0.05);
  bench.blur.is_parabola_in_reading = true;
  const int turn = order == Order::kOneWay ? kFrames : order == Order::kTwice ? 11 : 21;
  for (int i = 0; i < kFrames; ++i) {
    const int run = i / turn, within = i % turn;
    const bool is_back = run % 2 == 1;
    const int steps = (is_back ? turn - 1 - within : within) * (order == Order::kOneWay ? 1 : 2);
    const double right = 100 + steps + (is_back ? -0.5 : 0);
    bench.right_mm[i] = right;
    bench.error_mm[i] = error(right, i, is_back);
    const double written = right + bench.error_mm[i] + sigma_mm * normal(engine);
    bench.sweep.frames.push_back({"frame-" + std::to_string(i) + ".png", written});
    bench.scales.frames.push_back(static_cast<std::size_t>(i));
    bench.blur.frames.push_back(static_cast<std::size_t>(i));
    bench.scales.values[i] = (300 + right) / 418 + 2e-5 * normal(engine);
    bench.blur.values[i] = 0.3 + 0.05 * std::pow(right - 118, 2) + 0.05 * normal(engine);
  }
  return bench;
}

double NoError(double /*right*/, int /*frame*/, bool /*back*/) { return 0; }

// The share of the frames' error that is left after the correction, about its mean.
double Left(const Bench& bench, const StageComparison& found) {
  const Eigen::ArrayXd left = (bench.error_mm - found.error_mm).array();
  return (left - left.mean()).matrix().norm() /
         (bench.error_mm.array() - bench.error_mm.mean()).matrix().norm();
}

TEST(StageComparison, AGoodStageHasNoError) {
  int named = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    for (const Order order : {Order::kOneWay, Order::kThereAndBack, Order::kTwice}) {
      const Bench bench = MakeBench(order, seed, 0.05, NoError);
      for (const ReadingEvidence* evidence : {&bench.scales, &bench.blur}) {
        const StageComparison found = CompareStageErrors(*evidence, bench.sweep);
        ASSERT_TRUE(found.errors.compared);
        named += !found.errors.InWords().empty();
      }
    }
  }
  // 240 comparisons at odds of 20.
  EXPECT_LE(named, 3);
}

TEST(StageComparison, BacklashIsFoundWithItsError) {
  int covered = 0, runs = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    for (const Order order : {Order::kThereAndBack, Order::kTwice}) {
      const Bench bench =
          MakeBench(order, seed, 0.05, [](double, int, bool back) { return back ? 0.3 : 0.0; });
      for (const ReadingEvidence* evidence : {&bench.scales, &bench.blur}) {
        const StageComparison found = CompareStageErrors(*evidence, bench.sweep);
        ASSERT_TRUE(found.errors.backlash_mm) << found.errors.InWords();
        EXPECT_FALSE(found.errors.slip_mm || found.errors.periodic) << found.errors.InWords();
        EXPECT_THAT(found.errors.InWords(), HasSubstr("backlash"));
        covered +=
            std::abs(found.errors.backlash_mm->value - 0.3) < 2 * found.errors.backlash_mm->sigma;
        ++runs;
        EXPECT_LT(Left(bench, found), 0.35);
      }
    }
  }
  EXPECT_GE(covered, runs * 85 / 100);
}

TEST(StageComparison, APeriodicErrorIsFoundWithItsPeriod) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    for (const Order order : {Order::kOneWay, Order::kTwice}) {
      const Bench bench = MakeBench(order, seed, 0.03, [](double right, int, bool) {
        return 0.2 * std::sin(2 * 3.14159265358979 * right / 5 + 1);
      });
      for (const ReadingEvidence* evidence : {&bench.scales, &bench.blur}) {
        const StageComparison found = CompareStageErrors(*evidence, bench.sweep);
        ASSERT_TRUE(found.errors.periodic) << found.errors.InWords();
        const PeriodicError& error = *found.errors.periodic;
        EXPECT_NEAR(error.period_mm.value, 5, 4 * error.period_mm.sigma + 1e-3);
        EXPECT_NEAR(error.amplitude_mm.value, 0.2, 4 * error.amplitude_mm.sigma);
        EXPECT_FALSE(found.errors.backlash_mm || found.errors.slip_mm);
        EXPECT_LT(Left(bench, found), 0.4) << found.errors.InWords();
      }
    }
  }
}

TEST(StageComparison, LostStepsInTheOrderOfTheFramesAreNoBacklash) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const Bench bench = MakeBench(Order::kTwice, seed, 0.05,
                                  [](double, int i, bool) { return i >= 15 ? 0.4 : 0.0; });
    const StageComparison found = CompareStageErrors(bench.scales, bench.sweep);
    ASSERT_TRUE(found.errors.slip_mm) << found.errors.InWords();
    EXPECT_NEAR(found.errors.slip_mm->value, 0.4, 4 * found.errors.slip_mm->sigma);
    EXPECT_NEAR(found.errors.slip_from_frame, 15, 1);
    EXPECT_FALSE(found.errors.backlash_mm);
  }
}

TEST(StageComparison, AJumpOfAOneWaySweepIsLeftToItsOwnCheck) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const Bench bench = MakeBench(Order::kOneWay, seed, 0.05,
                                  [](double, int i, bool) { return i >= 17 ? 0.5 : 0.0; });
    const StageComparison found = CompareStageErrors(bench.scales, bench.sweep);
    EXPECT_TRUE(found.may_be_jump);
    EXPECT_FALSE(found.errors.Corrected()) << found.errors.InWords();
  }
}

TEST(StageComparison, ABendIsNoErrorOfTheStage) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    for (const Order order : {Order::kOneWay, Order::kThereAndBack}) {
      const Bench bench = MakeBench(order, seed, 0.03, [](double right, int, bool) {
        return 0.6 * std::pow((right - 120) / 20, 3);
      });
      const StageComparison found = CompareStageErrors(bench.scales, bench.sweep);
      EXPECT_FALSE(found.errors.Corrected()) << found.errors.InWords();
    }
  }
}

TEST(StageComparison, BacklashAndAScrewAreFoundTogether) {
  const Bench bench = MakeBench(Order::kTwice, 3, 0.02, [](double right, int, bool back) {
    return (back ? 0.4 : 0.0) + 0.15 * std::sin(2 * 3.14159265358979 * right / 6.2);
  });
  const StageComparison found = CompareStageErrors(bench.scales, bench.sweep);
  ASSERT_TRUE(found.errors.backlash_mm && found.errors.periodic) << found.errors.InWords();
  EXPECT_LT(Left(bench, found), 0.25) << found.errors.InWords();
}

// Five rows are wrong by millimetres.
TEST(StageComparison, WrongRowsDecideNothing) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const Bench bench = MakeBench(Order::kTwice, seed, 0.05, [](double, int i, bool back) {
      return (i % 9 == 4 ? 3.0 : 0.0) + (back ? 0.3 : 0.0);
    });
    const StageComparison found = CompareStageErrors(bench.scales, bench.sweep);
    ASSERT_TRUE(found.errors.backlash_mm) << seed << found.errors.InWords();
    EXPECT_NEAR(found.errors.backlash_mm->value, 0.3, 5 * found.errors.backlash_mm->sigma);
    EXPECT_FALSE(found.errors.periodic || found.errors.slip_mm) << found.errors.InWords();
  }
}

// Steps that are lost at the only turn look like backlash.
TEST(StageComparison, ASlipAtTheTurnIsNamedBesideBacklash) {
  int together = 0;
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const Bench bench = MakeBench(Order::kThereAndBack, seed, 0.05,
                                  [](double, int i, bool) { return i >= 21 ? 0.3 : 0.0; });
    const StageComparison found = CompareStageErrors(bench.scales, bench.sweep);
    ASSERT_TRUE(found.errors.Corrected());
    together += found.errors.InWords().find("lost steps") != std::string::npos;
  }
  EXPECT_EQ(together, 10);
}

TEST(StageComparison, ShuffledReadingsShowNothing) {
  Bench bench = MakeBench(Order::kOneWay, 2, 0.05, NoError);
  std::vector<model::SweepFrame> shuffled = bench.sweep.frames;
  for (std::size_t i = 0; i < shuffled.size(); ++i)
    shuffled[i].reading_mm = bench.sweep.frames[(i * 17) % shuffled.size()].reading_mm;
  bench.sweep.frames = shuffled;
  EXPECT_EQ(CompareStageErrors(bench.scales, bench.sweep).errors.InWords(), "");
}

TEST(ApproachedFalling, FollowsTheRunsAndForgivesAWrongRow) {
  Eigen::VectorXd readings(10);
  readings << 1, 2, 3, 9, 5, 6, 5, 4, 3, 2;
  EXPECT_THAT(ApproachedFalling(readings), ::testing::ElementsAre(false, false, false, false, false,
                                                                  false, true, true, true, true));
}

// A correction that the scales see is confirmed or contradicted by them, and one that is far below
// their errors is neither.
TEST(ScalesContradict, OnlyACorrectionThatTheyWouldSee) {
  const auto contradicts = [](double sigma_mm, double error_mm, double corrected_mm) {
    std::mt19937 engine(11);
    std::normal_distribution<double> normal;
    std::vector<ScaleSample> samples;
    Eigen::VectorXd before(31), after(31);
    for (int i = 0; i < 31; ++i) {
      const double wave = std::sin(2 * 3.14159265358979 * i / 7.0);
      ScaleSample sample;
      sample.frame = static_cast<std::size_t>(i);
      sample.scale = 315 / (300.0 + i);
      samples.push_back(sample);
      before[i] = i + error_mm * wave + sigma_mm * normal(engine);
      after[i] = before[i] - corrected_mm * wave;
    }
    return ScalesContradict(samples, before, after);
  };
  EXPECT_FALSE(contradicts(0.05, 0.1, 0.1)) << "a true error";
  EXPECT_TRUE(contradicts(0.05, 0, 0.1)) << "an error that is none";
  EXPECT_TRUE(contradicts(0.05, 0.1, -0.1)) << "the wrong direction";
  EXPECT_FALSE(contradicts(2, 0.05, 0.05));
  EXPECT_FALSE(contradicts(2, 0, 0.05)) << "the scales do not see it";
}

}  // namespace
}  // namespace thicklens::calib
