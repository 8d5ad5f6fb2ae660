#include "thicklens/calib/sweep_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "support/error_message.h"
#include "tests/calib/calibrate/planned_sweep.h"

namespace thicklens::calib {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using thicklens::testing::ErrorOf;
using thicklens::testing::PlanFor;

// Small frames, on which a plan takes little time.
PlanConditions Bench() {
  PlanConditions conditions = PlanFor("case-ii", 112, 300);
  conditions.reading_sigma_mm = 0.02;
  conditions.blur_floor_sigma_px = 0.02;
  conditions.offset_sigma_mm = 0.03;
  return conditions;
}

SweepDesign Design(const PlanConditions& conditions, int frames) {
  SweepDesign design;
  design.nearest_mm = 294;
  design.frames = frames;
  design.step_mm = 12.0 / (frames - 1);
  const double f1 = conditions.camera.lens.front_focal_length_mm;
  design.feature_size_mm =
      2 * conditions.camera.sensor.pixel_pitch_mm * (conditions.focus_depth_mm - f1) / f1;
  return design;
}

TEST(ExpectSweep, PartsAddUpAndFollowTheirSources) {
  PlanConditions conditions = Bench();
  const ExpectedSweep expected = ExpectSweep(conditions, Design(conditions, 15));
  ASSERT_TRUE(expected.done) << expected.message;
  double focus2 = 0, ratio2 = 0;
  std::vector<std::string> names;
  for (const PlannedErrorPart& part : expected.parts) {
    names.push_back(part.name);
    focus2 += std::pow(part.sigma.focus_depth_mm, 2);
    ratio2 += std::pow(part.sigma.blur_ratio, 2);
  }
  EXPECT_THAT(names, ElementsAre("bench offset", "blur floor", "readings", "noise"));
  EXPECT_NEAR(std::sqrt(focus2), expected.sigma.focus_depth_mm, 1e-6);
  EXPECT_NEAR(std::sqrt(ratio2), expected.sigma.blur_ratio, 1e-9);
  // An error of the zero moves the plane of focus as it moves all depths.
  EXPECT_NEAR(expected.parts[0].sigma.focus_depth_mm, 0.03, 0.001);
  // [D2] d1 = rho + f2 zf/(zf - f1).
  EXPECT_NEAR(expected.sigma.image_distance_mm / expected.sigma.focus_depth_mm,
              50.0 * 50 / (250.0 * 250), 1e-6);
  // [D73] dzf = zf dS0/(A uf^2), A uf^2 = (kappa r f1/(p (zf - f1)))^2, dS0 = 2 floor sigma.
  const double r = conditions.camera.lens.aperture_radius_mm;
  const double slope_px = 0.45 * r * 50 / (conditions.camera.sensor.pixel_pitch_mm * 250);
  EXPECT_NEAR(expected.parts[1].sigma.focus_depth_mm, 300 * 2 * 0.5 * 0.02 / (slope_px * slope_px),
              1e-5);
  conditions.blur_floor_sigma_px.reset();
  const ExpectedSweep open = ExpectSweep(conditions, Design(conditions, 15));
  EXPECT_EQ(open.parts.size(), 3U);
  EXPECT_NEAR(open.floor_interval.focus_depth_mm, 300 * 0.5 / (slope_px * slope_px), 1e-6);
}

TEST(ExpectSweep, FourTimesTheFramesHalveTheErrorsOfNoiseAndReadings) {
  PlanConditions conditions = Bench();
  conditions.offset_sigma_mm = 0;
  conditions.blur_floor_sigma_px = 0;
  const ExpectedSweep few = ExpectSweep(conditions, Design(conditions, 13));
  const ExpectedSweep many = ExpectSweep(conditions, Design(conditions, 49));
  ASSERT_TRUE(few.done && many.done);
  EXPECT_NEAR(few.sigma.focus_depth_mm / many.sigma.focus_depth_mm, 2, 0.25);
  EXPECT_NEAR(few.sigma.blur_ratio / many.sigma.blur_ratio, 2, 0.35);
}

TEST(ExpectSweep, NoiseAndContrastCountByTheirRatio) {
  PlanConditions conditions = Bench();
  conditions.offset_sigma_mm = 0;
  conditions.blur_floor_sigma_px = 0;
  conditions.reading_sigma_mm = 0;
  conditions.bits = 16;
  conditions.noise_sigma = 0.002;
  const ExpectedSweep quiet = ExpectSweep(conditions, Design(conditions, 13));
  conditions.noise_sigma = 0.004;
  const ExpectedSweep noisy = ExpectSweep(conditions, Design(conditions, 13));
  conditions.contrast *= 0.5;
  conditions.noise_sigma = 0.002;
  const ExpectedSweep pale = ExpectSweep(conditions, Design(conditions, 13));
  ASSERT_TRUE(quiet.done && noisy.done && pale.done);
  EXPECT_NEAR(noisy.sigma.focus_depth_mm / quiet.sigma.focus_depth_mm, 2, 0.2);
  EXPECT_NEAR(pale.sigma.focus_depth_mm / noisy.sigma.focus_depth_mm, 1, 0.02);
}

TEST(ExpectSweep, ScaleDeterminesTheOffsetWhereNoneIsStated) {
  PlanConditions conditions = PlanFor("case-iii", 112, 400);
  conditions.offset_sigma_mm.reset();
  SweepDesign design;
  design.nearest_mm = 330;
  design.step_mm = 10;
  design.frames = 15;
  design.feature_size_mm = 0.4;
  const ExpectedSweep expected = ExpectSweep(conditions, design);
  ASSERT_TRUE(expected.done) << expected.message;
  EXPECT_TRUE(expected.offset_from_scale);
  EXPECT_GT(expected.offset_sigma_mm, 0.05);
  EXPECT_LT(expected.scatter.focus_depth_mm, expected.sigma.focus_depth_mm);
  conditions.offset_sigma_mm = 0.01;
  EXPECT_FALSE(ExpectSweep(conditions, design).offset_from_scale);
}

TEST(PlanSweep, ReachesWhatIsWantedWithFewFrames) {
  const PlanConditions conditions = Bench();
  PlanWishes wishes;
  wishes.focus_depth_mm = 0.035;
  wishes.feature_size_mm = Design(conditions, 9).feature_size_mm;
  const SweepPlan plan = PlanSweep(conditions, wishes);
  EXPECT_TRUE(plan.reached) << plan.reason;
  EXPECT_THAT(plan.reason, IsEmpty());
  EXPECT_LE(plan.expected.sigma.focus_depth_mm, 0.035);
  EXPECT_LT(plan.expected.design.frames, 31);
  EXPECT_LT(plan.expected.design.nearest_mm, 300);
  EXPECT_GT(plan.expected.design.farthest_mm(), 300);
  // The field at the farthest frame: width px p (z - ..)/f1 of the chief rays, with a margin.
  const double px_mm =
      conditions.camera.sensor.pixel_pitch_mm * 250 / 50 * plan.expected.design.farthest_mm() / 300;
  EXPECT_NEAR(plan.target_width_mm, 1.1 * 112 * px_mm, 1e-6);
  EXPECT_THAT(plan.advice, HasSubstr("would help most"));
}

TEST(PlanSweep, SaysWhatImpossibleWishesWouldNeed) {
  PlanConditions conditions = Bench();
  PlanWishes wishes;
  wishes.focus_depth_mm = 0.02;  // less than the error of the bench offset alone
  wishes.feature_size_mm = Design(conditions, 9).feature_size_mm;
  wishes.most_frames = 40;
  const SweepPlan plan = PlanSweep(conditions, wishes);
  EXPECT_FALSE(plan.reached);
  EXPECT_GT(plan.expected.sigma.focus_depth_mm, 0.03);
  EXPECT_THAT(plan.reason, HasSubstr("not 0.02 mm; needed would be a stated bench offset that is "
                                     "known to 0.0"));
  EXPECT_THAT(plan.advice, HasSubstr("is that of the bench offset"));
  // The wish is reached with what is said to be needed.
  const auto at = plan.reason.find("known to ");
  conditions.offset_sigma_mm = std::stod(plan.reason.substr(at + 9));
  EXPECT_TRUE(PlanSweep(conditions, wishes).reached);
}

TEST(PlanSweep, WarnsOfACoarseTextureAndOfClippedLight) {
  PlanConditions conditions = Bench();
  conditions.light_level = 0.8;
  PlanWishes wishes;
  wishes.frames = 11;
  wishes.feature_size_mm = 20 * Design(conditions, 9).feature_size_mm;
  const SweepPlan plan = PlanSweep(conditions, wishes);
  EXPECT_THAT(plan.warnings, ::testing::Contains(HasSubstr("the texture is too coarse")));
  EXPECT_THAT(plan.warnings, ::testing::Contains(HasSubstr("keeps it from clipping")));
}

TEST(PlanSweep, WarnsOfAnUndersampledLens) {
  PlanConditions conditions = Bench();
  conditions.blur_floor_px = 0.1;
  PlanWishes wishes;
  wishes.frames = 11;
  wishes.nearest_mm = 294;
  wishes.farthest_mm = 306;
  wishes.feature_size_mm = Design(conditions, 9).feature_size_mm;
  EXPECT_THAT(PlanSweep(conditions, wishes).warnings,
              ::testing::Contains(HasSubstr("undersamples")));
  conditions.blur_floor_px = 0.6;
  EXPECT_THAT(PlanSweep(conditions, wishes).warnings,
              ::testing::Not(::testing::Contains(HasSubstr("undersamples"))));
}

TEST(PlanSweep, SaysThatAnOffsetOfTheImageScaleIsPredictedLessExactly) {
  PlanConditions conditions = PlanFor("case-iii", 112, 400);
  PlanWishes wishes;
  wishes.frames = 11;
  wishes.nearest_mm = 330;
  wishes.farthest_mm = 470;
  wishes.feature_size_mm = 0.4;
  const std::string text = "predicted less exactly";
  EXPECT_THAT(PlanSweep(conditions, wishes).warnings,
              ::testing::Not(::testing::Contains(HasSubstr(text))));
  conditions.offset_sigma_mm.reset();
  EXPECT_THAT(PlanSweep(conditions, wishes).warnings, ::testing::Contains(HasSubstr(text)));
}

TEST(PlanSweep, RefusesWhatCannotBePlanned) {
  const PlanConditions good = Bench();
  PlanWishes wishes;
  wishes.nearest_mm = 40;
  wishes.farthest_mm = 320;
  EXPECT_THAT(ErrorOf([&] { PlanSweep(good, wishes); }), HasSubstr("inside the focal length"));
  PlanConditions conditions = good;
  conditions.focus_depth_mm = 50;
  EXPECT_THAT(ErrorOf([&] { PlanSweep(conditions, {}); }),
              HasSubstr("focus_depth_mm is 50: it must be beyond the focal length of 50 mm"));
  conditions = good;
  conditions.contrast = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(ErrorOf([&] { PlanSweep(conditions, {}); }), HasSubstr("contrast is nan"));
  conditions = good;
  conditions.texture = model::TargetKind::kCheckerboard;
  EXPECT_THAT(ErrorOf([&] { PlanSweep(conditions, {}); }), HasSubstr("only dead-leaves"));
  conditions = good;
  conditions.noise_sigma = 0.9;
  EXPECT_THAT(ErrorOf([&] { PlanSweep(conditions, {}); }), HasSubstr("no sweep has a result"));
  wishes = {};
  wishes.blur_ratio = -1;
  EXPECT_THAT(ErrorOf([&] { PlanSweep(good, wishes); }), HasSubstr("blur_ratio is -1"));
  wishes = {};
  wishes.frames = 4;
  EXPECT_THAT(ErrorOf([&] { PlanSweep(good, wishes); }), HasSubstr("frames is 4"));
  wishes = {};
  wishes.nearest_mm = 100;
  EXPECT_THAT(ErrorOf([&] { PlanSweep(good, wishes); }), HasSubstr("must be given together"));
}

}  // namespace
}  // namespace thicklens::calib
