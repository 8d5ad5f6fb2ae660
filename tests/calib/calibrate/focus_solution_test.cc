// Contents of a solution: the values, their errors, and how well the floor is known.
#include "calib/calibrate/focus_solution.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/calib/focus_case.h"

namespace thicklens::calib {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using thicklens::testing::BlurBench;
using thicklens::testing::ExactBench;
using thicklens::testing::FocusCase;
using thicklens::testing::LinearReference;

constexpr double kErrorPx2 = 0.01;

void ExpectTrueFocus(const FocusCase& c, double within_mm) {
  const Calibration& found = c.calibration;
  ASSERT_TRUE(found.summary.focus_depth_mm && found.summary.image_distance_mm &&
              found.summary.blur_ratio)
      << found.summary.reason;
  EXPECT_NEAR(found.summary.focus_depth_mm->value, c.bench.focus_mm, within_mm);
  EXPECT_NEAR(found.summary.blur_ratio->value, c.bench.ratio, 0.01 * within_mm);
  EXPECT_EQ(found.summary.image_distance_mm->value,
            model::ImageDistanceMm(c.bench.lens, found.summary.focus_depth_mm->value));
}

// d1 is computed from differences of the imaging equation, not from the formula of its slope.
void ExpectImageDistanceSigma(const FocusCase& c) {
  const Result& zf = *c.calibration.summary.focus_depth_mm;
  const double h = 1e-3;
  const double slope = (model::ImageDistanceMm(c.bench.lens, zf.value + h) -
                        model::ImageDistanceMm(c.bench.lens, zf.value - h)) /
                       (2 * h);
  ASSERT_GT(zf.sigma, 0);
  EXPECT_NEAR(c.calibration.summary.image_distance_mm->sigma, std::abs(slope) * zf.sigma,
              1e-6 * std::abs(slope) * zf.sigma);
}

// The covariance is compared with linear error propagation, in the stated order of the rows of the
// reference.
void ExpectCovariance(const Calibration& c, const Eigen::Matrix4d& reference,
                      const std::vector<int>& rows) {
  ASSERT_EQ(c.diagnostics.covariance.rows(), static_cast<Eigen::Index>(rows.size()));
  ASSERT_EQ(c.diagnostics.covariance.cols(), c.diagnostics.covariance.rows());
  const Eigen::MatrixXd expected = reference(rows, rows);
  for (Eigen::Index a = 0; a < expected.rows(); ++a) {
    for (Eigen::Index b = 0; b < expected.cols(); ++b) {
      EXPECT_NEAR(c.diagnostics.covariance(a, b), expected(a, b),
                  2e-3 * std::sqrt(expected(a, a) * expected(b, b)))
          << a << ", " << b;
    }
  }
  EXPECT_NEAR(c.summary.image_distance_mm->sigma, std::sqrt(c.diagnostics.covariance(0, 0)),
              1e-9 * c.summary.image_distance_mm->sigma);
  EXPECT_NEAR(c.summary.blur_ratio->sigma, std::sqrt(c.diagnostics.covariance(1, 1)),
              1e-9 * c.summary.blur_ratio->sigma);
}

// ---- a floor that is given ----

TEST(SolveFocus, AGivenFloorIsWrittenWithItsError) {
  FocusCase c = FocusCase().WithTexture(kErrorPx2).WithTrueFloor(0.03);
  c.Solve();
  EXPECT_EQ(c.calibration.summary.outcome, Outcome::kOk);
  EXPECT_EQ(c.calibration.summary.reason, "");
  EXPECT_THAT(c.calibration.summary.warnings, IsEmpty());
  EXPECT_THAT(c.calibration.diagnostics.blur.undetermined, IsEmpty());
  ExpectTrueFocus(c, 1e-3);
  ExpectImageDistanceSigma(c);
  ASSERT_TRUE(c.calibration.summary.blur_floor_px);
  EXPECT_NEAR(c.calibration.summary.blur_floor_px->value, 0.5, 1e-4);
  // A texture contains almost no information about the floor, so the error of the floor stays the
  // same.
  EXPECT_NEAR(c.calibration.summary.blur_floor_px->sigma, 0.03, 1e-4);
  EXPECT_FALSE(c.calibration.summary.blur_floor_px->systematic);
  EXPECT_THAT(c.calibration.diagnostics.covariance_order,
              ElementsAre("image_distance_mm", "blur_ratio", "blur_floor_px", "bench_offset_mm"));
  LinearReference reference{kErrorPx2, true, 0.03};
  ExpectCovariance(c.calibration, reference.Covariance(c.bench), {0, 1, 2, 3});
  // The floor has no interval, and therefore no systematic part.
  EXPECT_EQ(c.Part("blur floor"), nullptr);
}

// The error of the floor enters zf: dzf = zf dS0/(A uf^2), where S0 is the floor squared.
TEST(SolveFocus, AGivenFloorsErrorIsInTheFocus) {
  FocusCase c = FocusCase().WithTexture(1e-4).WithTrueFloor(0.05);
  c.Solve();
  const double by_floor_mm = c.bench.focus_mm * 2 * 0.5 * 0.05 / c.bench.Curvature();
  EXPECT_NEAR(c.calibration.summary.focus_depth_mm->sigma, by_floor_mm, 0.01 * by_floor_mm);
}

TEST(SolveFocus, AFloorWithoutErrorStaysWhatItIs) {
  FocusCase c = FocusCase().WithTexture(kErrorPx2).WithTrueFloor();
  c.Solve();
  EXPECT_EQ(c.calibration.summary.outcome, Outcome::kOk);
  ExpectTrueFocus(c, 1e-3);
  ASSERT_TRUE(c.calibration.summary.blur_floor_px);
  EXPECT_NEAR(c.calibration.summary.blur_floor_px->value, 0.5, 1e-12);
  EXPECT_EQ(c.calibration.summary.blur_floor_px->sigma, 0);
  LinearReference reference{kErrorPx2, true, 0, true};
  ExpectCovariance(c.calibration, reference.Covariance(c.bench), {0, 1, 2, 3});
}

TEST(SolveFocus, APerfectLensMayBeStated) {
  BlurBench bench = ExactBench();
  bench.floor_px2 = 0;
  FocusCase c = FocusCase(bench).WithTexture(kErrorPx2).WithFloor(0, 0);
  c.Solve();
  EXPECT_EQ(c.calibration.summary.outcome, Outcome::kOk);
  ExpectTrueFocus(c, 1e-3);
  EXPECT_EQ(c.calibration.summary.blur_floor_px->value, 0);
  EXPECT_EQ(c.calibration.summary.blur_floor_px->sigma, 0);
  EXPECT_TRUE(c.calibration.diagnostics.covariance.allFinite());
}

// ---- a knife edge measures it ----

TEST(SolveFocus, AKnifeEdgeMeasuresTheFloor) {
  FocusCase c = FocusCase().WithKnifeEdge(kErrorPx2);
  c.Solve();
  EXPECT_EQ(c.calibration.summary.outcome, Outcome::kOk) << c.calibration.summary.reason;
  ExpectTrueFocus(c, 1e-3);
  ExpectImageDistanceSigma(c);
  ASSERT_TRUE(c.calibration.summary.blur_floor_px);
  EXPECT_NEAR(c.calibration.summary.blur_floor_px->value, 0.5, 1e-4);
  const Eigen::Matrix4d reference = LinearReference{kErrorPx2}.Covariance(c.bench);
  EXPECT_NEAR(c.calibration.summary.blur_floor_px->sigma, std::sqrt(reference(2, 2)),
              1e-3 * std::sqrt(reference(2, 2)));
  EXPECT_THAT(c.calibration.diagnostics.covariance_order,
              ElementsAre("image_distance_mm", "blur_ratio", "blur_floor_px", "bench_offset_mm"));
  ExpectCovariance(c.calibration, reference, {0, 1, 2, 3});
  EXPECT_EQ(c.calibration.diagnostics.blur.estimator, "edges");
  EXPECT_EQ(c.Part("blur floor"), nullptr);
}

TEST(SolveFocus, AKnifeEdgeBesideATextureFixesTheTexturesFloorToo) {
  FocusCase c = FocusCase().WithTexture(kErrorPx2).WithKnifeEdge(kErrorPx2);
  c.Solve();
  EXPECT_EQ(c.calibration.summary.outcome, Outcome::kOk);
  ExpectTrueFocus(c, 1e-3);
  EXPECT_NEAR(c.calibration.summary.blur_floor_px->value, 0.5, 1e-4);
  EXPECT_EQ(c.calibration.diagnostics.blur.estimator, "edges and relative spectrum");
  // Frames are counted, not samples.
  EXPECT_EQ(c.calibration.diagnostics.blur.frames_used, c.bench.count);
}

TEST(SolveFocus, WhatIsGivenCountsMoreThanTheKnifeEdge) {
  FocusCase c = FocusCase().WithKnifeEdge(0.3).WithFloor(0.6, 0.001);
  c.Solve();
  EXPECT_NEAR(c.calibration.summary.blur_floor_px->value, 0.6, 0.01);
  EXPECT_LT(c.calibration.summary.blur_floor_px->sigma, 0.0011);
}

// The lens is so sharp that the edge cannot distinguish its floor from 0.
TEST(SolveFocus, AFloorBelowItsOwnErrorIsLeftOpen) {
  BlurBench bench = ExactBench();
  bench.floor_px2 = 1e-4;
  FocusCase c = FocusCase(bench).WithKnifeEdge(kErrorPx2);
  c.Solve();
  EXPECT_EQ(c.calibration.summary.outcome, Outcome::kPartial);
  EXPECT_THAT(c.calibration.diagnostics.blur.undetermined, ElementsAre("blur_floor_px"));
  EXPECT_FALSE(c.calibration.summary.blur_floor_px);
  EXPECT_THAT(c.calibration.diagnostics.covariance_order,
              ElementsAre("image_distance_mm", "blur_ratio", "bench_offset_mm"));
  EXPECT_EQ(c.calibration.diagnostics.covariance.rows(), 3);
  ExpectTrueFocus(c, 1e-2);
}

// ---- an interval ----

// Checks everything that is stated about an interval (px), given or found.
void ExpectInterval(const FocusCase& c, double from_px, double to_px, double within_px) {
  const Calibration& found = c.calibration;
  EXPECT_EQ(found.summary.outcome, Outcome::kPartial);
  EXPECT_THAT(found.summary.reason, HasSubstr("the blur floor is not determined"));
  EXPECT_THAT(found.diagnostics.blur.undetermined, ElementsAre("blur_floor_px"));
  ASSERT_TRUE(found.summary.blur_floor_px && found.summary.blur_floor_px->systematic);
  EXPECT_TRUE(std::isnan(found.summary.blur_floor_px->value));
  EXPECT_TRUE(std::isnan(found.summary.blur_floor_px->sigma));
  EXPECT_NEAR(found.summary.blur_floor_px->systematic->x(), from_px, within_px);
  EXPECT_NEAR(found.summary.blur_floor_px->systematic->y(), to_px, within_px);
  EXPECT_THAT(found.diagnostics.covariance_order,
              ElementsAre("image_distance_mm", "blur_ratio", "bench_offset_mm"));
  EXPECT_EQ(found.diagnostics.covariance.rows(), 3);
  EXPECT_TRUE(found.diagnostics.covariance.allFinite());
}

// Returns zf for a floor. The vertex of the parabola that the blur follows on the target does not
// depend on the assumed floor: vertex = zf (1 - S0/(A uf^2 + S0)).
double FocusWithFloor(const BlurBench& bench, double floor_px2) {
  const double a_px2 = bench.Curvature() + bench.floor_px2;
  const double vertex_mm = bench.focus_mm * bench.Curvature() / a_px2;
  return vertex_mm * a_px2 / (a_px2 - floor_px2);
}

TEST(SolveFocus, AnIntervalIsAnIntervalOfTheFocus) {
  FocusCase c = FocusCase().WithTexture(kErrorPx2);
  c.sweep.floor.from_px = 0.3;
  c.sweep.floor.to_px = 0.8;
  c.Solve();
  ExpectInterval(c, 0.3, 0.8, 1e-12);
  // The mean of the squares is assumed.
  const double middle_px2 = 0.5 * (0.09 + 0.64);
  EXPECT_NEAR(c.calibration.summary.focus_depth_mm->value, FocusWithFloor(c.bench, middle_px2),
              1e-3);
  ASSERT_TRUE(c.calibration.summary.focus_depth_mm->systematic);
  EXPECT_NEAR(c.calibration.summary.focus_depth_mm->systematic->x(), FocusWithFloor(c.bench, 0.09),
              1e-2);
  EXPECT_NEAR(c.calibration.summary.focus_depth_mm->systematic->y(), FocusWithFloor(c.bench, 0.64),
              1e-2);
  ASSERT_NE(c.Part("blur floor"), nullptr);
  // The floor was stated, so there is no warning.
  EXPECT_THAT(c.calibration.summary.warnings, IsEmpty());
  // The remaining rows equal those of the reference with a fixed floor.
  BlurBench assumed = c.bench;
  assumed.floor_px2 = middle_px2;
  assumed.focus_mm = c.calibration.summary.focus_depth_mm->value;
  assumed.ratio = c.calibration.summary.blur_ratio->value;
  ExpectCovariance(c.calibration, LinearReference{kErrorPx2, true, 0, true}.Covariance(assumed),
                   {0, 1, 3});
}

// The fine detail of this texture is unknown, so a soft lens cannot be excluded.
TEST(SolveFocus, AnUnknownFloorIsUpToASoftLens) {
  FocusCase c = FocusCase().WithTexture(kErrorPx2);
  c.Solve();
  ExpectInterval(c, 0, 3, 1e-12);
  EXPECT_NEAR(c.calibration.summary.focus_depth_mm->value, FocusWithFloor(c.bench, 4.5), 1e-2);
  EXPECT_THAT(c.calibration.summary.warnings,
              ElementsAre(AllOf(HasSubstr("this target does not determine the blur floor"),
                                HasSubstr("0 to 3.0 px"), HasSubstr("state blur_floor_px"))));
}

// The edges show the blur of lens and ink together: sqrt(0.25 + 0.39) px.
constexpr double kInkPx2 = 0.39;

TEST(SolveFocus, PrintedEdgesBoundTheFloor) {
  FocusCase c = FocusCase().WithPrintedEdge(kErrorPx2, kInkPx2);
  c.Solve();
  ExpectInterval(c, 0, 0.8, 0.02);  // the ink is fitted as if it were lens blur
  EXPECT_THAT(c.calibration.summary.warnings,
              ElementsAre(AllOf(HasSubstr("px at focus"), HasSubstr("knife edge"))));
  const Eigen::Vector2d& zf = *c.calibration.summary.focus_depth_mm->systematic;
  EXPECT_LT(zf.x(), c.bench.focus_mm - 0.2);
  EXPECT_GT(zf.y(), c.bench.focus_mm + 0.2);
}

TEST(SolveFocus, EdgesOfATextureBoundTheFloor) {
  FocusCase c = FocusCase().WithTexture(kErrorPx2);
  // Nine frames about focus, as the measurement selects them. One of them is spoilt.
  BlurSamples edges = c.bench.Absolute(kErrorPx2, kInkPx2, &c.random);
  const std::vector<Eigen::Index> about = {10, 11, 12, 13, 14, 15, 16, 17, 18};
  c.evidence.unstated_edges = BlurSamples{};
  for (const Eigen::Index i : about)
    c.evidence.unstated_edges->frames.push_back(static_cast<std::size_t>(i));
  c.evidence.unstated_edges->variances_px2 = edges.variances_px2(about);
  c.evidence.unstated_edges->variances_px2[2] += 5;
  c.Solve();
  ExpectInterval(c, 0, 0.8, 0.02);
  EXPECT_THAT(c.calibration.summary.warnings, ElementsAre(HasSubstr("px at focus")));
  EXPECT_EQ(c.calibration.diagnostics.blur.estimator, "relative spectrum");
}

// Frames off focus, whose scale differs from that of the reference, give the same bound, although a
// weaker one.
TEST(SolveFocus, EdgesOfATextureBoundTheFloorOnOneSideToo) {
  FocusCase c = FocusCase().WithTexture(kErrorPx2);
  const BlurSamples edges = c.bench.Absolute(kErrorPx2, kInkPx2, &c.random);
  const std::vector<Eigen::Index> nearer = {1, 2, 3, 4, 5, 6, 7};
  c.evidence.unstated_edges = BlurSamples{};
  c.evidence.unstated_edges->frames = {1, 2, 3, 4, 5, 6, 7};
  c.evidence.unstated_edges->variances_px2 = edges.variances_px2(nearer);
  c.Solve();
  ExpectInterval(c, 0, 0.8, 0.1);
}

// Edges that seem sharper than possible give no bound.
TEST(SolveFocus, EdgesWithoutSoftnessAreNoBound) {
  FocusCase c = FocusCase().WithPrintedEdge(kErrorPx2, -0.6);
  c.Solve();
  ExpectInterval(c, 0, 1, 1e-12);
  EXPECT_THAT(c.calibration.summary.warnings, ElementsAre(HasSubstr("0 to 1.0 px")));
}

TEST(SolveFocus, EdgesOfATextureWithoutSoftnessAreNoBoundEither) {
  FocusCase c = FocusCase().WithTexture(kErrorPx2);
  c.evidence.unstated_edges = c.bench.Absolute(kErrorPx2, -0.6, &c.random);
  c.Solve();
  EXPECT_EQ(c.calibration.summary.outcome, Outcome::kPartial);
  EXPECT_THAT(c.calibration.summary.warnings, ElementsAre(HasSubstr("are allowed for")));
}

// ---- the bench offset ----

TEST(SolveFocus, TheBenchZerosErrorIsInTheCovariance) {
  constexpr double kZeroSigmaMm = 0.6;
  FocusCase c = FocusCase(ExactBench(), kZeroSigmaMm).WithTexture(kErrorPx2).WithTrueFloor(0.03);
  c.Solve();
  ASSERT_EQ(c.calibration.diagnostics.covariance.rows(), 4);
  EXPECT_NEAR(c.calibration.diagnostics.covariance(3, 3), kZeroSigmaMm * kZeroSigmaMm, 1e-9);
  LinearReference reference{kErrorPx2, true, 0.03};
  reference.offset_sigma_mm = kZeroSigmaMm;
  ExpectCovariance(c.calibration, reference.Covariance(c.bench), {0, 1, 2, 3});
  // If the zero is too large, zf is too large and d1 too small.
  EXPECT_LT(c.calibration.diagnostics.covariance(0, 3), 0);
  EXPECT_GT(c.calibration.summary.focus_depth_mm->sigma, 0.9 * kZeroSigmaMm);
}

// ---- messages about the blur ----

TEST(SolveFocus, MessagesOfTheMetersAreKept) {
  FocusCase c = FocusCase().WithTexture(kErrorPx2).WithTrueFloor();
  c.evidence.gaussian_misfit = 1.2;
  c.evidence.disc_misfit = 1.3;
  c.evidence.examples.resize(3);
  c.Solve();
  EXPECT_TRUE(c.calibration.diagnostics.blur.done);
  EXPECT_EQ(c.calibration.diagnostics.blur.estimator, "relative spectrum");
  EXPECT_EQ(c.calibration.diagnostics.blur.message, "converged");
  EXPECT_EQ(c.calibration.diagnostics.blur.gaussian_misfit, 1.2);
  EXPECT_EQ(c.calibration.diagnostics.blur.disc_misfit, 1.3);
  EXPECT_EQ(c.calibration.diagnostics.blur.better_psf, model::Psf::kGaussian);
  EXPECT_EQ(c.calibration.examples.size(), 3U);
  EXPECT_EQ(c.calibration.diagnostics.blur.outside_mm, 0);
  EXPECT_EQ(c.calibration.diagnostics.blur.chi2_per_dof, c.fit.chi2_per_dof);
  EXPECT_NE(c.calibration.diagnostics.blur.weak_direction, "");
  EXPECT_TRUE(c.calibration.diagnostics.nearer.done && c.calibration.diagnostics.farther.done);
}

TEST(SolveFocus, AnotherShapeIsWarnedOfWhereItFitsClearlyBetter) {
  struct Case {
    model::Psf stated;
    double gaussian, disc;
    const char* warning;  // null: no warning
  };
  const Case cases[] = {
      {model::Psf::kGaussian, 1.21, 1.0,
       "the blur is a disc, not the gaussian that the camera file states"},
      {model::Psf::kGaussian, 1.05, 1.0, nullptr},
      {model::Psf::kGaussian, 1.0, 1.5, nullptr},
      {model::Psf::kDisc, 1.0, 1.3,
       "the blur is a gaussian, not the disc that the camera file states"},
      {model::Psf::kDisc, 1.3, 1.0, nullptr},
  };
  for (const Case& k : cases) {
    FocusCase c = FocusCase().WithTexture(kErrorPx2).WithTrueFloor();
    c.sweep.camera.psf = k.stated;
    c.evidence.gaussian_misfit = k.gaussian;
    c.evidence.disc_misfit = k.disc;
    c.evidence.other_psf = c.evidence.setup.estimators[0];
    c.evidence.better_psf = k.gaussian <= k.disc ? model::Psf::kGaussian : model::Psf::kDisc;
    c.Solve();
    if (k.warning != nullptr) {
      EXPECT_THAT(c.calibration.summary.warnings, Contains(HasSubstr(k.warning)));
    } else {
      EXPECT_THAT(c.calibration.summary.warnings, Not(Contains(HasSubstr("the blur is a"))));
    }
  }
}

// ---- frames that follow no law ----

// Every second frame deviates by three of its standard deviations to the other side.
FocusCase Scattered(double misfit) {
  FocusCase c = FocusCase().WithTexture(kErrorPx2).WithTrueFloor(0.01);
  Eigen::VectorXd& variances_px2 = c.evidence.setup.estimators.front().variances_px2;
  for (Eigen::Index i = 0; i < variances_px2.size(); ++i)
    variances_px2[i] += (i % 2 == 0 ? 3 : -3) * kErrorPx2;
  c.evidence.gaussian_misfit = misfit;
  c.evidence.disc_misfit = 1.1 * misfit;
  c.Solve();
  return c;
}

TEST(SolveFocus, FramesThatFollowNeitherLawNorShapeGiveADoubtfulResult) {
  FocusCase c = Scattered(120);
  const CalibrationSummary& found = c.calibration.summary;
  EXPECT_GT(c.fit.chi2_per_dof, 5);
  EXPECT_EQ(found.outcome, Outcome::kPartial);
  EXPECT_THAT(found.reason, HasSubstr("the result is doubtful"));
  EXPECT_THAT(found.warnings, Contains(HasSubstr("deviate from the blur law")));
  ASSERT_NE(c.Part("deviation from the blur law"), nullptr);
  // Each side of focus alone, and its mirror image, lie in the intervals.
  for (const SideFit* side :
       {&c.calibration.diagnostics.nearer, &c.calibration.diagnostics.farther}) {
    ASSERT_TRUE(side->done);
    const double ratio = side->blur_ratio.value - found.blur_ratio->value;
    const double focus_mm = side->focus_depth_mm.value - found.focus_depth_mm->value;
    for (const double sign : {-1, 1}) {
      EXPECT_LE(found.blur_ratio->systematic->x(), found.blur_ratio->value + sign * ratio);
      EXPECT_GE(found.blur_ratio->systematic->y(), found.blur_ratio->value + sign * ratio);
      EXPECT_LE(found.focus_depth_mm->systematic->x(),
                found.focus_depth_mm->value + sign * focus_mm);
      EXPECT_GE(found.focus_depth_mm->systematic->y(),
                found.focus_depth_mm->value + sign * focus_mm);
    }
  }
}

TEST(SolveFocus, OneOfTheTwoAloneIsNoDoubt) {
  // The errors of frames that scatter about the law are widened by their scatter.
  FocusCase scattered = Scattered(1.2);
  EXPECT_EQ(scattered.calibration.summary.outcome, Outcome::kOk);
  EXPECT_GT(scattered.fit.error_factor, 2);
  // Frames with little noise show more of a shape than any model has.
  FocusCase quiet = FocusCase().WithTexture(kErrorPx2).WithTrueFloor(0.01);
  quiet.evidence.gaussian_misfit = 120;
  quiet.evidence.disc_misfit = 130;
  quiet.Solve();
  EXPECT_EQ(quiet.calibration.summary.outcome, Outcome::kOk);
  EXPECT_EQ(quiet.Part("deviation from the blur law"), nullptr);
}

}  // namespace
}  // namespace thicklens::calib
