// A planned sweep reaches the errors that the plan predicts: the scatter of simulated and
// calibrated sweeps is the predicted one.
#include "tests/calib/calibrate/planned_sweep.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace thicklens::calib {
namespace {

using thicklens::testing::PlanFor;
using thicklens::testing::SimulatedErrors;
using thicklens::testing::StandardDeviation;
using thicklens::testing::SweepErrors;

constexpr int kSweeps = 400;
constexpr double kWithin = 0.15;

void ExpectReached(const PlanConditions& conditions, const PlanWishes& wishes, int sweeps,
                   double within) {
  const SweepPlan plan = PlanSweep(conditions, wishes);
  ASSERT_TRUE(plan.reached) << plan.reason;
  const SweepErrors errors = SimulatedErrors(conditions, plan.expected.design, sweeps, 9000);
  EXPECT_EQ(errors.refusals.size(), 0U) << errors.refusals.front();
  const PlannedErrors& predicted = plan.expected.scatter;
  const auto compare = [&](const char* name, const std::vector<double>& sample, double sigma) {
    const double ratio = StandardDeviation(sample) / sigma;
    EXPECT_NEAR(ratio, 1, within) << name << ": predicted " << sigma;
    ::testing::Test::RecordProperty(name, std::to_string(ratio));
  };
  compare("focus_depth_mm", errors.focus_depth_mm, predicted.focus_depth_mm);
  compare("image_distance_mm", errors.image_distance_mm, predicted.image_distance_mm);
  compare("blur_ratio", errors.blur_ratio, predicted.blur_ratio);
}

PlanWishes Frames(int count) {
  PlanWishes wishes;
  wishes.frames = count;
  return wishes;
}

// Magnification 0.2, dead leaves, shot noise, an offset and a floor that are known roughly.
PlanConditions Usual() {
  PlanConditions conditions = PlanFor("case-ii", 96, 300);
  conditions.reading_sigma_mm = 0.03;
  conditions.blur_floor_sigma_px = 0.02;
  conditions.offset_sigma_mm = 0.02;
  return conditions;
}

TEST(PlannedSweep, ScatterIsAboutThePredictedOne) {
  constexpr int kFew = 16;
  constexpr double kChance = 0.55;  // three standard deviations of a standard deviation
  ExpectReached(Usual(), Frames(9), kFew, kChance);
}

TEST(PlannedSweepSlow, OfDeadLeavesReachesItsErrors) {
  ExpectReached(Usual(), Frames(11), kSweeps, kWithin);
}

// A thick lens, twice the noise, and a texture without large detail.
TEST(PlannedSweepSlow, OfWhiteNoiseReachesItsErrors) {
  PlanConditions conditions = PlanFor("case-iii", 96, 400);
  conditions.texture = model::TargetKind::kWhiteNoise;
  conditions.full_well_electrons = 2500;
  conditions.reading_sigma_mm = 0.05;
  ExpectReached(conditions, Frames(9), kSweeps, kWithin);
}

// Life size, low contrast.
TEST(PlannedSweepSlow, AtLifeSizeReachesItsErrors) {
  PlanConditions conditions = PlanFor("case-ii", 96, 100);
  conditions.texture = model::TargetKind::kPinkNoise;
  conditions.contrast = 0.4;
  conditions.reading_sigma_mm = 0.005;
  conditions.offset_sigma_mm = 0.05;
  ExpectReached(conditions, Frames(13), kSweeps, kWithin);
}

// The bench offset comes from the image scale: its error is the largest. Here the prediction is
// less accurate than with a stated offset: 400 sweeps scatter by 1.10 (zf) and 1.22 (kappa) of it.
// The errors of the offset and of the blur are taken as independent, which may or may not be the
// reason.
TEST(PlannedSweepSlow, WithoutAnOffsetIsNearItsErrors) {
  PlanConditions conditions = PlanFor("case-iii", 112, 400);
  conditions.reading_sigma_mm = 0.05;
  conditions.offset_sigma_mm.reset();
  PlanWishes wishes = Frames(15);
  wishes.nearest_mm = 320;
  wishes.farthest_mm = 480;
  constexpr double kWithinOfScale = 0.3;
  ExpectReached(conditions, wishes, kSweeps, kWithinOfScale);
}

}  // namespace
}  // namespace thicklens::calib
