// Whole calibrations: a result that the frames contradict never has a small stated error.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "calib/registration/change_of_reference.h"
#include "calib/uncertainty/calibration_checks.h"
#include "tests/calib/calibrated_sweep.h"
#include "tests/calib/simulated_sweep.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/error_budget.h"

namespace thicklens::calib {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using thicklens::testing::CalibrateWithoutMap;
using thicklens::testing::GiveFloor;
using thicklens::testing::Simulate;
using thicklens::testing::SimulatedSweep;
using thicklens::testing::SweepCase;

SimulatedSweep Sweep(model::TargetKind target, model::Psf psf) {
  model::SweepSimulationOptions options = SweepCase("iii", 160, 12);
  options.target.kind = target;
  options.camera.psf = psf;
  SimulatedSweep simulated = Simulate(options);
  if (target == model::TargetKind::kKnifeEdge) {
    simulated.sweep.target = model::SweepTarget::kKnifeEdge;
  } else {
    GiveFloor(&simulated);
  }
  return simulated;
}

void ExpectCovers(const std::optional<Result>& result, double truth) {
  ASSERT_TRUE(result && result->systematic);
  EXPECT_LT(result->systematic->x() - 3 * result->sigma, truth);
  EXPECT_GT(result->systematic->y() + 3 * result->sigma, truth);
}

void ExpectCovers(const Calibration& c, const model::SweepTruth& truth) {
  ExpectCovers(c.summary.focus_depth_mm, truth.focus_depth_mm);
  ExpectCovers(c.summary.image_distance_mm, truth.image_distance_mm);
  ExpectCovers(c.summary.blur_ratio, truth.blur_ratio);
}

TEST(Contradiction, OfTheGivenOffsetWidensEverything) {
  SimulatedSweep s = Sweep(model::TargetKind::kDeadLeaves, model::Psf::kGaussian);
  const double truth_mm = s.sweep.offset_mm->value;
  s.sweep.offset_mm->value += 6;
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
  ExpectCovers(c, s.truth);
  EXPECT_LT(c.summary.bench_offset_mm->systematic->x(), truth_mm + 1);
  EXPECT_GT(c.summary.focus_depth_mm->systematic->y() - c.summary.focus_depth_mm->systematic->x(),
            5);
  EXPECT_THAT(c.diagnostics.advice, HasSubstr("given offset_mm"));
  EXPECT_THAT(c.summary.warnings, Contains(HasSubstr("from the given bench offset")));
}

TEST(Contradiction, OfTheGivenOffsetByTensOfMillimetresIsRefused) {
  SimulatedSweep s = Sweep(model::TargetKind::kDeadLeaves, model::Psf::kGaussian);
  s.sweep.offset_mm->value += 60;
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_EQ(c.summary.outcome, Outcome::kRefused);
  EXPECT_THAT(c.summary.reason,
              HasSubstr("check offset_mm, and that both offset_mm and the readings are in mm"));
  EXPECT_FALSE(c.summary.focus_depth_mm);
}

TEST(Contradiction, AJumpOfTheReadingsMovesTheZeroByMoreThanItself) {
  for (const bool offset_is_known : {false, true}) {
    SimulatedSweep s = Sweep(model::TargetKind::kDeadLeaves, model::Psf::kGaussian);
    const double truth_mm = s.sweep.offset_mm->value;
    if (!offset_is_known) s.sweep.offset_mm.reset();
    for (std::size_t i = 16; i < s.sweep.frames.size(); ++i) s.sweep.frames[i].reading_mm += 1.5;
    const Calibration c = CalibrateWithoutMap(s);
    ASSERT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
    EXPECT_THAT(c.summary.warnings, Contains(HasSubstr("the readings jump by +1.")));
    ExpectCovers(c, s.truth);
    if (offset_is_known) continue;
    ExpectCovers(c.summary.bench_offset_mm, truth_mm);
    EXPECT_THAT(c.diagnostics.advice, HasSubstr("jump of the readings"));
  }
}

TEST(Contradiction, ADiscThatIsStatedToBeAGaussianIsReported) {
  for (const auto target : {model::TargetKind::kDeadLeaves, model::TargetKind::kKnifeEdge}) {
    SimulatedSweep s = Sweep(target, model::Psf::kDisc);
    s.sweep.camera.psf = model::Psf::kGaussian;
    const Calibration c = CalibrateWithoutMap(s);
    ASSERT_TRUE(c.summary.blur_ratio) << c.summary.reason;
    ExpectCovers(c, s.truth);
    // The advice is about the largest term, of which the shape of the blur is one.
    EXPECT_THAT(c.diagnostics.advice, HasSubstr(TermInWords(ErrorTerms(c).front().name)));
    EXPECT_THAT(c.summary.warnings, Contains(HasSubstr("the blur is a disc, not the gaussian")));
  }
}

// The right shape is not doubted.
TEST(Contradiction, NoneWhereAllIsWell) {
  for (const auto psf : {model::Psf::kGaussian, model::Psf::kDisc}) {
    for (const auto target : {model::TargetKind::kDeadLeaves, model::TargetKind::kKnifeEdge}) {
      const SimulatedSweep s = Sweep(target, psf);
      const Calibration c = CalibrateWithoutMap(s);
      ASSERT_TRUE(c.summary.blur_ratio) << c.summary.reason;
      ExpectCovers(c, s.truth);
      EXPECT_THAT(c.diagnostics.advice, Not(HasSubstr("psf:")));
      EXPECT_THAT(c.summary.warnings, Not(Contains(HasSubstr("the blur is a"))));
    }
  }
}

// Points of the first frame are mapped to the new reference and from there to another frame.
TEST(ReferTo, ComposesTheRegistrations) {
  const auto make = [](double scale, double angle, double x, double y) {
    ScaleSample sample;
    sample.scale = scale;
    sample.registration.scale = scale;
    sample.registration.scale_x = scale;
    sample.registration.scale_y = scale;
    sample.registration.rotation_rad = angle;
    sample.registration.shift_px = {x, y};
    return sample;
  };
  const auto map = [](const Registration& r, const Eigen::Vector2d& p) -> Eigen::Vector2d {
    return r.shift_px + r.scale * (Eigen::Rotation2Dd(r.rotation_rad) * p);
  };
  const ScaleSample other = make(1.3, 0.2, 4, -7), reference = make(0.8, -0.1, 3, 5);
  std::vector<ScaleSample> samples = {other, reference};
  ReferTo(reference.registration, &samples);
  EXPECT_DOUBLE_EQ(samples[1].scale, 1);
  EXPECT_LT(samples[1].registration.shift_px.norm(), 1e-12);
  for (const Eigen::Vector2d& p : {Eigen::Vector2d(0, 0), Eigen::Vector2d(50, -20)}) {
    const Eigen::Vector2d through = map(samples[0].registration, map(reference.registration, p));
    EXPECT_LT((through - map(other.registration, p)).norm(), 1e-9);
  }
  EXPECT_DOUBLE_EQ(samples[0].scale, 1.3 / 0.8);
}

}  // namespace
}  // namespace thicklens::calib
