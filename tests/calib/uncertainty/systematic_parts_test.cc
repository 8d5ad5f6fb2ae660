#include "calib/uncertainty/systematic_parts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "tests/calib/blur_samples.h"
#include "thicklens/calib/error_budget.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::calib {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using thicklens::testing::BlurBench;

// A bench, the samples of its blur estimators and the fit to them, as in the pipeline at this step.
struct Solved {
  BlurBench bench;
  FocusSweep sweep;
  BlurEvidence evidence;
  BlurFitResult fit;
  Calibration calibration;

  void Fit() {
    fit = FitBlur(evidence.setup);
    ASSERT_TRUE(fit.done) << fit.message;
    const auto sigma = [&](BlurParameter p) { return std::sqrt(fit.covariance(p, p)); };
    const double zf = fit.values[kFocusDepth];
    calibration.summary.focus_depth_mm = Result{zf, sigma(kFocusDepth), std::nullopt};
    calibration.summary.blur_ratio =
        Result{fit.values[kBlurRatio], sigma(kBlurRatio), std::nullopt};
    calibration.summary.image_distance_mm = Result{
        model::ImageDistanceMm(bench.lens, zf),
        std::abs(model::ImageDistanceSlope(bench.lens, zf)) * sigma(kFocusDepth), std::nullopt};
  }
  void Add(const FloorInterval& floor = std::nullopt) {
    AddSystematicParts(sweep, evidence, fit, floor, &calibration);
  }
  const SystematicPart* Part(const std::string& name) const {
    for (const SystematicPart& part : calibration.diagnostics.systematic_parts) {
      if (part.name == name) return &part;
    }
    return nullptr;
  }
};

// A texture whose floor is fixed at its true value.
Solved Texture(double noise, double error_px2 = 0.01, unsigned seed = 1,
               const BlurBench& bench = {}) {
  Solved s;
  s.bench = bench;
  s.bench.noise = noise;
  std::mt19937 random(seed);
  s.evidence.setup = s.bench.Setup(&random);
  s.evidence.setup.estimators = {s.bench.Relative(error_px2, 1.2, &random)};
  s.evidence.setup.floor_variance_px2 = model::Estimate{s.bench.floor_px2, 0};
  s.evidence.spectrum = 0;
  for (std::size_t i = 0; i < s.evidence.setup.frames.size(); ++i) s.evidence.frames.push_back(i);
  s.sweep.camera.lens = s.bench.lens;
  s.sweep.camera.sensor.pixel_pitch_mm = s.bench.pitch_mm;
  s.Fit();
  return s;
}

// A floor that is wrong by dS0 moves zf by zf dS0/(A uf^2 - dS0), and kappa with sqrt(A uf^2 - dS0)
// (zf - f1).
TEST(AddSystematicParts, TheFloorsEndsMoveTheResultsAsDerived) {
  Solved s = Texture(0);
  const Eigen::Vector2d floor(0.05, 0.65);
  s.Add(floor);
  const SystematicPart* part = s.Part("blur floor");
  ASSERT_TRUE(part);
  const double curvature = s.bench.Curvature(), zf = s.bench.focus_mm;
  const double f1 = s.bench.lens.front_focal_length_mm;
  for (int end = 0; end < 2; ++end) {
    const double off_px2 = floor[end] - s.bench.floor_px2;
    const double move_mm = zf * off_px2 / (curvature - off_px2);
    EXPECT_NEAR(part->focus_depth_mm[end], move_mm, 1e-3);
    EXPECT_NEAR(move_mm, zf * off_px2 / curvature, 0.01 * std::abs(move_mm));
    EXPECT_NEAR(s.calibration.summary.focus_depth_mm->systematic.value()[end], zf + move_mm, 1e-3);
    const double ratio =
        s.bench.ratio * std::sqrt(1 - off_px2 / curvature) * (zf + move_mm - f1) / (zf - f1);
    const bool rises = ratio > s.bench.ratio;
    EXPECT_NEAR(part->blur_ratio[rises ? 1 : 0], ratio - s.bench.ratio, 1e-5);
    // d1 decreases if zf increases.
    EXPECT_NEAR(part->image_distance_mm[1 - end],
                model::ImageDistanceMm(s.bench.lens, zf + move_mm) -
                    model::ImageDistanceMm(s.bench.lens, zf),
                1e-5);
  }
  EXPECT_THAT(part->remedy, HasSubstr("knife edge"));
}

