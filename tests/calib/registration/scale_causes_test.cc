// Causes that are named for the relation between image scale and readings.
#include "calib/registration/scale_causes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <string>

#include "support/test_cameras.h"
#include "thicklens/model/objective.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::calib {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

TEST(SortCauses, NamesTheBestAloneOnlyIfItIsSignificantAndFarAhead) {
  Diagnosis d;
  const auto named = [&](double none, double a, double b) {
    d = {};
    d.chi2_of_none = none;
    d.causes = {{"a", a}, {"b", b}};
    SortCauses(&d);
    return d.named;
  };
  EXPECT_EQ(named(100, 20, 36), 1U);
  EXPECT_TRUE(d.NamesOnly("a"));
  EXPECT_EQ(named(100, 36, 20), 1U);
  EXPECT_TRUE(d.NamesOnly("b"));
  EXPECT_EQ(named(100, 20, 35.9), 2U) << "not distinguished";
  EXPECT_TRUE(d.Names("a") && d.Names("b"));
  EXPECT_FALSE(d.NamesOnly("a"));
  EXPECT_EQ(named(35.9, 20, 90), 0U) << "not significant";
  EXPECT_EQ(named(36, 20, 90), 1U);
}

// A lens of 50 mm f/2.8 with 4.5 um pixels.
FocusSweep Bench() {
  FocusSweep sweep;
  sweep.camera.lens = testing::ThinLens(50, 8.9286);
  sweep.camera.sensor.pixel_pitch_mm = 0.0045;
  sweep.reading_sigma_mm = 0.002;
  return sweep;
}

constexpr double kRatio = 0.45, kFloorPx = 0.5;

// A sample of scale `scale` whose blur has the sigma `blur_px`, with an error of a tenth as from
// the registrations.
ScaleSample Sample(std::size_t frame, double reading_mm, double scale, double blur_px,
                   std::mt19937* random) {
  std::normal_distribution<double> normal(0, 1);
  ScaleSample sample;
  sample.frame = frame;
  sample.reading_mm = reading_mm;
  sample.scale = scale * (1 + 2e-5 * normal(*random));
  sample.registration.scale = sample.scale;
  sample.registration.scale_sigma = 2e-5 * scale;
  sample.registration.added_variance_px2 =
      (blur_px * blur_px - kFloorPx * kFloorPx * scale * scale) * (1 + 0.1 * normal(*random));
  return sample;
}

// Samples of a target that moves through focus at `focus_mm`, by the blur law. `reading` returns
// the written reading for a depth.
std::vector<ScaleSample> MovingTarget(FocusSweep* sweep, double focus_mm, double half_mm,
                                      const std::function<double(double)>& reading) {
  std::mt19937 random(5);
  std::vector<ScaleSample> samples;
  const model::ThickLens& lens = sweep->camera.lens;
  const double k_mm =
      lens.front_focal_length_mm * focus_mm / (focus_mm - lens.front_focal_length_mm);
  for (std::size_t i = 0; i < 31; ++i) {
    const double depth_mm = focus_mm + half_mm * (static_cast<double>(i) - 15) / 15;
    const double defocus_px = kRatio * lens.aperture_radius_mm * k_mm *
                              std::abs(1 / depth_mm - 1 / focus_mm) /
                              sweep->camera.sensor.pixel_pitch_mm;
    samples.push_back(Sample(i, reading(depth_mm), focus_mm / depth_mm,
                             std::hypot(defocus_px, kFloorPx), &random));
    sweep->frames.push_back({"frame", reading(depth_mm)});
  }
  return samples;
}

// Samples of a lens that moves before a target at 300 mm; the distance to the sensor is 60 mm in
// focus.
std::vector<ScaleSample> MovingLens(FocusSweep* sweep, double half_mm,
                                    const std::function<double(double)>& reading) {
  constexpr double kInFocusMm = 60;
  std::mt19937 random(6);
  std::vector<ScaleSample> samples;
  for (std::size_t i = 0; i < 25; ++i) {
    const double distance_mm = kInFocusMm + half_mm * (static_cast<double>(i) - 12) / 12;
    const double defocus_px = kRatio * sweep->camera.lens.aperture_radius_mm *
                              std::abs(1 - distance_mm / kInFocusMm) /
                              sweep->camera.sensor.pixel_pitch_mm;
    samples.push_back(Sample(i, reading(distance_mm), distance_mm / kInFocusMm,
                             std::hypot(defocus_px, kFloorPx), &random));
    sweep->frames.push_back({"frame", reading(distance_mm)});
  }
  return samples;
}

