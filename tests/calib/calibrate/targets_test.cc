#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "calib/calibrate/relief_region.h"
#include "calib/calibrate/target_calibration.h"
#include "calib/simulated_sweep.h"
#include "support/sample_statistics.h"
#include "thicklens/calib/calibrate.h"

namespace thicklens::calib {
namespace {

using model::TargetKind;
using ::testing::AnyOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::Simulate;
using testing::SimulatedSweep;

// The bench of configs/accuracy with a target; frames of 240 x 180 px.
model::SweepSimulationOptions Bench(TargetKind kind, std::uint64_t seed = 1) {
  model::SweepSimulationOptions options =
      model::ReadSweepSimulation(THICKLENS_SOURCE_DIR "/configs/sweeps/demo.yaml");
  options.camera.sensor.width_px = 240;
  options.camera.sensor.height_px = 180;
  options.camera.sensor.principal_point_px = {119.5, 89.5};
  options.target.kind = kind;
  options.first_depth_mm = 290.4;
  options.step_mm = 1;
  options.frame_count = 21;
  options.reading_sigma_mm = 0.05;
  options.drift_sigma_px = 1;
  options.bits = 16;
  options.seed = seed;
  return options;
}

model::SweepSimulationOptions Points(TargetKind kind, std::uint64_t seed = 1) {
  model::SweepSimulationOptions options = Bench(kind, seed);
  options.target.contrast = 0.95;
  options.target.feature_size_mm = 0.12;  // 5 px
  options.target.spacing_mm = 0.9;        // 40 px
  if (kind == TargetKind::kPinholes) options.light_level = 0.04;
  return options;
}

// Values that interval and two sigmas contain.
bool Covers(const std::optional<Result>& result, double truth) {
  if (!result) return false;
  const double low =
      result->systematic ? std::min(result->systematic->x(), result->value) : result->value;
  const double high =
      result->systematic ? std::max(result->systematic->y(), result->value) : result->value;
  return truth > low - 2.5 * result->sigma && truth < high + 2.5 * result->sigma;
}

TEST(TargetsOfSweeps, PointsOnDarkAndBrightGroundAreMeasuredByTheirMoments) {
  for (const TargetKind kind : {TargetKind::kPinholes, TargetKind::kBeads}) {
    SimulatedSweep s = Simulate(Points(kind));
    s.sweep.target = model::SweepTarget::kPoints;
    const Calibration found = Calibrate(s.sweep, {});
    ASSERT_NE(found.summary.outcome, Outcome::kRefused)
        << model::TargetKindName(kind) << ": " << found.summary.reason;
    EXPECT_EQ(found.diagnostics.target.measured_as, "points");
    EXPECT_EQ(found.diagnostics.target.spots.are_bright, kind == TargetKind::kPinholes);
    EXPECT_TRUE(Covers(found.summary.blur_ratio, 0.45)) << found.summary.BriefReport();
    EXPECT_TRUE(Covers(found.summary.focus_depth_mm, 300)) << found.summary.BriefReport();
    EXPECT_LT(found.summary.blur_ratio->sigma, 0.02);
    EXPECT_EQ(found.summary.frames_rejected, 0);
  }
}

TEST(TargetsOfSweeps, ADiscHasTheBlurRatioOfAWholeAperture) {
  model::SweepSimulationOptions options = Points(TargetKind::kBeads);
  options.camera.psf = model::Psf::kDisc;
  options.camera.calibration->blur_ratio = model::Estimate{0.5, 0};
  SimulatedSweep s = Simulate(options);
  s.sweep.target = model::SweepTarget::kPoints;
  const Calibration found = Calibrate(s.sweep, {});
  ASSERT_NE(found.summary.outcome, Outcome::kRefused) << found.summary.reason;
  EXPECT_NEAR(found.summary.blur_ratio->value, 0.5, 0.015);
  EXPECT_TRUE(Covers(found.summary.blur_ratio, 0.5)) << found.summary.BriefReport();
}

TEST(TargetsOfSweeps, AutoRecognisesPointsAndSaysSo) {
  SimulatedSweep s = Simulate(Points(TargetKind::kPinholes, 2));
  const Calibration found = Calibrate(s.sweep, {});
  EXPECT_EQ(found.diagnostics.target.measured_as, "points") << found.summary.reason;
  EXPECT_THAT(found.summary.warnings, Contains(HasSubstr("bright points and nothing else")));
  SimulatedSweep leaves = Simulate(Bench(TargetKind::kDeadLeaves));
  EXPECT_EQ(Calibrate(leaves.sweep, {}).diagnostics.target.measured_as, "texture");
}

TEST(TargetsOfSweeps, TheImageScaleComesFromThePlacesOfThePoints) {
  SimulatedSweep s = Simulate(Points(TargetKind::kBeads, 3));
  s.sweep.target = model::SweepTarget::kPoints;
  s.sweep.offset_mm.reset();
  const Calibration found = Calibrate(s.sweep, {});
  ASSERT_TRUE(found.diagnostics.scale.done) << found.diagnostics.scale.message;
  EXPECT_NEAR(found.diagnostics.scale.offset_mm.value, 0,
              3 * found.diagnostics.scale.offset_mm.sigma);
  EXPECT_LT(found.diagnostics.scale.offset_mm.sigma, 12);
  EXPECT_GT(found.diagnostics.scale.frames_used, 15);
}

// The errors of kappa and zf are those of the scatter.
TEST(TargetsOfSweeps, SlowErrorsOfPointsAreCovered) {
  constexpr int kSeeds = 30;
  int kappa_covered = 0, zf_covered = 0;
  double squares = 0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    SimulatedSweep s = Simulate(Points(seed % 2 == 0 ? TargetKind::kPinholes : TargetKind::kBeads,
                                       static_cast<std::uint64_t>(seed)));
    s.sweep.target = model::SweepTarget::kPoints;
    const Calibration found = Calibrate(s.sweep, {});
    ASSERT_NE(found.summary.outcome, Outcome::kRefused) << found.summary.reason;
    kappa_covered += Covers(found.summary.blur_ratio, 0.45) ? 1 : 0;
    zf_covered += Covers(found.summary.focus_depth_mm, 300) ? 1 : 0;
    squares +=
        std::pow((found.summary.blur_ratio->value - 0.45) / found.summary.blur_ratio->sigma, 2);
    RecordProperty("kappa" + std::to_string(seed), std::to_string(found.summary.blur_ratio->value));
  }
  EXPECT_GE(kappa_covered, 27);
  EXPECT_GE(zf_covered, 27);
  EXPECT_LT(squares / kSeeds, 2.5);
}

TEST(TargetsOfSweeps, ASlantedEdgeStatedAsATextureIsMeasuredAsAnEdge) {
  for (const auto target : {model::SweepTarget::kTexture, model::SweepTarget::kAuto}) {
    SimulatedSweep s = Simulate(Bench(TargetKind::kPrintedEdge));
    s.sweep.target = target;
    const Calibration found = Calibrate(s.sweep, {});
    ASSERT_NE(found.summary.outcome, Outcome::kRefused) << found.summary.reason;
    EXPECT_EQ(found.diagnostics.target.measured_as, "edges");
    EXPECT_TRUE(Covers(found.summary.blur_ratio, 0.45)) << found.summary.BriefReport();
    EXPECT_TRUE(Covers(found.summary.focus_depth_mm, 300)) << found.summary.BriefReport();
    EXPECT_THAT(found.summary.warnings, Contains(HasSubstr("one straight edge")));
  }
}

TEST(TargetsOfSweeps, AMeshStarAndGroundGlassGiveTheTruth) {
  for (const TargetKind kind :
       {TargetKind::kMesh, TargetKind::kSiemensStar, TargetKind::kGroundGlass}) {
    model::SweepSimulationOptions options = Bench(kind);
    if (kind == TargetKind::kMesh) options.target.feature_size_mm = 0.9;
    SimulatedSweep s = Simulate(options);
    const Calibration found = Calibrate(s.sweep, {});
    ASSERT_NE(found.summary.outcome, Outcome::kRefused)
        << model::TargetKindName(kind) << ": " << found.summary.reason;
    EXPECT_TRUE(Covers(found.summary.blur_ratio, 0.45))
        << model::TargetKindName(kind) << found.summary.BriefReport();
    EXPECT_TRUE(Covers(found.summary.focus_depth_mm, 300))
        << model::TargetKindName(kind) << found.summary.BriefReport();
    EXPECT_FALSE(found.diagnostics.target.relief.is_relief) << model::TargetKindName(kind);
  }
}

// ---- relief ----

model::ReliefPartOptions Part(model::ReliefPartOptions::Shape shape, double x_mm, double y_mm,
                              double width_mm, double height_mm, double above_mm) {
  model::ReliefPartOptions part;
  part.shape = shape;
  part.centre_mm = {x_mm, y_mm};
  part.size_mm = {width_mm, height_mm};
  part.height_mm = above_mm;
  return part;
}

// The field is about 5.4 x 4.0 mm.
TEST(TargetsOfSweeps, AStepIsFoundAndItsLargerSideMeasured) {
  model::SweepSimulationOptions options = Bench(TargetKind::kDeadLeaves);
  options.target.relief = {Part(model::ReliefPartOptions::Shape::kRectangle, 2.2, 0, 2.4, 6, 4)};
  SimulatedSweep s = Simulate(options);
  const Calibration found = Calibrate(s.sweep, {});
  const ReliefFinding& relief = found.diagnostics.target.relief;
  EXPECT_TRUE(relief.is_relief) << relief.message << "\n" << found.diagnostics.target.ReliefMap();
  ASSERT_NE(found.summary.outcome, Outcome::kRefused) << found.summary.reason;
  ASSERT_TRUE(relief.region.has_value());
  EXPECT_LT(relief.region->x + relief.region->width, 165);
  ASSERT_GE(relief.parts.size(), 2U);
  EXPECT_NEAR(relief.parts[1].nearer_mm.value, 4, 0.6);
  EXPECT_TRUE(Covers(found.summary.blur_ratio, 0.45)) << found.summary.BriefReport();
  EXPECT_TRUE(Covers(found.summary.focus_depth_mm, 300)) << found.summary.BriefReport();
  EXPECT_THAT(found.summary.warnings, Contains(HasSubstr("the target has relief")));
}

TEST(TargetsOfSweeps, TiltedAndCurvedFieldsAreNoRelief) {
  for (const int which : {0, 1, 2, 3}) {
    model::SweepSimulationOptions options = Bench(TargetKind::kDeadLeaves);
    if (which == 1) options.target.tilt_deg = 20;
    if (which == 2) options.aberrations.field_curvature_mm = -4;
    if (which == 3) options.aberrations.field_astigmatism_mm = 4;
    SimulatedSweep s = Simulate(options);
    const Calibration found = Calibrate(s.sweep, {});
    EXPECT_FALSE(found.diagnostics.target.relief.is_relief) << which << "\n"
                                                            << found.diagnostics.target.ReliefMap();
    EXPECT_THAT(found.summary.reason, Not(HasSubstr("relief:")));
  }
}

// Many small parts leave no rectangle at one depth.
TEST(TargetsOfSweeps, AReliefWithoutALargePartIsRefusedWithAMap) {
  model::SweepSimulationOptions options = Bench(TargetKind::kDeadLeaves);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 2; ++j) {
      options.target.relief.push_back(Part(model::ReliefPartOptions::Shape::kRectangle,
                                           -1.8 + 1.8 * i, -1.0 + 2.0 * j, 1.1, 1.1, 5));
    }
  }
  SimulatedSweep s = Simulate(options);
  const Calibration found = Calibrate(s.sweep, {});
  EXPECT_EQ(found.summary.outcome, Outcome::kRefused) << found.summary.BriefReport();
  EXPECT_THAT(found.summary.reason, HasSubstr("the target has relief"));
  EXPECT_THAT(found.summary.reason, HasSubstr("Rows of the map of the zones: "));
  EXPECT_THAT(found.summary.reason, HasSubstr(" / "));
  EXPECT_THAT(found.summary.reason, Not(HasSubstr("\n")));
  EXPECT_FALSE(found.summary.blur_ratio.has_value());
  // Nothing of the fit to several depths is left.
  EXPECT_FALSE(found.diagnostics.blur.done);
  EXPECT_FALSE(found.diagnostics.focus_reading_mm.has_value());
  EXPECT_FALSE(found.diagnostics.magnification_at_focus.has_value());
  EXPECT_TRUE(found.diagnostics.systematic_parts.empty());
  EXPECT_EQ(found.diagnostics.covariance.size(), 0);
  EXPECT_EQ(found.diagnostics.advice, "");
  EXPECT_EQ(found.summary.bench_offset_mm.has_value(), s.sweep.offset_mm.has_value());
}