TEST(AddSystematicParts, WithoutAnIntervalTheFloorIsNoPart) {
  Solved s = Texture(0);
  s.Add();
  EXPECT_FALSE(s.Part("blur floor"));
  // The limited accuracy of the blur estimator affects kappa only.
  ASSERT_TRUE(s.calibration.summary.focus_depth_mm->systematic);
  EXPECT_NEAR((*s.calibration.summary.focus_depth_mm->systematic)[0], s.bench.focus_mm, 1e-3);
  EXPECT_NEAR((*s.calibration.summary.focus_depth_mm->systematic)[1], s.bench.focus_mm, 1e-3);
  const Eigen::Vector2d kappa = s.calibration.summary.blur_ratio->systematic.value();
  EXPECT_LT(kappa[0], s.bench.ratio);
  EXPECT_GT(kappa[1], s.bench.ratio);
}

// Every interval contains its value, whatever moved its ends.
void ExpectOrdered(const Calibration& c) {
  for (const SystematicPart& part : c.diagnostics.systematic_parts) {
    for (const Eigen::Vector2d& ends :
         {part.focus_depth_mm, part.image_distance_mm, part.blur_ratio}) {
      EXPECT_LE(ends[0], 0) << part.name;
      EXPECT_GE(ends[1], 0) << part.name;
    }
    EXPECT_NE(part.remedy, "") << part.name;
  }
  for (const auto& result :
       {c.summary.focus_depth_mm, c.summary.image_distance_mm, c.summary.blur_ratio}) {
    EXPECT_LE(result->systematic.value()[0], result->value);
    EXPECT_GE(result->systematic.value()[1], result->value);
  }
}

// zf follows from depths and blur alone; d1 = rho + f2 zf/(zf - f1), kappa = sqrt(A uf^2) p (zf -
// f1)/(r f1).
TEST(AddSystematicParts, StatedTolerancesMoveTheResultsAsTheFormulasSay) {
  struct Expected {
    const char* field;
    double tolerance, image_distance_mm, relative_ratio;
  };
  const BlurBench bench;
  const double f1 = bench.lens.front_focal_length_mm, f2 = bench.lens.rear_focal_length_mm;
  const double zf = bench.focus_mm;
  const Expected all[] = {
      {"lens.front_focal_length_mm", 0.02, 0.02 * f2 * zf / std::pow(zf - f1, 2),
       0.02 * zf / (f1 * (zf - f1))},
      {"lens.rear_focal_length_mm", 0.05, 0.05 * zf / (zf - f1), 0},
      {"lens.lens_thickness_mm", 0.3, 0.3, 0},
      {"lens.aperture_radius_mm", 0.01 * bench.lens.aperture_radius_mm, 0, 0.01},
      {"sensor.pixel_pitch_mm", 0.02 * bench.pitch_mm, 0, 0.02},
  };
  Solved s = Texture(0);
  double squares = 0;
  for (const Expected& e : all) {
    s.sweep.camera.statements[e.field] = {e.tolerance, false};
    squares += e.image_distance_mm * e.image_distance_mm;
  }
  s.sweep.camera.statements["lens.name"] = {0, true};
  s.sweep.camera.statements["sensor.principal_point_px[0]"] = {4, false};
  s.Add();
  for (const Expected& e : all) {
    const SystematicPart* part = s.Part(e.field);
    ASSERT_TRUE(part) << e.field;
    EXPECT_NEAR(part->focus_depth_mm.norm(), 0, 1e-3) << e.field;
    for (int end = 0; end < 2; ++end) {
      EXPECT_NEAR(std::abs(part->image_distance_mm[end]), e.image_distance_mm,
                  0.01 * e.image_distance_mm + 1e-6)
          << e.field;
      EXPECT_NEAR(std::abs(part->blur_ratio[end]) / bench.ratio, e.relative_ratio,
                  0.02 * e.relative_ratio + 1e-5)
          << e.field;
    }
    EXPECT_THAT(part->remedy, HasSubstr(e.field));
  }
  EXPECT_FALSE(s.Part("lens.name"));
  EXPECT_FALSE(s.Part("sensor.principal_point_px[0]"));
  ExpectOrdered(s.calibration);
  // The parts are added in quadrature, separately for each side.
  const Result& d1 = *s.calibration.summary.image_distance_mm;
  EXPECT_NEAR(d1.systematic.value()[1] - d1.value, std::sqrt(squares), 0.01 * std::sqrt(squares));
  EXPECT_NEAR(d1.value - (*d1.systematic)[0], std::sqrt(squares), 0.01 * std::sqrt(squares));
}