TEST(BlurSlope, GivesTheBlurRatioOfWhatMoves) {
  FocusSweep sweep = Bench();
  auto slope = FindBlurSlope(MovingTarget(&sweep, 300, 15, [](double z) { return z; }));
  ASSERT_TRUE(slope);
  EXPECT_NEAR(slope->RatioOfMovingTarget(sweep.camera, 300), kRatio, 0.1 * kRatio);
  EXPECT_NEAR(slope->RatioOfMovingLens(sweep.camera), kRatio / 5, 0.1 * kRatio / 5);
  slope = FindBlurSlope(MovingLens(&sweep, 0.6, [](double d) { return d; }));
  ASSERT_TRUE(slope);
  EXPECT_NEAR(slope->RatioOfMovingLens(sweep.camera), kRatio, 0.1 * kRatio);
}

TEST(BlurSlope, IsNothingWhereTheBlurDoesNotGrow) {
  FocusSweep sweep = Bench();
  auto samples = MovingTarget(&sweep, 300, 15, [](double z) { return z; });
  for (ScaleSample& sample : samples) sample.registration.added_variance_px2 = 0.01;
  EXPECT_FALSE(FindBlurSlope(samples));
  samples.resize(4);
  EXPECT_FALSE(FindBlurSlope(samples));
}

ScaleModel LawOf(const std::vector<ScaleSample>& samples, const FocusSweep& sweep) {
  return FitScaleModel(samples, 15, sweep.reading_sigma_mm, sweep.direction);
}

std::string ReasonOf(const std::vector<ScaleSample>& samples, const FocusSweep& sweep) {
  return ReasonOfScaleCauses(sweep, LawOf(samples, sweep), CompareScaleCauses(samples, sweep))
      .value_or("");
}

TEST(ScaleCauses, ATargetThatMovesAsStatedIsLeftAlone) {
  FocusSweep sweep = Bench();
  const auto samples = MovingTarget(&sweep, 300, 15, [](double z) { return z - 190; });
  const ScaleCauses causes = CompareScaleCauses(samples, sweep);
  EXPECT_TRUE(causes.diagnosis.NamesOnly(kTargetMoves));
  EXPECT_FALSE(causes.unit);
  EXPECT_EQ(ReasonOf(samples, sweep), "");
}

TEST(ScaleCauses, ReversedReadingsNameTheDirectionAlone) {
  FocusSweep sweep = Bench();
  const auto samples = MovingTarget(&sweep, 300, 15, [](double z) { return 500 - z; });
  EXPECT_TRUE(CompareScaleCauses(samples, sweep).diagnosis.NamesOnly(kReversedReadings));
  EXPECT_THAT(ReasonOf(samples, sweep),
              AllOf(HasSubstr("direction must be 'toward'"), Not(HasSubstr("lens"))));
}

// At a magnification of 1, the blur grows equally whether the lens or the target moves.
TEST(ScaleCauses, LensAndTargetAreBothNamedWhereTheyLookAlike) {
  FocusSweep sweep = Bench();
  const auto samples = MovingTarget(&sweep, 100, 0.8, [](double z) { return 500 - z; });
  EXPECT_THAT(ReasonOf(samples, sweep),
              AllOf(HasSubstr("direction must be 'toward'"), HasSubstr("or the lens"),
                    HasSubstr("do not distinguish these causes: state what moved")));
}

TEST(ScaleCauses, ALensThatMovesIsNamedWhicheverDirectionIsStated) {
  for (const auto direction : {model::BenchDirection::kAway, model::BenchDirection::kToward}) {
    FocusSweep sweep = Bench();
    sweep.direction = direction;
    const auto samples = MovingLens(&sweep, 0.6, [](double d) { return d - 60; });
    EXPECT_THAT(ReasonOf(samples, sweep),
                AllOf(StartsWith("the image scale follows the lens, not the target"),
                      HasSubstr("move the target"), HasSubstr("extensions in mm"),
                      Not(HasSubstr("direction")), Not(HasSubstr("that the readings are in mm"))));
  }
}