// A calibration of a step, as if with the size of a grid, of which `run` reports the sweep.
TEST(TargetsOfSweeps, ThePartOfAReliefHasNoSizeOfTheWholeGrid) {
  model::SweepSimulationOptions options = Bench(TargetKind::kDeadLeaves);
  options.target.relief = {Part(model::ReliefPartOptions::Shape::kRectangle, 2.2, 0, 2.4, 6, 4)};
  SimulatedSweep s = Simulate(options);
  const Calibration whole = CalibrateTarget(s.sweep, {});
  s.sweep.grid_scales = {{0, 0.25, 0.001}};
  int runs = 0;
  WithoutRelief(s.sweep, {}, whole, [&](const FocusSweep& part) {
    ++runs;
    EXPECT_TRUE(part.grid_scales.empty());
    EXPECT_LT(part.roi.width, 240);
    return whole;
  });
  EXPECT_EQ(runs, 1);
}

// Points at two depths are left as points, whether they are stated or recognised.
TEST(TargetsOfSweeps, RecognisedPointsAreNotDividedIntoDepths) {
  SimulatedSweep s = Simulate(Points(TargetKind::kBeads));
  const Calibration found = Calibrate(s.sweep, {});
  ASSERT_EQ(found.diagnostics.target.measured_as, "points") << found.summary.reason;
  EXPECT_EQ(found.diagnostics.target.relief.columns, 0);
}

}  // namespace
}  // namespace thicklens::calib