// The end of an interval is as likely as its middle, so the floor is added linearly, while the
// others are added in quadrature.
TEST(AddSystematicParts, TheFloorAddsAndTheRestGoesInQuadrature) {
  Solved s = Texture(0);
  s.sweep.camera.statements["lens.rear_focal_length_mm"] = {3e-4, false};
  s.sweep.camera.statements["lens.lens_thickness_mm"] = {4e-4, false};
  s.Add(Eigen::Vector2d(0.05, 0.65));
  const double floor_mm = s.Part("blur floor")->image_distance_mm[1];
  ASSERT_GT(floor_mm, 3e-4);
  const Result& d1 = *s.calibration.summary.image_distance_mm;
  EXPECT_NEAR(d1.systematic.value()[1] - d1.value, floor_mm + std::hypot(3.097e-4, 4e-4), 1e-5);
}

TEST(AddSystematicParts, TheNarrowBandsAnswerIsAPart) {
  Solved s = Texture(0);
  BlurBench other = s.bench;
  other.focus_mm += 0.8;
  std::mt19937 random(1);
  s.evidence.narrow_band = other.Relative(0.01, 1.2, &random);
  s.Add();
  const SystematicPart* part = s.Part("frequency band");
  ASSERT_TRUE(part);
  EXPECT_NEAR(part->focus_depth_mm[1], 0.8, 0.01);
  EXPECT_EQ(part->focus_depth_mm[0], 0);
  EXPECT_NEAR((*s.calibration.summary.focus_depth_mm->systematic)[1], s.bench.focus_mm + 0.8, 0.01);
}

TEST(AddSystematicParts, AnotherShapeMovesTheDepthAlone) {
  Solved s = Texture(0);
  BlurBench other = s.bench;
  other.focus_mm -= 0.5;
  other.ratio *= 1.1;
  std::mt19937 random(1);
  s.evidence.other_psf = other.Relative(0.01, 1.2, &random);
  s.evidence.gaussian_misfit = 1.0;
  s.evidence.shape_dof = 1000;
  // chi^2 is larger by 20, so this kappa is that of a shape that the blur does not have.
  s.evidence.disc_misfit = 1.02;
  s.Add();
  const SystematicPart* part = s.Part("shape of the blur");
  ASSERT_TRUE(part);
  EXPECT_NEAR(part->focus_depth_mm[0], -0.5, 0.01);
  EXPECT_EQ(part->blur_ratio.norm(), 0);
}

// A family that the frames do not exclude may be the right one.
TEST(AddSystematicParts, AFamilyThatIsNotRuledOutMovesTheRatio) {
  Solved s = Texture(0);
  BlurBench other = s.bench;
  other.ratio *= 1.1;
  std::mt19937 random(1);
  s.evidence.other_psf = other.Relative(0.01, 1.2, &random);
  s.evidence.gaussian_misfit = 1.0;
  s.evidence.shape_dof = 1000;
  s.evidence.disc_misfit = 1.01;
  s.Add();
  const SystematicPart* part = s.Part("shape of the blur");
  ASSERT_TRUE(part);
  EXPECT_NEAR(part->blur_ratio[1] / s.bench.ratio, 0.1, 0.01);
  EXPECT_EQ(part->blur_ratio[0], 0);
}

TEST(AddSystematicParts, FramesThatWereThrownOutStayOut) {
  Solved s = Texture(0);
  BlurBench other = s.bench;
  other.focus_mm += 0.8;
  std::mt19937 random(1);
  s.evidence.narrow_band = other.Relative(0.01, 1.2, &random);
  s.evidence.narrow_band->variances_px2[4] += 40;  // damaged, and no longer in the fit
  BlurSamples& estimator = s.evidence.setup.estimators[0];
  std::vector<Eigen::Index> kept;
  for (Eigen::Index i = 0; i < s.bench.count; ++i) {
    if (i != 4) kept.push_back(i);
  }
  estimator.frames.erase(estimator.frames.begin() + 4);
  estimator.variances_px2 = Eigen::VectorXd(estimator.variances_px2(kept));
  estimator.covariance = Eigen::MatrixXd(estimator.covariance(kept, kept));
  s.Fit();
  s.Add();
  EXPECT_NEAR(s.Part("frequency band")->focus_depth_mm[1], 0.8, 0.01);
}