// A Pi camera, 4.74 mm f/1.8. Its reading would be a depth of about 200 mm, at which the blur would
// require a blur ratio of 19.
TEST(ScaleCauses, AFocusMotorInDioptresIsRecognised) {
  for (const auto direction : {model::BenchDirection::kAway, model::BenchDirection::kToward}) {
    FocusSweep sweep = Bench();
    sweep.direction = direction;
    sweep.camera.lens = testing::ThinLens(4.74, 1.3167);
    sweep.camera.sensor.pixel_pitch_mm = 0.0014;
    constexpr double kInFocusMm = 4.872;
    // 1/d = 1/f - q/1000; d is proportional to the scale.
    const auto samples = MovingLens(
        &sweep, 0.9, [](double d) { return 1000 / 4.74 - 1000 / (kInFocusMm * d / 60); });
    EXPECT_THAT(ReasonOf(samples, sweep),
                AllOf(StartsWith("the image scale follows the lens, not the target"),
                      HasSubstr("dioptres of a focus motor"), Not(HasSubstr("are not in mm"))));
  }
}

// For a lens of 50 mm, the samples could also be those of a target with readings in centimetres.
TEST(ScaleCauses, ACauseThatUnitAndLensExplainAlikeIsLeftOpen) {
  for (const auto direction : {model::BenchDirection::kAway, model::BenchDirection::kToward}) {
    FocusSweep sweep = Bench();
    sweep.direction = direction;
    const auto samples = MovingLens(&sweep, 0.6, [](double d) { return 1000 / 50.0 - 1000 / d; });
    EXPECT_THAT(ReasonOf(samples, sweep),
                AllOf(StartsWith("either the image scale follows the lens"),
                      HasSubstr("; or the target moves"), HasSubstr("readings in centimetres"),
                      HasSubstr("do not distinguish these causes: state what moved")));
  }
}

// A sweep through an objective with the magnification `truth`, whose camera file states `stated`.
// The blur is that of the true objective with a numerical aperture of 0.25.
std::string ReasonOfObjective(double truth, double stated, double half_mm) {
  FocusSweep sweep = Bench();
  sweep.reading_sigma_mm = 1e-4;
  sweep.camera.sensor.pixel_pitch_mm = 0.0065;
  const double f_mm = 200 / truth;
  sweep.camera.lens = testing::ThinLens(f_mm, f_mm * (1 + 1 / truth) * std::tan(std::asin(0.25)));
  const auto samples =
      MovingTarget(&sweep, f_mm * (1 + 1 / truth), half_mm, [](double z) { return z - 5; });
  sweep.camera.objective = model::Objective{stated, 0.25, 200};
  sweep.camera.lens = model::LensOfObjective(*sweep.camera.objective);
  return ReasonOf(samples, sweep);
}

TEST(ScaleCauses, TheDataOfAnObjectiveAreNamedWhereTheyContradictScaleAndBlur) {
  EXPECT_EQ(ReasonOfObjective(10, 10, 0.06), "");
  EXPECT_THAT(ReasonOfObjective(10, 1, 0.06),
              AllOf(StartsWith("the image scale and the blur contradict the data of the objective: "
                               "with lens.magnification 1 "),
                    HasSubstr("the image scale puts the target at 22 mm"),
                    HasSubstr("the blur fits a magnification of about 9."),
                    HasSubstr("lens.tube_lens_focal_length_mm")));
  EXPECT_THAT(ReasonOfObjective(1, 10, 0.3),
              AllOf(StartsWith("the image scale and the blur contradict the data of the objective: "
                               "with lens.magnification 10 "),
                    HasSubstr("the blur fits a magnification of about 0.9")));
}

// [D131] by finite differences of the lens equation: 20/0.4 with a tube lens of 165 mm.
TEST(MagnificationOfBlur, IsThatOfTheLens) {
  const model::Objective objective = {20, 0.4, 165};
  const model::ThickLens lens = model::LensOfObjective(objective);
  const double zf = lens.front_focal_length_mm * 1.05, step_mm = 1e-4;
  const double d1_mm = model::ImageDistanceMm(lens, zf);
  const double slope_px = 0.45 / 0.0065 * model::BlurRadiusMm(lens, d1_mm, zf + step_mm) / step_mm;
  EXPECT_NEAR(MagnificationOfBlur(objective, 0.0065, slope_px), 20, 0.01);
}

