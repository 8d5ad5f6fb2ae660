// The measurement that is proposed after a calibration.
#include "thicklens/calib/next_measurement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "tests/calib/simulated_sweep.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/error_budget.h"

namespace thicklens::calib {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;
using thicklens::testing::GiveFloor;
using thicklens::testing::Simulate;
using thicklens::testing::SimulatedSweep;
using thicklens::testing::SweepCase;
using thicklens::testing::SweepWithFloor;

Calibration CalibrateWithoutMap(const FocusSweep& sweep) {
  CalibrationOptions options;
  options.map_field = false;
  return Calibrate(sweep, options);
}

// The advice, the table and the proposal are about the same term.
void ExpectAgreement(const Calibration& c, const NextMeasurement& next) {
  const std::vector<ErrorTerm> terms = ErrorTerms(c);
  ASSERT_FALSE(terms.empty());
  std::size_t chosen = 0;
  while (chosen < terms.size() && HasNoRemedy(terms[chosen])) ++chosen;
  ASSERT_LT(chosen, terms.size());
  EXPECT_EQ(next.term, terms[chosen].name);
  EXPECT_EQ(next.larger_term, chosen == 0 ? "" : terms[0].name);
  EXPECT_THAT(c.diagnostics.advice, HasSubstr("due to " + TermInWords(terms[0].name)));
  EXPECT_THAT(c.diagnostics.advice, HasSubstr("due to " + TermInWords(next.term)));
  EXPECT_NE(next.action, "");
}

// A sweep without systematic parts: the statistical error is the largest.
TEST(NextMeasurement, AgainstNoiseIsAChangeOfTheSweep) {
  SimulatedSweep s = SweepWithFloor("ii", 192, 7);
  Calibration c = CalibrateWithoutMap(s.sweep);
  ASSERT_TRUE(c.summary.blur_ratio) << c.summary.reason;
  c.diagnostics.systematic_parts.clear();
  for (auto* result :
       {&c.summary.focus_depth_mm, &c.summary.image_distance_mm, &c.summary.blur_ratio})
    (*result)->systematic.reset();
  const NextMeasurement next = ProposeNext(s.sweep, c);
  ASSERT_TRUE(next.done) << next.message;
  EXPECT_EQ(next.term, kNoiseTerm);
  EXPECT_THAT(next.action, AnyOf(HasSubstr("frames in place of"), HasSubstr("more frames on the"),
                                 HasSubstr("average 4 exposures"), HasSubstr("read the position")));
  // Twice the information of independent frames leaves 0.71 of the error, more of it not less than
  // a half.
  for (const auto& [change, sigma] :
       {std::pair(next.focus_depth_mm, c.summary.focus_depth_mm->sigma),
        std::pair(next.blur_ratio, c.summary.blur_ratio->sigma)}) {
    ASSERT_TRUE(change);
    EXPECT_NEAR(change->now, 1.96 * sigma, 1e-9);
    EXPECT_GT(change->afterwards, 0.3 * change->now);
  }
  EXPECT_LT(std::min(next.focus_depth_mm->afterwards / next.focus_depth_mm->now,
                     next.blur_ratio->afterwards / next.blur_ratio->now),
            0.8);
}

// The rest without a part lies between whole - part and sqrt(whole^2 - part^2). The latter is
// stated where the parts in the list are not those that make the interval.
TEST(NextMeasurement, WithoutASystematicPartItBoundsTheRest) {
  Calibration c;
  c.summary.focus_depth_mm = Result{300, 0.1, Eigen::Vector2d(295, 305)};
  c.summary.image_distance_mm = Result{60, 0.004, Eigen::Vector2d(59.8, 60.2)};
  c.summary.blur_ratio = Result{0.45, 0.001, Eigen::Vector2d(0.44, 0.46)};
  SystematicPart part;
  part.name = "blur floor";
  part.focus_depth_mm = {-3, 3};
  part.blur_ratio = {-0.008, 0};
  part.remedy = "photograph a knife edge";
  c.diagnostics.systematic_parts = {part};
  const NextMeasurement next = ProposeNext({}, c);
  ASSERT_TRUE(next.done) << next.message;
  EXPECT_EQ(next.action, "photograph a knife edge");
  EXPECT_NEAR(next.focus_depth_mm->now, 5 + 0.196, 1e-9);
  EXPECT_NEAR(next.focus_depth_mm->afterwards, 4 + 0.196, 1e-9);
  // The upper side keeps its 0.01.
  EXPECT_NEAR(next.blur_ratio->afterwards, 0.01 + 0.00196, 1e-9);
}

// The floor is added linearly, the others in quadrature: 5 = 2 + hypot(3, 0).
TEST(NextMeasurement, WithoutASystematicPartItSubtractsItWhereThePartsMakeTheInterval) {
  Calibration c;
  c.summary.focus_depth_mm = Result{300, 0.1, Eigen::Vector2d(295, 305)};
  c.summary.image_distance_mm = Result{60, 0.004, Eigen::Vector2d(59.8, 60.2)};
  SystematicPart side, floor;
  side.name = "side of focus";
  side.focus_depth_mm = {-3, 3};
  side.remedy = "use frames closer to focus";
  floor.name = "blur floor";
  floor.focus_depth_mm = {-2, 2};
  floor.remedy = "photograph a knife edge";
  c.diagnostics.systematic_parts = {side, floor};
  const NextMeasurement without_side = ProposeNext({}, c);
  EXPECT_EQ(without_side.term, "side of focus");
  EXPECT_NEAR(without_side.focus_depth_mm->afterwards, 2 + 0.196, 1e-9);
  c.diagnostics.systematic_parts[0].focus_depth_mm = {-1.5, 1.5};
  c.summary.focus_depth_mm->systematic = Eigen::Vector2d(296.5, 303.5);
  const NextMeasurement without_floor = ProposeNext({}, c);
  EXPECT_EQ(without_floor.term, "blur floor");
  EXPECT_NEAR(without_floor.focus_depth_mm->afterwards, 1.5 + 0.196, 1e-9);
}

TEST(NextMeasurement, IsNoneWithoutAResult) {
  const NextMeasurement next = ProposeNext({}, {});
  EXPECT_FALSE(next.done);
  EXPECT_NE(next.message, "not run");
}

TEST(NextMeasurement, SaysThatALargerTermHasNoRemedy) {
  Calibration c;
  c.summary.blur_ratio = Result{0.45, 0.001, Eigen::Vector2d(0.42, 0.48)};
  SystematicPart part;
  part.name = "blur estimator";
  part.blur_ratio = {-0.03, 0.03};
  part.remedy = "no remedy: this is its accuracy";
  c.diagnostics.systematic_parts = {part};
  const NextMeasurement next = ProposeNext({}, c);
  ASSERT_TRUE(next.done) << next.message;
  EXPECT_EQ(next.larger_term, "blur estimator");
  EXPECT_EQ(next.term, kNoiseTerm);
}

class NextMeasurementOf : public ::testing::TestWithParam<const char*> {};

// Sweeps whose largest term is of different kinds.
TEST_P(NextMeasurementOf, TheLargestTermOfTheTable) {
  const std::string kind = GetParam();
  model::SweepSimulationOptions options = SweepCase("ii", 160, 3);
  SimulatedSweep s = Simulate(options);
  if (kind != "floor") GiveFloor(&s);
  if (kind == "offset") s.sweep.offset_mm->sigma = 3;
  if (kind == "scale") s.sweep.offset_mm.reset();
  if (kind == "tolerance") s.sweep.camera.statements["lens.front_focal_length_mm"] = {1, false};
  if (kind == "contradiction") s.sweep.offset_mm->value += 6;
  if (kind == "shape") s.sweep.camera.psf = model::Psf::kDisc;
  const Calibration c = CalibrateWithoutMap(s.sweep);
  ASSERT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
  const NextMeasurement next = ProposeNext(s.sweep, c);
  ASSERT_TRUE(next.done) << next.message;
  ExpectAgreement(c, next);
  EXPECT_EQ(c.summary.frames_used + c.summary.frames_rejected + c.summary.frames_left_out,
            static_cast<int>(s.sweep.frames.size()));
}

INSTANTIATE_TEST_SUITE_P(Kinds, NextMeasurementOf,
                         ::testing::Values("clean", "floor", "offset", "scale", "tolerance",
                                           "contradiction", "shape"),
                         [](const auto& kind) { return std::string(kind.param); });

}  // namespace
}  // namespace thicklens::calib