TEST(AddSystematicParts, TwoMetersThatDisagreeAreDistinguished) {
  Solved s = Texture(0);
  BlurBench in_front = s.bench;
  in_front.focus_mm += 1;
  std::mt19937 random(1);
  BlurSamples edge = in_front.Absolute(0.01, 0, &random);
  edge.held_softness_px2 = 0;
  s.evidence.setup.estimators.push_back(edge);
  s.evidence.edges = 1;
  s.Fit();
  const double joint_mm = s.fit.values[kFocusDepth];
  ASSERT_GT(joint_mm, s.bench.focus_mm + 0.2);
  ASSERT_LT(joint_mm, s.bench.focus_mm + 0.9);
  s.Add();
  const SystematicPart* part = s.Part("edges against texture");
  ASSERT_TRUE(part);
  EXPECT_NEAR(joint_mm + part->focus_depth_mm[0], s.bench.focus_mm, 0.02);
  EXPECT_NEAR(joint_mm + part->focus_depth_mm[1], s.bench.focus_mm + 1, 0.02);
}

TEST(AddSystematicParts, TheAdviceNamesTheLargestPartWithARemedy) {
  Solved floor = Texture(0, 1e-3);
  floor.sweep.camera.statements["lens.rear_focal_length_mm"] = {1e-5, false};
  floor.Add(Eigen::Vector2d(0, 0.49));
  // The accuracy of the estimator is larger here, and has no remedy.
  EXPECT_EQ(floor.calibration.diagnostics.systematic_parts[0].name, "blur estimator");
  EXPECT_EQ(floor.calibration.diagnostics.systematic_parts[1].name, "blur floor");
  EXPECT_THAT(floor.calibration.diagnostics.advice,
              AllOf(HasSubstr(" % is due to the blur floor: "), HasSubstr("knife edge")));

  Solved tolerance = Texture(0, 1e-3);
  tolerance.sweep.camera.statements["lens.rear_focal_length_mm"] = {0.2, false};
  tolerance.Add(Eigen::Vector2d(0, 0.49));
  EXPECT_EQ(tolerance.calibration.diagnostics.systematic_parts.front().name,
            "lens.rear_focal_length_mm");
  EXPECT_THAT(tolerance.calibration.diagnostics.advice,
              AllOf(HasSubstr(" % of the error is due to lens.rear_focal_length_mm: "),
                    HasSubstr("better than +- 0.2")));

  Solved noise = Texture(0, 0.5);
  noise.sweep.camera.statements["lens.rear_focal_length_mm"] = {1e-5, false};
  noise.Add();
  EXPECT_THAT(noise.calibration.diagnostics.advice, HasSubstr("is due to noise and readings"));

  for (const Solved* s : {&floor, &tolerance, &noise}) {
    ExpectOrdered(s->calibration);
    // The parts have the order of the terms.
    std::vector<std::string> names, terms;
    for (const SystematicPart& part : s->calibration.diagnostics.systematic_parts)
      names.push_back(part.name);
    for (const ErrorTerm& term : ErrorTerms(s->calibration)) {
      if (!term.is_statistical) terms.push_back(term.name);
    }
    EXPECT_EQ(names, terms);
  }
}

// ---- the sides of focus ----

TEST(FitSides, AgreeOnExactData) {
  Solved s = Texture(0);
  FitSides(s.evidence, s.fit, &s.calibration);
  int frames = 0;
  for (const SideFit* side :
       {&s.calibration.diagnostics.nearer, &s.calibration.diagnostics.farther}) {
    ASSERT_TRUE(side->done) << side->message;
    EXPECT_NEAR(side->focus_depth_mm.value, s.bench.focus_mm, 0.01);
    EXPECT_NEAR(side->blur_ratio.value, s.bench.ratio, 1e-4);
    EXPECT_GT(side->focus_depth_mm.sigma, 0);
    frames += side->frames_used;
  }
  EXPECT_EQ(frames, 31);
  s.Add();
  EXPECT_FALSE(s.Part("side of focus"));
  EXPECT_TRUE(s.calibration.summary.warnings.empty());
}

