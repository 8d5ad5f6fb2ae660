// Causes that are named if the frames are related to one another like distorted images, or if the
// readings are a nonlinear function of the image scale.
#include "calib/registration/radial_causes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "calib/registration/radial_distortion.h"

namespace thicklens::calib {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

Calibration Distorted(double value, double sigma) {
  Calibration c;
  c.diagnostics.scale.distortion_at_corner = model::Estimate{value, sigma};
  c.diagnostics.structure.measured = true;
  c.diagnostics.structure.vignetting = model::Estimate{-0.01, 0.01};
  c.diagnostics.structure.fixed_structure = model::Estimate{0, 0.0005};
  return c;
}

TEST(CheckDistortion, IsSilentWithoutASignificantOne) {
  Calibration none;
  EXPECT_FALSE(CheckDistortion(&none));
  Calibration small = Distorted(-0.14, 0.05);
  EXPECT_FALSE(CheckDistortion(&small));
  EXPECT_TRUE(small.summary.warnings.empty() && none.summary.warnings.empty() &&
              small.diagnostics.diagnoses.empty());
}

// A flat target with a distorting lens looks like a target that is not flat with a perfect lens.
TEST(CheckDistortion, NamesLensAndTargetWhereNothingElseIsSeen) {
  Calibration c = Distorted(0.02, 0.001);
  EXPECT_FALSE(CheckDistortion(&c));
  ASSERT_EQ(c.summary.warnings.size(), 1U);
  EXPECT_THAT(c.summary.warnings[0],
              AllOf(HasSubstr("+2.0 +- 0.1 % at the corner (pincushion)"),
                    HasSubstr("the lens distorts, or the target is not flat"),
                    HasSubstr("a flat target distinguishes them"), Not(HasSubstr("vignetting"))));
  ASSERT_EQ(c.diagnostics.diagnoses.size(), 1U);
  EXPECT_TRUE(c.diagnostics.diagnoses[0].Names(kLensDistorts) &&
              c.diagnostics.diagnoses[0].Names(kTargetIsNotFlat));
  EXPECT_FALSE(c.diagnostics.diagnoses[0].Names(kVignettingShifts) ||
               c.diagnostics.diagnoses[0].Names(kFixedStructureShifts));
}

// The message names the commands that do it, unless it was done.
TEST(CheckDistortion, NamesTheCommandsThatTakeADistortionOut) {
  Calibration c = Distorted(-0.14, 0.03);
  EXPECT_THAT(CheckDistortion(&c).value_or(""),
              AllOf(HasSubstr("calibrate --distortion FILE"), HasSubstr("thicklens undistort")));
  Calibration undistorted = Distorted(-0.14, 0.03);
  EXPECT_THAT(CheckDistortion(&undistorted, false, true).value_or(""),
              AllOf(HasSubstr("after its stated distortion was taken out"),
                    Not(HasSubstr("thicklens undistort"))));
}

// Causes that a small sweep cannot exclude stay in the list.
TEST(CheckDistortion, WhatIsNotExcludedIsNamedToo) {
  Calibration c = Distorted(0.02, 0.001);
  c.diagnostics.structure.vignetting->sigma = 0.2;
  EXPECT_FALSE(CheckDistortion(&c));
  EXPECT_TRUE(c.diagnostics.diagnoses.at(0).Names(kVignettingShifts));
  EXPECT_THAT(c.summary.warnings.at(0),
              HasSubstr("Vignetting would have the same effect, and this sweep "
                        "does not show whether this is present"));
}

TEST(CheckDistortion, RefusesWhatCannotBeAllowedFor) {
  Calibration c = Distorted(-0.14, 0.03);
  EXPECT_THAT(CheckDistortion(&c).value_or(""),
              AllOf(HasSubstr("-14.0 +- 3.0 % at the corner (barrel)"), HasSubstr("undistort")));
}

// A stage with a stepped gear gave "+158.8 % pincushion".
TEST(CheckDistortion, WhatNoLensDoesIsNotBlamedOnTheLens) {
  Calibration c = Distorted(1.588, 0.05);
  EXPECT_THAT(CheckDistortion(&c).value_or(""),
              AllOf(HasSubstr("no lens distorts so much: the target is not flat"),
                    Not(HasSubstr("undistort"))));
  EXPECT_TRUE(c.diagnostics.diagnoses[0].NamesOnly(kTargetIsNotFlat));
}

// Astigmatism displaces detail in the same way, so that it is no reason to refuse.
TEST(CheckDistortion, NamesAstigmatismWhereTheContrastShowsIt) {
  Calibration c = Distorted(-0.06, 0.01);
  EXPECT_FALSE(CheckDistortion(&c, true));
  EXPECT_THAT(c.summary.warnings.at(0), AllOf(HasSubstr("as an astigmatic lens makes it"),
                                              HasSubstr("-6.0 +- 1.0 % at the corner")));
  EXPECT_TRUE(c.diagnostics.diagnoses.at(0).Names(kAstigmatismShifts));
  Calibration too_large = Distorted(1.588, 0.05);
  EXPECT_THAT(CheckDistortion(&too_large, true).value_or(""), HasSubstr("no lens distorts"));
  EXPECT_FALSE(too_large.diagnostics.diagnoses.at(0).Names(kAstigmatismShifts));
}

TEST(CheckDistortion, WhatIsSeenInTheFramesIsNamedFirst) {
  Calibration dust = Distorted(0.007, 0.001);
  dust.diagnostics.structure.fixed_structure = model::Estimate{0.01, 0.001};
  EXPECT_FALSE(CheckDistortion(&dust));
  ASSERT_EQ(dust.summary.warnings.size(), 1U);
  EXPECT_THAT(dust.summary.warnings[0],
              AllOf(HasSubstr("fine structure of 1 %"), HasSubstr("dust on the sensor"),
                    HasSubstr("If it is not the cause, the lens distorts")));
  EXPECT_TRUE(dust.diagnostics.diagnoses[0].Names(kFixedStructureShifts));
  Calibration vignetted = Distorted(0.007, 0.001);
  vignetted.diagnostics.structure.vignetting = model::Estimate{std::log(0.5), 0.02};
  EXPECT_FALSE(CheckDistortion(&vignetted));
  EXPECT_THAT(vignetted.summary.warnings.at(0),
              AllOf(HasSubstr("the corners are 50 % darker"), HasSubstr("evenly lit white sheet")));
}

TEST(ScaleNonlinearity, NamesWhatTheFramesShow) {
  const ScaleNonlinearity nonlinearity{{0.18, 0.03}, -7.1};
  Calibration c;
  c.diagnostics.structure = Distorted(0, 1).diagnostics.structure;
  EXPECT_THAT(NonlinearityText(nonlinearity, c),
              AllOf(HasSubstr("The rail's scale is not linear"), HasSubstr("look alike"),
                    HasSubstr("micrometer screw")));
  EXPECT_THAT(NonlinearityRemedy(c.diagnostics.structure), HasSubstr("check the rail's scale"));
  c.diagnostics.structure.vignetting = model::Estimate{std::log(0.5), 0.02};
  EXPECT_THAT(NonlinearityText(nonlinearity, c),
              AllOf(HasSubstr("+0.18 +- 0.03 mm"), HasSubstr("the corners are 50 % darker"),
                    HasSubstr("If it is not the cause, the rail's scale is not linear")));
  EXPECT_THAT(NonlinearityRemedy(c.diagnostics.structure),
              AllOf(HasSubstr("measure offset_mm"), Not(HasSubstr("rail"))));
}

// Frames of one scale show no distortion, whatever the cubic terms of their registrations are.
TEST(FitRadialDistortion, IsNothingWhereTheScaleDoesNotChange) {
  std::vector<ScaleSample> samples(31);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    ScaleSample& sample = samples[i];
    const double change = i % 2 == 0 ? 1e-5 : -2e-5;
    sample.scale = sample.registration.scale = 1 + change;
    sample.registration.scale_sigma = 1e-5;
    sample.registration.cubic = -1e-10;
    sample.registration.cubic_sigma = 1e-11;
  }
  EXPECT_FALSE(FitRadialDistortion(samples));
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].scale = 1 + 0.003 * (static_cast<double>(i) - 15);
    samples[i].registration.cubic = 2e-9 * CubicPerDistortion(samples[i].scale);
  }
  ASSERT_TRUE(FitRadialDistortion(samples));
  EXPECT_NEAR(FitRadialDistortion(samples)->value, 2e-9, 1e-11);
}

}  // namespace
}  // namespace thicklens::calib
