// Systematic parts are compared with new calibrations, and their sum is tested.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>

#include "calib/uncertainty/systematic_parts.h"
#include "tests/calib/focus_case.h"

namespace thicklens::calib {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using thicklens::testing::BlurBench;
using thicklens::testing::ExactBench;
using thicklens::testing::FocusCase;

constexpr double kErrorPx2 = 0.01;

// No frame is in the plane of focus.
BlurBench Asymmetric() {
  BlurBench bench = ExactBench();
  bench.first_mm = 342;
  bench.last_mm = 490;
  return bench;
}

// ---- the oracle of a trial is to calibrate again ----

TEST(AddSystematicParts, AToleranceIsWhatAnotherCameraFileWouldGive) {
  struct Field {
    const char* name;
    double tolerance;
    double model::ThickLens::*of_lens;  // null: the pixel pitch
  };
  const Field fields[] = {
      {"lens.front_focal_length_mm", 0.1, &model::ThickLens::front_focal_length_mm},
      {"lens.rear_focal_length_mm", 0.1, &model::ThickLens::rear_focal_length_mm},
      {"lens.lens_thickness_mm", 0.2, &model::ThickLens::lens_thickness_mm},
      {"lens.aperture_radius_mm", 0.1, &model::ThickLens::aperture_radius_mm},
      {"sensor.pixel_pitch_mm", 1e-4, nullptr}};
  for (const Field& field : fields) {
    SCOPED_TRACE(field.name);
    const auto solved = [&](double change, bool is_stated) {
      BlurBench bench;  // with noise
      FocusCase c = FocusCase(bench).WithTexture(0.02).WithTrueFloor();
      model::ThickLens& lens = c.evidence.setup.lens;
      (field.of_lens != nullptr ? lens.*field.of_lens : c.evidence.setup.pixel_pitch_mm) += change;
      c.sweep.camera.lens = lens;
      c.sweep.camera.sensor.pixel_pitch_mm = c.evidence.setup.pixel_pitch_mm;
      if (is_stated) c.sweep.camera.statements[field.name] = {field.tolerance, false};
      c.Solve();
      return c;
    };
    const FocusCase c = solved(0, true);
    const SystematicPart* part = c.Part(field.name);
    ASSERT_NE(part, nullptr);
    Eigen::Vector2d zf(0, 0), d1(0, 0), kappa(0, 0);
    const auto widen = [](double move, Eigen::Vector2d* ends) {
      *ends = {std::min(ends->x(), move), std::max(ends->y(), move)};
    };
    for (const double change : {-field.tolerance, field.tolerance}) {
      const FocusCase again = solved(change, false);
      ASSERT_TRUE(again.calibration.summary.focus_depth_mm) << again.calibration.summary.reason;
      widen(again.calibration.summary.focus_depth_mm->value -
                c.calibration.summary.focus_depth_mm->value,
            &zf);
      widen(again.calibration.summary.image_distance_mm->value -
                c.calibration.summary.image_distance_mm->value,
            &d1);
      widen(again.calibration.summary.blur_ratio->value - c.calibration.summary.blur_ratio->value,
            &kappa);
    }
    for (int end = 0; end < 2; ++end) {
      EXPECT_NEAR(part->focus_depth_mm[end], zf[end], 1e-5);
      EXPECT_NEAR(part->image_distance_mm[end], d1[end], 1e-7 + 1e-3 * std::abs(d1[end]));
      EXPECT_NEAR(part->blur_ratio[end], kappa[end], 1e-6);
    }
    EXPECT_GT(d1.norm() + kappa.norm(), 1e-4);
  }
}

// An objective that has the bench's lens and is focused on its plane: f = F/M, zf = f (1 + 1/M).
model::Objective ObjectiveOfBench(const BlurBench& bench) {
  const double f_mm = bench.lens.front_focal_length_mm;
  const double magnification = f_mm / (bench.focus_mm - f_mm);
  return {magnification, std::sin(std::atan(bench.lens.aperture_radius_mm / bench.focus_mm)),
          f_mm * magnification};
}

// Solves the noisy bench with the lens of an objective in the place of its own.
FocusCase SolvedWithObjective(const model::Objective& objective,
                              const std::map<std::string, model::Provenance>& statements,
                              const std::optional<model::StatedConjugate>& known_focus = {}) {
  BlurBench bench;
  FocusCase c = FocusCase(bench).WithTexture(0.02).WithTrueFloor();
  c.evidence.known_focus = known_focus;
  c.sweep.camera.objective = objective;
  c.sweep.camera.lens = model::LensOfObjective(objective);
  c.sweep.camera.statements = statements;
  c.evidence.setup.lens = c.sweep.camera.lens;
  c.Solve();
  return c;
}

TEST(AddSystematicParts, AToleranceOfAnObjectiveIsWhatAnotherObjectiveWouldGive) {
  const model::Objective objective = ObjectiveOfBench(BlurBench());
  const struct {
    const char* name;
    double tolerance;
    double model::Objective::*number;
  } fields[] = {
      {"lens.numerical_aperture", 4e-4, &model::Objective::numerical_aperture},
      {"lens.tube_lens_focal_length_mm", 0.004, &model::Objective::tube_lens_focal_length_mm}};
  for (const auto& field : fields) {
    SCOPED_TRACE(field.name);
    const FocusCase c = SolvedWithObjective(objective, {{field.name, {field.tolerance, false}}});
    const SystematicPart* part = c.Part(field.name);
    ASSERT_NE(part, nullptr);
    Eigen::Vector2d d1(0, 0), kappa(0, 0);
    const auto widen = [](double move, Eigen::Vector2d* ends) {
      *ends = {std::min(ends->x(), move), std::max(ends->y(), move)};
    };
    for (const double change : {-field.tolerance, field.tolerance}) {
      model::Objective other = objective;
      other.*field.number += change;
      const FocusCase again = SolvedWithObjective(other, {});
      ASSERT_TRUE(again.calibration.summary.image_distance_mm) << again.calibration.summary.reason;
      widen(again.calibration.summary.image_distance_mm->value -
                c.calibration.summary.image_distance_mm->value,
            &d1);
      widen(again.calibration.summary.blur_ratio->value - c.calibration.summary.blur_ratio->value,
            &kappa);
    }
    for (int end = 0; end < 2; ++end) {
      EXPECT_NEAR(part->image_distance_mm[end], d1[end], 1e-7 + 1e-3 * std::abs(d1[end]));
      EXPECT_NEAR(part->blur_ratio[end], kappa[end], 1e-6);
    }
    EXPECT_GT(kappa.norm(), 1e-3);
  }
}

// Where a magnification gives the plane of focus, its tolerance is tried once.
TEST(AddSystematicParts, TheMagnificationOfAnObjectiveIsTriedOnce) {
  const model::Objective objective = ObjectiveOfBench(BlurBench());
  const std::map<std::string, model::Provenance> statements = {
      {"lens.magnification", {0.001, false}},
      {"lens.numerical_aperture", {0.1, false}},
      {"sensor.pixel_pitch_mm", {1e-5, false}}};
  const FocusCase c =
      SolvedWithObjective(objective, statements,
                          model::StatedConjugate{model::ConjugateKind::kMagnification,
                                                 {objective.magnification, 0.001},
                                                 "lens.magnification"});
  const auto& parts = c.calibration.diagnostics.systematic_parts;
  EXPECT_EQ(
      std::count_if(parts.begin(), parts.end(),
                    [](const SystematicPart& part) { return part.name == "lens.magnification"; }),
      1);
  // Where the bench offset is given, nothing else contains it.
  EXPECT_NE(SolvedWithObjective(objective, statements).Part("lens.magnification"), nullptr);
  EXPECT_NE(c.Part("sensor.pixel_pitch_mm"), nullptr);
  // The aperture minus its tolerance is below 0: only the larger one, with a smaller kappa, counts.
  const SystematicPart* aperture = c.Part("lens.numerical_aperture");
  ASSERT_NE(aperture, nullptr);
  EXPECT_LT(aperture->blur_ratio.x(), -0.3);
  EXPECT_EQ(aperture->blur_ratio.y(), 0);
}

// An end of the interval that is no valid lens is left out.
TEST(AddSystematicParts, AToleranceBeyondZeroCountsOnOneSide) {
  FocusCase c = FocusCase().WithTexture(kErrorPx2).WithTrueFloor();
  c.sweep.camera.statements["lens.aperture_radius_mm"] = {5, false};  // of 4.46 mm
  c.sweep.camera.statements["sensor.pixel_pitch_mm"] = {0.01, false};
  c.Solve();
  const SystematicPart* aperture = c.Part("lens.aperture_radius_mm");
  ASSERT_NE(aperture, nullptr);
  EXPECT_NEAR(aperture->blur_ratio.x(), 0.45 * (4.4643 / 9.4643 - 1), 1e-3);
  EXPECT_EQ(aperture->blur_ratio.y(), 0);
  const SystematicPart* pitch = c.Part("sensor.pixel_pitch_mm");
  ASSERT_NE(pitch, nullptr);
  EXPECT_EQ(pitch->blur_ratio.x(), 0);
  EXPECT_NEAR(pitch->blur_ratio.y(), 0.45 * 10 / 6, 1e-3);
}

TEST(AddSystematicParts, TheFloorsEndsAreTwoMoreCalibrations) {
  const auto solved = [](std::optional<double> floor_px) {
    BlurBench bench;  // with noise
    FocusCase c = FocusCase(bench).WithTexture(0.02);
    if (floor_px) {
      c.WithFloor(*floor_px, 0);
    } else {
      c.sweep.floor.from_px = 0.3;
      c.sweep.floor.to_px = 0.7;
    }
    c.Solve();
    return c;
  };
  const FocusCase c = solved(std::nullopt), low = solved(0.3), high = solved(0.7);
  const auto zf_mm = [](const FocusCase& k) { return k.calibration.summary.focus_depth_mm->value; };
  ASSERT_TRUE(c.calibration.summary.focus_depth_mm->systematic);
  EXPECT_NEAR(c.calibration.summary.focus_depth_mm->systematic->x(), zf_mm(low), 1e-4);
  EXPECT_NEAR(c.calibration.summary.focus_depth_mm->systematic->y(), zf_mm(high), 1e-4);
  EXPECT_NEAR(c.calibration.summary.image_distance_mm->systematic->x(),
              high.calibration.summary.image_distance_mm->value, 1e-6);
  EXPECT_NEAR(c.calibration.summary.image_distance_mm->systematic->y(),
              low.calibration.summary.image_distance_mm->value, 1e-6);
}

// Each blur estimator alone gets the floor that the other one measured.
TEST(AddSystematicParts, ATextureAloneKeepsTheKnifeEdgesFloor) {
  BlurBench bench = Asymmetric();
  FocusCase c = FocusCase(bench).WithTexture(kErrorPx2);
  BlurBench behind = bench;
  behind.focus_mm += 1;
  BlurSamples edges = behind.Absolute(kErrorPx2, 0, &c.random);
  edges.held_softness_px2 = 0;
  c.evidence.edges = 1;
  c.evidence.setup.estimators.push_back(edges);
  c.Solve();
  const SystematicPart* part = c.Part("edges against texture");
  ASSERT_NE(part, nullptr);
  const double zf = c.calibration.summary.focus_depth_mm->value;
  EXPECT_NEAR(zf + part->focus_depth_mm.x(), bench.focus_mm, 0.1);
  EXPECT_NEAR(zf + part->focus_depth_mm.y(), behind.focus_mm, 0.1);
}

// ---- how parts add up ----

// The blur estimators' own part of kappa and that of the pitch are added in quadrature, separately
// for each side.
TEST(AddSystematicParts, TheEstimatorsOwnErrorIsInKappa) {
  FocusCase c = FocusCase().WithTexture(kErrorPx2).WithTrueFloor();
  c.sweep.camera.statements["sensor.pixel_pitch_mm"] = {0.004 * c.bench.pitch_mm, false};
  c.Solve();
  const SystematicPart* own = c.Part("blur estimator");
  ASSERT_NE(own, nullptr);
  EXPECT_NEAR(own->blur_ratio.y(), 0.003 * 0.45, 1e-6);
  EXPECT_NEAR(own->blur_ratio.x(), -0.003 * 0.45, 1e-6);
  EXPECT_EQ(own->focus_depth_mm.norm() + own->image_distance_mm.norm(), 0);
  const Result& kappa = *c.calibration.summary.blur_ratio;
  EXPECT_NEAR(kappa.systematic->y() - kappa.value, 0.005 * 0.45, 1e-5);
  EXPECT_NEAR(kappa.value - kappa.systematic->x(), 0.005 * 0.45, 1e-5);
}

TEST(AddSystematicParts, OnEachEndTheFloorAddsToTheRest) {
  FocusCase c = FocusCase().WithTexture(kErrorPx2);
  c.sweep.floor.from_px = 0.4;
  c.sweep.floor.to_px = 0.6;
  c.sweep.camera.statements["lens.rear_focal_length_mm"] = {3e-4, false};
  c.sweep.camera.statements["lens.lens_thickness_mm"] = {4e-4, false};
  c.Solve();
  const SystematicPart* floor = c.Part("blur floor");
  ASSERT_NE(floor, nullptr);
  const double rest_mm = std::hypot(3e-4 * 400 / 387.5, 4e-4);
  const Result& d1 = *c.calibration.summary.image_distance_mm;
  EXPECT_NEAR(d1.systematic->x(), d1.value + floor->image_distance_mm.x() - rest_mm, 1e-6);
  EXPECT_NEAR(d1.systematic->y(), d1.value + floor->image_distance_mm.y() + rest_mm, 1e-6);
}

// Each end is widened by the parts that extend to its side.
TEST(AddSystematicParts, PartsThatMoveOneWayWidenOneEnd) {
  for (const double sign : {1.0, -1.0}) {
    FocusCase c = FocusCase().WithTexture(kErrorPx2).WithTrueFloor();
    BlurBench band = c.bench, shape = c.bench;
    band.focus_mm += sign * 0.8;
    shape.focus_mm += sign * 0.6;
    c.evidence.narrow_band = band.Relative(kErrorPx2, thicklens::testing::kReferencePx2, &c.random);
    c.evidence.other_psf = shape.Relative(kErrorPx2, thicklens::testing::kReferencePx2, &c.random);
    c.Solve();
    const Result& zf = *c.calibration.summary.focus_depth_mm;
    ASSERT_TRUE(zf.systematic);
    EXPECT_NEAR(zf.systematic->x(), zf.value - (sign > 0 ? 0 : 1), 0.01);
    EXPECT_NEAR(zf.systematic->y(), zf.value + (sign > 0 ? 1 : 0), 0.01);
  }
}

TEST(AddSystematicParts, TheShapesRemedyIsToStateTheBetterOne) {
  for (const model::Psf better : {model::Psf::kGaussian, model::Psf::kDisc}) {
    FocusCase c = FocusCase().WithTexture(kErrorPx2).WithTrueFloor();
    c.evidence.better_psf = better;
    c.evidence.gaussian_misfit = better == model::Psf::kGaussian ? 1.0 : 1.3;
    c.evidence.disc_misfit = better == model::Psf::kGaussian ? 1.3 : 1.0;
    c.evidence.other_psf = c.evidence.setup.estimators[0];
    c.Solve();
    const SystematicPart* part = c.Part("shape of the blur");
    ASSERT_NE(part, nullptr);
    EXPECT_THAT(part->remedy, better == model::Psf::kGaussian ? HasSubstr("no remedy")
                                                              : HasSubstr("state psf: disc"));
  }
}

TEST(AddSystematicParts, AShapeIsAdvisedOnlyWhereItFitsAndTheStatedOneFitsMarkedlyWorse) {
  struct Case {
    double gaussian, disc, dof;
    const char* remedy;
  };
  const Case cases[] = {
      {46, 45.8, 0, "neither blur shape fits the frames (misfit 46 for gaussian, 45.8 for disc"},
      {46, 40, 1000, "neither blur shape fits"},  // better beyond doubt, and still bad
      {1.3, 1.0, 1000, "state psf: disc"},
      {1.02, 1.0, 1000, "state psf: disc"},  // 20 in chi^2
      {1.01, 1.0, 1000, "both shapes fit about equally well"},
      {1.05, 1.0, 0, "both shapes fit about equally well"},
  };
  for (const Case& k : cases) {
    SCOPED_TRACE(k.remedy);
    FocusCase c = FocusCase().WithTexture(kErrorPx2).WithTrueFloor();
    c.evidence.gaussian_misfit = k.gaussian;
    c.evidence.disc_misfit = k.disc;
    c.evidence.shape_dof = k.dof;
    c.evidence.better_psf = model::Psf::kDisc;
    BlurBench other = c.bench;
    other.ratio *= 1.05;  // the other shape finds another kappa, or no advice would follow from it
    c.evidence.other_psf = other.Relative(kErrorPx2, thicklens::testing::kReferencePx2, &c.random);
    c.Solve();
    const SystematicPart* part = c.Part("shape of the blur");
    ASSERT_NE(part, nullptr);
    EXPECT_GT(part->blur_ratio.norm(), 0);
    EXPECT_THAT(part->remedy, HasSubstr(k.remedy));
    EXPECT_THAT(c.calibration.diagnostics.advice, Not(HasSubstr("no remedy")));
    if (k.disc > 3) {
      EXPECT_THAT(c.calibration.summary.warnings, Not(Contains(HasSubstr("the blur is a"))));
    }
  }
}

}  // namespace
}  // namespace thicklens::calib