// If one law holds on both sides, their difference is due to chance and agrees with the stated
// sigma.
TEST(FitSides, DifferOnCleanDataByNoMoreThanChance) {
  for (const double reading_sigma_mm : {0.0, 0.1}) {
    SCOPED_TRACE(reading_sigma_mm);
    BlurBench bench;
    bench.reading_sigma_mm = reading_sigma_mm;
    constexpr int kRuns = 200;
    int disagree = 0;
    double squares = 0;
    for (unsigned seed = 0; seed < kRuns; ++seed) {
      Solved s = Texture(1, 0.02, 900 + seed, bench);
      FitSides(s.evidence, s.fit, &s.calibration);
      const SideFit &nearer = s.calibration.diagnostics.nearer,
                    &farther = s.calibration.diagnostics.farther;
      ASSERT_TRUE(nearer.done && farther.done);
      const double apart = (nearer.focus_depth_mm.value - farther.focus_depth_mm.value) /
                           std::hypot(nearer.focus_depth_mm.sigma, farther.focus_depth_mm.sigma);
      squares += apart * apart / kRuns;
      s.Add();
      disagree += s.Part("side of focus") != nullptr ? 1 : 0;
    }
    EXPECT_LT(std::sqrt(squares), 1.25);
    EXPECT_GT(std::sqrt(squares), 0.6);
    EXPECT_LE(disagree, 3);
  }
}

// Spherical aberration: the slope of the blur differs between the sides.
TEST(FitSides, DisagreeWhereTwoModelsWereMixed) {
  Solved s = Texture(1, 0.02);
  BlurBench steeper = s.bench;
  steeper.ratio *= 1.1;
  steeper.noise = 0;
  std::mt19937 random(1);
  BlurSamples& estimator = s.evidence.setup.estimators[0];
  const BlurSamples other = steeper.Relative(0.02, 1.2, &random);
  for (Eigen::Index i = 0; i < estimator.variances_px2.size(); ++i) {
    const double depth_mm = s.bench.Depth(static_cast<std::size_t>(i));
    if (depth_mm < s.bench.focus_mm) estimator.variances_px2[i] = other.variances_px2[i];
  }
  s.Fit();
  FitSides(s.evidence, s.fit, &s.calibration);
  s.Add();
  EXPECT_THAT(s.calibration.summary.warnings,
              Contains(AllOf(HasSubstr("two sides of focus disagree"), HasSubstr("nearer"))));
  const SystematicPart* part = s.Part("side of focus");
  ASSERT_TRUE(part);
  EXPECT_NEAR(
      part->focus_depth_mm[0] + s.fit.values[kFocusDepth],
      std::min({s.calibration.diagnostics.nearer.focus_depth_mm.value,
                s.calibration.diagnostics.farther.focus_depth_mm.value, s.fit.values[kFocusDepth]}),
      1e-9);
  ExpectOrdered(s.calibration);
}

TEST(FitSides, SixFramesAreNeededOnASide) {
  BlurBench bench;
  bench.first_mm = 385;  // five frames are nearer than 400 mm
  bench.last_mm = 385 + 3.3 * 30;
  bench.reference = 4;
  Solved s = Texture(0, 0.01, 1, bench);
  FitSides(s.evidence, s.fit, &s.calibration);
  EXPECT_FALSE(s.calibration.diagnostics.nearer.done);
  EXPECT_EQ(s.calibration.diagnostics.nearer.frames_used, 5);
  EXPECT_THAT(s.calibration.diagnostics.nearer.message,
              HasSubstr("5 frames are on this side, but 6 are needed"));
  EXPECT_TRUE(s.calibration.diagnostics.farther.done);
}

TEST(FitSides, AKnifeEdgesSidesAgree) {
  Solved s = Texture(0);
  std::mt19937 random(1);
  s.evidence.setup.estimators = {s.bench.Absolute(0.01, 0, &random)};
  s.evidence.setup.estimators[0].held_softness_px2 = 0;
  s.evidence.setup.floor_variance_px2.reset();
  s.evidence.spectrum = -1;
  s.evidence.edges = 0;
  s.Fit();
  FitSides(s.evidence, s.fit, &s.calibration);
  for (const SideFit* side :
       {&s.calibration.diagnostics.nearer, &s.calibration.diagnostics.farther}) {
    ASSERT_TRUE(side->done) << side->message;
    EXPECT_NEAR(side->focus_depth_mm.value, s.bench.focus_mm, 0.01);
  }
}

}  // namespace
}  // namespace thicklens::calib
