#include "calibration_summary.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <sstream>

#include "made_up_calibration.h"

namespace thicklens::tools {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::string LineWith(const std::string& text, const std::string& words) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);)
    if (line.find(words) != std::string::npos) return line;
  return "";
}

TEST(Rounding, ShowsTwoDigitsOfTheError) {
  EXPECT_EQ(RoundedTo(15.940321, 0.00123), "15.9403");
  EXPECT_EQ(RoundedSigma(0.00123), "0.0012");
  EXPECT_EQ(RoundedTo(400.123, 1.23), "400.1");
  EXPECT_EQ(RoundedTo(400.123, 12.3), "400");
  EXPECT_EQ(RoundedTo(412.7, 340), "413");
  EXPECT_EQ(RoundedSigma(0.0996), "0.10");  // not 0.100: its second digit is the hundredth
  EXPECT_EQ(RoundedTo(1.23456, 0.0996), "1.23");
  EXPECT_EQ(SignedRoundedTo(0.28, 0.11), "+0.28");
  EXPECT_EQ(SignedRoundedTo(-0.28, 0.11), "-0.28");
  EXPECT_EQ(RoundedTo(-0.0004, 0.11), "0.00");
}

TEST(Rounding, WithoutAnErrorShowsFiveDigits) {
  for (double sigma : {0.0, -1.0, kNan, std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(RoundedTo(15.940321, sigma), "15.94");
    EXPECT_EQ(RoundedSigma(sigma), "-");
  }
  EXPECT_EQ(RoundedTo(kNan, 0.1), "nan");
}

TEST(RejectionRuns, JoinsNeighboursOfOneKind) {
  std::vector<calib::FrameMeasurement> frames(9);
  frames[0].rejection = "dark: mean 0.001 below 0.016";
  frames[1].rejection = "dark: mean 0.002 below 0.016";
  frames[2].rejection = "saturated: 12 % of samples";
  frames[4].rejection = "dark: mean 0.003 below 0.016";
  frames[7].rejection = "blank";
  frames[8].rejection = "blank";
  const std::vector<RejectionRun> runs = RejectionRuns(frames);
  ASSERT_EQ(runs.size(), 4u);
  EXPECT_EQ(runs[0].first, 0);
  EXPECT_EQ(runs[0].last, 1);
  EXPECT_FALSE(runs[0].identical);
  EXPECT_EQ(runs[0].reason, "dark: mean 0.001 below 0.016");
  EXPECT_EQ(runs[1].first, 2);
  EXPECT_EQ(runs[1].last, 2);
  EXPECT_EQ(runs[2].first, 4);
  EXPECT_EQ(runs[3].last, 8);
  EXPECT_TRUE(runs[3].identical);
}

TEST(CalibrationText, PutsBothMethodsBesideTheTruth) {
  const MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  const std::string text = CalibrationText(made.sweep, made.calibration, &made.truth);
  // By hand: d1 = 3 + 12.8 * 400/387.5 = 16.21290, the fit .0003 more with sigma .0012.
  const std::string d1 = LineWith(text, "image distance d1 [mm]");
  EXPECT_THAT(d1, HasSubstr("16.2132 +- 0.0012"));
  EXPECT_THAT(d1, HasSubstr("16.2089 .. 16.2159"));
  EXPECT_THAT(d1, HasSubstr("+0.0003 (+0.2 sigma)"));
  EXPECT_THAT(d1, HasSubstr("16.2199"));  // 3 + 12.8 * 393.5/381
  EXPECT_THAT(d1, HasSubstr("+0.0070"));
  const std::string focus = LineWith(text, "depth of focus zf [mm]");
  EXPECT_THAT(focus, HasSubstr("393.5"));
  EXPECT_THAT(focus, HasSubstr("-6.5"));
  EXPECT_THAT(LineWith(text, "blur ratio kappa"), HasSubstr("0.4512 +- 0.0021"));
  EXPECT_THAT(LineWith(text, "normalised sharpness"), HasSubstr("400.9 +- 1.3 mm"));
  EXPECT_THAT(LineWith(text, "image scale"), HasSubstr("12.29 +- 0.11 mm"));
  EXPECT_THAT(text, HasSubstr("\nok (2.7 s)\n"));
}

TEST(CalibrationText, AlignsItsColumns) {
  const MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  const std::string text = CalibrationText(made.sweep, made.calibration, &made.truth);
  const std::size_t width = LineWith(text, "systematic interval").size();
  for (const char* row : {"image distance d1", "depth of focus zf [mm]", "blur ratio kappa",
                          "blur floor [px]", "bench offset [mm]"})
    EXPECT_EQ(LineWith(text, row).size(), width) << row;
}

TEST(CalibrationText, WithoutTruthHasNoErrorColumns) {
  const MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  EXPECT_THAT(CalibrationText(made.sweep, made.calibration, nullptr), Not(HasSubstr("truth")));
}

TEST(CalibrationText, TellsWhyFramesWereRejected) {
  MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  RejectFrame(0, "dark: mean 0.001 below 0.016", &made.calibration);
  RejectFrame(1, "dark: mean 0.002 below 0.016", &made.calibration);
  RejectFrame(9, "blank", &made.calibration);
  made.calibration.warnings = {"focus extrapolated by 3 mm"};
  made.calibration.outcome = calib::Outcome::kPartial;
  made.calibration.reason = "floor unknown";
  const std::string text = CalibrationText(made.sweep, made.calibration, nullptr);
  EXPECT_THAT(text, HasSubstr("41 frames: 38 used, 3 rejected\n"));
  EXPECT_THAT(text, HasSubstr("  frame_000.png .. frame_001.png (2 frames): dark: mean 0.001"));
  EXPECT_THAT(text, HasSubstr("  frame_009.png: blank\n"));
  EXPECT_THAT(text, HasSubstr("warning: focus extrapolated by 3 mm\n"));
  EXPECT_THAT(text, HasSubstr("partial: floor unknown (2.7 s)\n"));
}

TEST(CalibrationText, KeepsControlCharactersOffTheTerminal) {
  MadeUpCalibration made = MakeUpCalibration(7, 340, 20);
  made.calibration.frames[2].image = "evil\x1b[2J.png";
  RejectFrame(2, "dark", &made.calibration);
  EXPECT_THAT(CalibrationText(made.sweep, made.calibration, nullptr), Not(HasSubstr("\x1b")));
}

TEST(CalibrationJson, HasTheKeysOfTheFormat) {
  MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  RejectFrame(3, "dark", &made.calibration);
  const json out = CalibrationJson(made.sweep, made.calibration, &made.truth, false);
  EXPECT_EQ(out.at("status"), "ok");
  EXPECT_EQ(out.at("reason"), "");
  EXPECT_EQ(out.at("method"), "fit");
  for (const char* key :
       {"image_distance_mm", "focus_depth_mm", "blur_ratio", "blur_floor_px", "bench_offset_mm"}) {
    EXPECT_TRUE(out.at(key).at("value").is_number()) << key;
    EXPECT_TRUE(out.at(key).at("sigma").is_number()) << key;
    EXPECT_TRUE(out.at(key).contains("systematic")) << key;
  }
  EXPECT_EQ(out["focus_depth_mm"]["systematic"], json::array({400 - 3.1, 400 + 3.9}));
  EXPECT_TRUE(out["blur_floor_px"]["systematic"].is_null());
  EXPECT_EQ(out.at("frames_used"), 40);
  EXPECT_EQ(out.at("frames_rejected"),
            json::array({{{"image", "/sweeps/bench/frame_003.png"}, {"reason", "dark"}}}));
  EXPECT_EQ(out.at("chi2_per_dof"), 1.04);
  EXPECT_EQ(out.at("other_methods").at("source").at("focus_depth_mm").at("value"), 393.5);
  EXPECT_TRUE(out["other_methods"]["source"]["focus_depth_mm"]["sigma"].is_null());
  EXPECT_EQ(out["other_methods"].at("sharpness_peak").at("focus_depth_mm").at("sigma"), 1.3);
  EXPECT_EQ(out.at("seconds"), 2.7);
  EXPECT_EQ(out.at("warnings"), json::array());
  EXPECT_EQ(out.at("covariance").at("order").size(), 4u);
  EXPECT_NEAR(out["covariance"].at("rows")[0][3].get<double>(), -0.71 * 0.0012 * 0.11, 1e-12);
  EXPECT_EQ(out.at("scale_law").at("frames_used"), 41);
  EXPECT_EQ(out.at("frames").size(), 41u);
  EXPECT_TRUE(out["frames"][3]["blur_sigma_px"].is_null());
  EXPECT_EQ(out["frames"][3]["rejection"], "dark");
  EXPECT_TRUE(out["frames"][4]["blur_sigma_px"].is_number());
  const json& errors = out.at("truth").at("errors");
  EXPECT_NEAR(errors.at("fit").at("focus_depth_mm").get<double>(), -0.28, 1e-9);
  EXPECT_NEAR(errors.at("source").at("focus_depth_mm").get<double>(), -6.5, 1e-9);
  EXPECT_NEAR(errors.at("sharpness_peak").at("focus_depth_mm").get<double>(), 0.9, 1e-9);
}

TEST(CalibrationJson, RefusalIsWrittenToo) {
  MadeUpCalibration made = MakeUpCalibration(31, 700, 10);
  RefuseAll("sharpness is monotone", &made.calibration);
  const json out = CalibrationJson(made.sweep, made.calibration, nullptr, false);
  EXPECT_EQ(out.at("status"), "refused");
  EXPECT_EQ(out.at("reason"), "sharpness is monotone");
  for (const char* key : {"image_distance_mm", "focus_depth_mm", "blur_ratio", "blur_floor_px",
                          "bench_offset_mm", "chi2_per_dof", "covariance"})
    EXPECT_TRUE(out.at(key).is_null()) << key;
  EXPECT_FALSE(out.at("other_methods").at("source").at("done").get<bool>());
  EXPECT_FALSE(out.contains("truth"));
}

TEST(CalibrationJson, SourcesRecipeInPlaceOfTheFit) {
  const MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  const json out = CalibrationJson(made.sweep, made.calibration, nullptr, true);
  EXPECT_EQ(out.at("method"), "source");
  EXPECT_EQ(out.at("focus_depth_mm").at("value"), 393.5);
  EXPECT_TRUE(out.at("blur_floor_px").is_null());
  EXPECT_NEAR(out.at("other_methods").at("fit").at("focus_depth_mm").at("value").get<double>(),
              399.72, 1e-9);
}

// JSON has no NaN, and a dump throws on broken UTF-8: neither may reach it from any field.
TEST(CalibrationJson, SurvivesNanAndBrokenFileNames) {
  MadeUpCalibration made = MakeUpCalibration(7, 340, 20);
  calib::Calibration& c = made.calibration;
  c.image_distance_mm->value = kNan;
  c.focus_depth_mm->sigma = kNan;
  c.blur_ratio->systematic = Eigen::Vector2d(kNan, 1);
  c.covariance(1, 1) = std::numeric_limits<double>::infinity();
  c.blur.chi2_per_dof = kNan;
  c.seconds = kNan;
  c.scale.reading_rms_mm = kNan;
  c.frames[0].image = "caf\xE9.png";
  c.frames[0].blur_sigma_px = kNan;
  c.frames[1].image_scale = kNan;
  c.frames[1].statistics.contrast = kNan;
  c.frames[2].rejection = "bad \xFF";
  c.warnings = {"\x80"};
  const json out = CalibrationJson(made.sweep, c, &made.truth, false);
  const json back = json::parse(out.dump());
  EXPECT_EQ(back, out) << "a NaN compares unequal to itself or came back as null";
  EXPECT_TRUE(out["image_distance_mm"]["value"].is_null());
  EXPECT_TRUE(out["focus_depth_mm"]["sigma"].is_null());
  EXPECT_TRUE(out["blur_ratio"]["systematic"].is_null());
  EXPECT_TRUE(out["frames"][0]["blur_sigma_px"].is_null());
  EXPECT_EQ(out["frames"][0]["image"], "caf\uFFFD.png");
  EXPECT_TRUE(out["truth"]["errors"]["fit"]["image_distance_mm"].is_null());
}

}  // namespace
}  // namespace thicklens::tools
