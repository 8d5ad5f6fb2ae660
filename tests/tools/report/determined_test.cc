// Results that a refused calibration still reports: in the text, on the page and in the JSON.
#include "tools/report/determined.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tools/report/calibration_json.h"
#include "tools/report/calibration_report.h"
#include "tools/report/calibration_sections.h"
#include "tools/report/calibration_summary.h"
#include "tools/support/fake_calibration.h"

namespace thicklens::tools {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

MadeUpCalibration RefusedWithFindings() {
  MadeUpCalibration made = MakeUpCalibration(31, 300, 8);
  RefuseAll("offset_mm is not stated and could not be determined", &made.calibration);
  calib::Calibration& c = made.calibration;
  c.diagnostics.sharpest = {true, "fitted", {110.0312, 0.11}, 5, 12};
  c.diagnostics.focus_reading_mm = model::Estimate{109.99841, 0.0004};
  c.diagnostics.scale.done = false;
  c.diagnostics.scale.change_over_sweep = model::Estimate{0.101, 0.001};
  calib::Diagnosis diagnosis;
  diagnosis.symptom = "the image scale against the readings";
  diagnosis.chi2_of_none = 500;
  diagnosis.causes = {{"the lens moves", 20}, {"the target moves", 60}};
  diagnosis.named = 1;
  c.diagnostics.diagnoses = {diagnosis};
  c.diagnostics.structure.measured = true;
  c.diagnostics.structure.bands = model::Estimate{0.1, 0.01};
  return made;
}

TEST(Determined, ARefusalReportsItInTheText) {
  const MadeUpCalibration made = RefusedWithFindings();
  EXPECT_THAT(
      CalibrationText(made.sweep, made.calibration, nullptr),
      AllOf(HasSubstr("sharpest: reading 110.03 +- 0.11 mm, by 5 frames; frame_012.png is the "
                      "sharpest\n"),
            HasSubstr("focus: reading 109.99841 +- 0.00040 mm"),
            HasSubstr("image scale: 1/scale changes by +10.10 +- 0.10 % over the sweep: the target "
                      "looks smaller at larger readings\n"),
            HasSubstr("compared: the image scale against the readings: the lens moves (chi2 20, "
                      "named); the target moves (chi2 60); no cause (chi2 500)\n")));
}

TEST(Determined, ARefusalReportsItOnThePage) {
  const MadeUpCalibration made = RefusedWithFindings();
  EXPECT_THAT(VerdictSection(made.sweep, made.calibration),
              AllOf(HasSubstr("The sweep is sharpest at the reading 110.03"),
                    HasSubstr("Where is focus?</b> Reading 109.99841"),
                    HasSubstr("looks smaller at larger readings"), HasSubstr(" rejected."),
                    HasSubstr("Compared: the image scale")));
}

TEST(Determined, ARefusalReportsItToPrograms) {
  const MadeUpCalibration made = RefusedWithFindings();
  const nlohmann::json out = CalibrationJson(made.sweep, made.calibration, nullptr, false);
  const nlohmann::json& sharpest = out.at("sharpest_reading");
  EXPECT_EQ(sharpest.at("reading_mm").at("value"), 110.0312);
  EXPECT_EQ(sharpest.at("reading_mm").at("sigma"), 0.11);
  EXPECT_EQ(sharpest.at("sharpest_image"), "/sweeps/bench/frame_012.png");
  EXPECT_EQ(sharpest.at("focus_by_blur_mm").at("value"), 109.99841);
  EXPECT_EQ(out.at("scale_model").at("change_over_sweep").at("value"), 0.101);
  const nlohmann::json& diagnosis = out.at("diagnoses").at(0);
  EXPECT_EQ(diagnosis.at("chi2_of_none"), 500);
  EXPECT_EQ(diagnosis.at("causes").at(0).at("cause"), "the lens moves");
  EXPECT_TRUE(diagnosis["causes"][0].at("named").get<bool>());
  EXPECT_FALSE(diagnosis["causes"][1].at("named").get<bool>());
  EXPECT_EQ(out.at("frame_structure").at("bands_run_along"), "rows");
  EXPECT_TRUE(out["frame_structure"].at("ln_corner_over_centre").is_null());
}

TEST(Determined, TheCameraResponseIsReported) {
  MadeUpCalibration made = MakeUpCalibration(31, 300, 8);
  calib::CameraResponse& response = made.calibration.diagnostics.response;
  response.measured = true;
  response.light_exponent = model::Estimate{0.416, 0.002};
  response.weak_detail_loss = model::Estimate{0.0001, 0.0012};
  response.block_grid = model::Estimate{3, 0.2};
  response.better_transfer = "linear";
  EXPECT_THAT(CalibrationText(made.sweep, made.calibration, nullptr),
              AllOf(HasSubstr("camera response: the light is the value as read to the power 0.4160 "
                              "+- 0.0020; weak detail loses +0.01 +- 0.12 % per factor e"),
                    Not(HasSubstr("contradict"))));
  const nlohmann::json out = CalibrationJson(made.sweep, made.calibration, nullptr, false);
  const nlohmann::json& found = out.at("camera_response");
  EXPECT_EQ(found.at("light_exponent").at("value"), 0.416);
  EXPECT_EQ(found.at("better_transfer"), "linear");
  EXPECT_TRUE(found.at("contradicts_transfer").get<bool>());
  EXPECT_TRUE(found.at("is_compressed").get<bool>());
  EXPECT_FALSE(found.at("loses_weak_detail").get<bool>());
  EXPECT_TRUE(found.at("noise_rise").is_null());
}

TEST(Determined, WhatWasRemovedFromTheFramesIsReported) {
  MadeUpCalibration made = MakeUpCalibration(31, 300, 8);
  calib::FixedPattern& pattern = made.calibration.diagnostics.fixed_pattern;
  pattern.measured = true;
  pattern.message = "fitted";
  pattern.corner_stops = model::Estimate{-1.94, 0.03};
  pattern.shading_removed = true;
  pattern.specks = 12;
  pattern.deepest_speck = 0.6;
  pattern.divided_share = 0.02;
  EXPECT_THAT(CalibrationText(made.sweep, made.calibration, nullptr),
              AllOf(HasSubstr("fixed to the frame: structure fixed to the frame was found and "
                              "removed: shading (-1.94 +- 0.03 stops"),
                    HasSubstr("12 specks"), HasSubstr("cover 2 % of the region")));
  const nlohmann::json out = CalibrationJson(made.sweep, made.calibration, nullptr, false);
  const nlohmann::json& found = out.at("fixed_pattern");
  EXPECT_EQ(found.at("corner_stops").at("value"), -1.94);
  EXPECT_EQ(found.at("specks"), 12);
  EXPECT_EQ(found.at("divided_share"), 0.02);
  EXPECT_TRUE(found.at("shading_removed").get<bool>());
}

// A run that ended before a frame was opened has none of it.
TEST(Determined, UnmeasuredValuesGiveNoReport) {
  MadeUpCalibration made = MakeUpCalibration(31, 300, 8);
  RefuseAll("too few frames", &made.calibration);
  EXPECT_THAT(
      CalibrationText(made.sweep, made.calibration, nullptr),
      AllOf(Not(HasSubstr("sharpest: ")), Not(HasSubstr("focus: ")), Not(HasSubstr("compared: "))));
  const nlohmann::json out = CalibrationJson(made.sweep, made.calibration, nullptr, false);
  EXPECT_FALSE(out.at("sharpest_reading").at("done").get<bool>());
  EXPECT_TRUE(out["sharpest_reading"].at("reading_mm").is_null());
  EXPECT_TRUE(out["sharpest_reading"].at("focus_by_blur_mm").is_null());
  EXPECT_TRUE(out.at("frame_structure").is_null());
  EXPECT_TRUE(out.at("fixed_pattern").is_null());
  EXPECT_TRUE(out.at("camera_response").is_null());
  EXPECT_TRUE(out.at("diagnoses").empty());
}

}  // namespace
}  // namespace thicklens::tools