TEST(ScaleCauses, TheUnitThatFitsScaleAndBlurIsNamed) {
  const std::pair<double, const char*> units[] = {
      {25.4, "inches"}, {10, "centimetres"}, {0.1, "tenths of a millimetre"}};
  for (const auto& [unit, name] : units) {
    FocusSweep sweep = Bench();
    const double mm = unit;
    const auto samples = MovingTarget(&sweep, 300, 15, [mm](double z) { return (z - 190) / mm; });
    const ScaleCauses causes = CompareScaleCauses(samples, sweep);
    ASSERT_TRUE(causes.unit) << name;
    EXPECT_STREQ(causes.unit->name, name);
    EXPECT_THAT(UnitThatFits(sweep, causes), AllOf(HasSubstr(name), HasSubstr("at about 300 mm")));
    EXPECT_EQ(ReasonOf(samples, sweep), "") << "the direction is right";
  }
}

// The magnification is above 1 because the target is nearer than two focal lengths. The readings
// are in mm nevertheless.
TEST(UnitAdvice, DoesNotDoubtAMagnificationAboveOneThatTheBlurShows) {
  FocusSweep sweep = Bench();
  sweep.camera.lens = testing::ThinLens(45, 4.6);
  sweep.camera.sensor.pixel_pitch_mm = 0.00345;
  const auto samples = MovingTarget(&sweep, 56.25, 0.45, [](double z) { return z - 40; });
  const ScaleModel law = LawOf(samples, sweep);
  ASSERT_TRUE(law.done) << law.message;
  std::vector<FrameMeasurement> frames(samples.size());
  for (const ScaleSample& sample : samples) frames[sample.frame].image_scale = sample.scale;
  EXPECT_EQ(UnitAdvice(sweep, frames, law, CompareScaleCauses(samples, sweep)), "");
}

TEST(UnitAdvice, PutsTheQuestionWithTheUnitThatFits) {
  FocusSweep sweep = Bench();
  const auto samples = MovingTarget(&sweep, 300, 15, [](double z) { return (z - 190) / 25.4; });
  const ScaleModel law = LawOf(samples, sweep);
  std::vector<FrameMeasurement> frames(samples.size());
  for (const ScaleSample& sample : samples) frames[sample.frame].image_scale = sample.scale;
  EXPECT_THAT(UnitAdvice(sweep, frames, law, CompareScaleCauses(samples, sweep)),
              AllOf(StartsWith("the image scale puts the target at 11.2 to 12.4 mm"),
                    HasSubstr("that the readings are in mm. With readings in inches the target is "
                              "at about 300 mm")));
}

// A wrong given zero is not reported as a moving lens.
TEST(ScaleCauses, AWrongOffsetIsNotTakenForSomethingElse) {
  FocusSweep sweep = Bench();
  sweep.offset_mm = model::Estimate{250, 0.1};
  const auto samples = MovingTarget(&sweep, 300, 15, [](double z) { return z - 190; });
  const ScaleCauses causes = CompareScaleCauses(samples, sweep);
  EXPECT_TRUE(causes.diagnosis.NamesOnly(kZeroIsWrong));
  EXPECT_EQ(ReasonOf(samples, sweep), "");
  EXPECT_EQ(UnitThatFits(sweep, causes), "");
}

TEST(ConstantScaleWarning, SpeaksWhereTheGivenZeroLetsTheScaleChange) {
  FocusSweep sweep = Bench();
  std::mt19937 random(1);
  std::vector<ScaleSample> samples;
  for (std::size_t i = 0; i < 31; ++i)
    samples.push_back(Sample(i, 95.4 + static_cast<double>(i), 1, 1, &random));
  EXPECT_EQ(ConstantScaleWarning(sweep, samples), "") << "nothing is known of the depths";
  sweep.offset_mm = model::Estimate{190, 0};
  EXPECT_THAT(ConstantScaleWarning(sweep, samples),
              AllOf(HasSubstr("although it should change by 11 % according to offset_mm"),
                    HasSubstr("aligned"), HasSubstr("telecentric"), HasSubstr("look alike")));
}

}  // namespace
}  // namespace thicklens::calib
