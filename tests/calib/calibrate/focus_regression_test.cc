// The calibration is compared with simulated sweeps whose truth is known:
// configs/sweeps/case-*.yaml.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <string>

#include "tests/calib/simulated_sweep.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::calib {
namespace {

using thicklens::testing::GiveFloor;
using thicklens::testing::Simulate;
using thicklens::testing::SimulatedSweep;
using thicklens::testing::SweepCase;

constexpr int kSizePx = 256;

struct Bounds {
  const char* name;
  double focus_mm;
  double ratio;  // relative
};
// Dead leaves with a given floor of 0.5 +- 0.01 px.
constexpr Bounds kLeaves[] = {{"i", 0.5, 0.007},
                              {"ii", 0.045, 0.01},
                              {"iii", 0.1, 0.002},
                              {"iv", 0.23, 0.004},
                              {"v", 0.035, 0.015}};
// A knife edge with a fitted floor. The limits for the standard deviations of one sweep are a fifth
// above the present ones. Errors are compared with the stated standard deviations.
constexpr Bounds kEdge[] = {{"i", 0.21, 0.0026},
                            {"ii", 0.017, 0.0019},
                            {"iii", 0.038, 0.0009},
                            {"iv", 0.1, 0.0014},
                            {"v", 0.034, 0.0037}};
// Error of kappa that remains without noise (KnifeEdgesInDarkCornersAreMeasured): the paper's pupil
// law gives the blur tails that the family does not have, and the fit of an edge responds to them
// by as much.
constexpr double kModelRatio = 5e-4;
constexpr double kReach = 4;  // standard deviations

SimulatedSweep Sweep(const std::string& name, model::TargetKind kind, std::uint64_t seed) {
  model::SweepSimulationOptions options = SweepCase(name, kSizePx, seed);
  options.target.kind = kind;
  return Simulate(options);
}

Calibration Measured(const SimulatedSweep& s) {
  Calibration c = Calibrate(s.sweep, {});
  return c;
}

// Expects the truth in the systematic interval widened by three sigma.
void ExpectCovered(const Result& result, double truth) {
  ASSERT_TRUE(result.systematic);
  EXPECT_GT(truth, result.systematic->x() - 3 * result.sigma);
  EXPECT_LT(truth, result.systematic->y() + 3 * result.sigma);
}

void CheckLeaves(const Bounds& bounds, std::uint64_t seed) {
  SCOPED_TRACE(std::string("leaves, case ") + bounds.name + ", seed " + std::to_string(seed));
  SimulatedSweep s = Sweep(bounds.name, model::TargetKind::kDeadLeaves, seed);
  GiveFloor(&s);
  const Calibration c = Measured(s);
  ASSERT_EQ(c.summary.outcome, Outcome::kOk) << c.summary.reason;
  EXPECT_NEAR(c.summary.focus_depth_mm->value, s.truth.focus_depth_mm, bounds.focus_mm);
  EXPECT_NEAR(c.summary.blur_ratio->value / s.truth.blur_ratio, 1, bounds.ratio);
  ExpectCovered(*c.summary.focus_depth_mm, s.truth.focus_depth_mm);
  ExpectCovered(*c.summary.blur_ratio, s.truth.blur_ratio);
  ExpectCovered(*c.summary.image_distance_mm, s.truth.image_distance_mm);
}

Calibration MeasuredEdge(const Bounds& bounds, std::uint64_t seed, model::SweepTruth* truth) {
  SimulatedSweep s = Sweep(bounds.name, model::TargetKind::kKnifeEdge, seed);
  s.sweep.target = model::SweepTarget::kKnifeEdge;
  *truth = s.truth;
  return Measured(s);
}

void CheckEdge(const Bounds& bounds, std::uint64_t seed) {
  SCOPED_TRACE(std::string("knife edge, case ") + bounds.name + ", seed " + std::to_string(seed));
  model::SweepTruth truth;
  const Calibration c = MeasuredEdge(bounds, seed, &truth);
  ASSERT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
  EXPECT_LT(c.summary.focus_depth_mm->sigma, bounds.focus_mm);
  EXPECT_LT(c.summary.blur_ratio->sigma / truth.blur_ratio, bounds.ratio);
  EXPECT_NEAR(c.summary.focus_depth_mm->value, truth.focus_depth_mm,
              kReach * c.summary.focus_depth_mm->sigma);
  EXPECT_NEAR(c.summary.blur_ratio->value, truth.blur_ratio,
              kReach * c.summary.blur_ratio->sigma + kModelRatio * truth.blur_ratio);
  ExpectCovered(*c.summary.focus_depth_mm, truth.focus_depth_mm);
  ExpectCovered(*c.summary.blur_ratio, truth.blur_ratio);
  // A coarse sweep may leave the floor undetermined.
  if (c.summary.blur_floor_px) {
    EXPECT_NEAR(c.summary.blur_floor_px->value, truth.blur_floor_px,
                kReach * c.summary.blur_floor_px->sigma);
  }
}

// Errors divided by their stated standard deviations, over many sweeps. The bias is less than three
// standard errors of the mean, and the spread is 1 within three of its own standard errors,
// 1/sqrt(2 n).
struct Pulls {
  double count = 0, sum = 0, squares = 0;
  void Add(const Result& result, double truth) {
    const double pull = (result.value - truth) / result.sigma;
    ++count;
    sum += pull;
    squares += pull * pull;
  }
  void ExpectNormal(const char* what) const {
    EXPECT_NEAR(sum / count, 0, 3 / std::sqrt(count)) << what;
    EXPECT_NEAR(std::sqrt(squares / count), 1, 3 / std::sqrt(2 * count)) << what;
  }
};

void CheckEdges(const Bounds& bounds, std::uint64_t count) {
  SCOPED_TRACE(std::string("knife edges, case ") + bounds.name);
  Pulls focus, ratio;
  for (std::uint64_t seed = 1; seed <= count; ++seed) {
    model::SweepTruth truth;
    const Calibration c = MeasuredEdge(bounds, seed, &truth);
    ASSERT_TRUE(c.summary.focus_depth_mm && c.summary.blur_ratio)
        << seed << ": " << c.summary.reason;
    focus.Add(*c.summary.focus_depth_mm, truth.focus_depth_mm);
    ratio.Add(*c.summary.blur_ratio, truth.blur_ratio);
  }
  focus.ExpectNormal("zf");
  ratio.ExpectNormal("kappa");
}

TEST(FocusRegression, LeavesInCaseTwo) { CheckLeaves(kLeaves[1], 1); }
TEST(FocusRegression, LeavesInCaseThree) { CheckLeaves(kLeaves[2], 1); }
TEST(FocusRegression, LeavesInCaseFive) { CheckLeaves(kLeaves[4], 1); }
TEST(FocusRegression, KnifeEdgeInCaseTwo) { CheckEdge(kEdge[1], 1); }
TEST(FocusRegression, KnifeEdgeInCaseFive) { CheckEdge(kEdge[4], 1); }
// For seed 3, two readings are off by 3.3 and 2 sigma, and so is kappa.
TEST(FocusRegression, SlowKnifeEdgesInCaseFiveScatterAsStated) { CheckEdges(kEdge[4], 20); }

// An edge without noise crosses a sensor that is wide enough for the fall-off to darken its ends by
// 14 %. When the levels were constant along the edge, kappa was 0.36 % too large and the floor
// 0.002 px.
TEST(FocusRegression, KnifeEdgesInDarkCornersAreMeasured) {
  model::SweepSimulationOptions options = SweepCase("i", 800, 1);
  options.target.kind = model::TargetKind::kKnifeEdge;
  options.bits = 16;
  options.full_well_electrons = options.reading_sigma_mm = 0;
  options.step_mm = 30;
  options.frame_count = 11;
  SimulatedSweep s = Simulate(options);
  s.sweep.target = model::SweepTarget::kKnifeEdge;
  CalibrationOptions how;
  how.map_field = false;
  const Calibration c = Calibrate(s.sweep, how);
  ASSERT_TRUE(c.summary.blur_ratio && c.summary.blur_floor_px) << c.summary.reason;
  EXPECT_NEAR(c.summary.blur_ratio->value / s.truth.blur_ratio, 1, kModelRatio);
  EXPECT_NEAR(c.summary.image_distance_mm->value, s.truth.image_distance_mm, 1e-5);
  EXPECT_NEAR(c.summary.blur_floor_px->value, s.truth.blur_floor_px, 5e-5);
}

TEST(FocusRegression, SlowLeavesInEveryCase) {
  for (const Bounds& bounds : kLeaves) CheckLeaves(bounds, 2);
}
TEST(FocusRegression, SlowKnifeEdgeInEveryCase) {
  for (const Bounds& bounds : kEdge) CheckEdge(bounds, 2);
}
TEST(FocusRegression, SlowKnifeEdgesInCaseOneScatterAsStated) { CheckEdges(kEdge[0], 12); }

// The share of the lens in the softness of a printed edge is unknown.
void CheckPrinted(const char* name) {
  SCOPED_TRACE(name);
  const SimulatedSweep s = Sweep(name, model::TargetKind::kPrintedEdge, 1);
  const Calibration c = Measured(s);
  EXPECT_EQ(c.summary.outcome, Outcome::kPartial) << c.summary.reason;
  ASSERT_TRUE(c.summary.focus_depth_mm);
  ExpectCovered(*c.summary.focus_depth_mm, s.truth.focus_depth_mm);
  ExpectCovered(*c.summary.blur_ratio, s.truth.blur_ratio);
  ExpectCovered(*c.summary.image_distance_mm, s.truth.image_distance_mm);
}
TEST(FocusRegression, APrintedEdgeOfUnknownFloorCoversTheTruth) { CheckPrinted("iii"); }
TEST(FocusRegression, SlowAPrintedEdgeOfUnknownFloorCoversTheTruth) {
  CheckPrinted("i");
  CheckPrinted("ii");
  CheckPrinted("iv");
}

// A bench offset that is found from the image scale is accurate to a few tenths of a millimetre if
// the scale changes enough (i, iii, iv). Otherwise its stated error is large. Its error enters zf
// one to one.
void CheckUnknownOffset(const char* name, double within_mm) {
  SCOPED_TRACE(name);
  SimulatedSweep s = Sweep(name, model::TargetKind::kDeadLeaves, 1);
  GiveFloor(&s);
  s.sweep.offset_mm.reset();
  const Calibration c = Measured(s);
  ASSERT_TRUE(c.summary.bench_offset_mm && c.summary.focus_depth_mm) << c.summary.reason;
  const double offset_error_mm = c.summary.bench_offset_mm->value - s.truth.bench_offset_mm;
  const double focus_error_mm = c.summary.focus_depth_mm->value - s.truth.focus_depth_mm;
  EXPECT_LT(std::abs(offset_error_mm), within_mm);
  EXPECT_LT(std::abs(focus_error_mm), within_mm);
  EXPECT_LT(std::abs(offset_error_mm), 3 * c.summary.bench_offset_mm->sigma);
  EXPECT_LT(std::abs(focus_error_mm), 3 * c.summary.focus_depth_mm->sigma);
}
TEST(FocusRegression, AnUnknownOffsetIsFoundFromTheImageScale) { CheckUnknownOffset("iii", 0.6); }
TEST(FocusRegression, SlowAnUnknownOffsetIsFoundFromTheImageScale) {
  CheckUnknownOffset("i", 0.9);
  CheckUnknownOffset("ii", 2.1);
  CheckUnknownOffset("iv", 0.6);
  CheckUnknownOffset("v", 2.9);
}

// Errors of the paper: the sharpest raw frame is not the plane of focus (lamp, magnification and
// floor shift it), and the mean of sigma/r is the mean of a quantity that diverges at focus.
void CheckSourceRecipe(const char* name) {
  SCOPED_TRACE(name);
  SimulatedSweep s = Sweep(name, model::TargetKind::kDeadLeaves, 1);
  GiveFloor(&s);
  const Calibration c = Measured(s);
  ASSERT_TRUE(c.diagnostics.paper_recipe.done && c.summary.focus_depth_mm);
  const double ours_mm = std::abs(c.summary.focus_depth_mm->value - s.truth.focus_depth_mm);
  const double source_mm =
      std::abs(c.diagnostics.paper_recipe.focus_depth_mm - s.truth.focus_depth_mm);
  EXPECT_GT(source_mm, 5 * ours_mm);
  EXPECT_GT(source_mm, 5 * c.summary.focus_depth_mm->sigma);
  EXPECT_LT(c.diagnostics.paper_recipe.focus_depth_mm,
            s.truth.focus_depth_mm);  // shifted to the near side
  EXPECT_GT(std::abs(c.diagnostics.paper_recipe.blur_ratio / s.truth.blur_ratio - 1), 0.3);
  EXPECT_LT(std::abs(c.summary.blur_ratio->value / s.truth.blur_ratio - 1), 0.004);
}
TEST(SourceRecipe, MissesFocusAndRatioInCaseThree) { CheckSourceRecipe("iii"); }
TEST(SourceRecipe, SlowMissesFocusAndRatioInCaseFour) { CheckSourceRecipe("iv"); }

TEST(SourceRecipe, RatioDivergesTowardFocusEvenWithTheTruePlane) {
  SimulatedSweep s = Sweep("iii", model::TargetKind::kKnifeEdge, 1);
  s.sweep.target = model::SweepTarget::kKnifeEdge;
  const Calibration c = Measured(s);
  // The mean ratio as the paper defines it, at the true plane of focus, for frames about a distance
  // from it.
  const auto ratio_near = [&](double distance_mm) {
    double best = 0, apart = 1e9;
    for (std::size_t i = 0; i < c.frames.size(); ++i) {
      const double z = s.truth.frames[i].depth_mm;
      const double off = std::abs(std::abs(z - s.truth.focus_depth_mm) - distance_mm);
      if (off >= apart) continue;
      apart = off;
      best = c.frames[i].source_blur_sigma_px * s.sweep.camera.sensor.pixel_pitch_mm /
             model::BlurRadiusMm(s.sweep.camera.lens, s.truth.image_distance_mm, z);
    }
    return best / s.truth.blur_ratio;
  };
  // The first frames are 1.3 and 2.7 mm from focus, the others every 4 mm.
  EXPECT_GT(ratio_near(1), 20);
  EXPECT_GT(ratio_near(1), 1.5 * ratio_near(2.7));
  EXPECT_GT(ratio_near(2.7), 1.5 * ratio_near(6));
  EXPECT_GT(ratio_near(6), 1.5 * ratio_near(14));
  EXPECT_LT(ratio_near(78), 1.2);  // far from focus it is nearly right
}

}  // namespace
}  // namespace thicklens::calib
