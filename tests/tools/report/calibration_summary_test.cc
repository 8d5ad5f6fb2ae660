#include "tools/report/calibration_summary.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "support/special_numbers.h"
#include "tools/report/calibration_answers.h"
#include "tools/support/fake_calibration.h"

namespace thicklens::tools {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

using thicklens::testing::kNan;

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

// A term that moves d1 and kappa leaves zf as it is up to the rounding of two fits, which is no
// error of zf.
TEST(TermErrors, LeavesOutWhatIsRounding) {
  calib::ErrorTerm term;
  term.focus_depth_mm = 3e-13;
  term.image_distance_mm = 0.05;
  term.blur_ratio = 0.0046;
  EXPECT_EQ(TermErrors(term), "d1 +-0.050 mm, kappa +-0.0046");
}

TEST(CalibrationText, PutsBothMethodsBesideTheTruth) {
  const MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  const std::string text = CalibrationText(made.sweep, made.calibration, &made.truth);
  // The true value is d1 = 3 + 12.8 * 400/387.5 = 16.21290. The fit is 0.0003 larger, and its sigma
  // is 0.0012.
  const std::string d1 = LineWith(text, "image distance d1 [mm]");
  EXPECT_THAT(d1, HasSubstr("16.2132 +- 0.0012"));
  EXPECT_THAT(d1, HasSubstr("16.2089 .. 16.2159"));
  EXPECT_THAT(d1, HasSubstr("+0.0003 (+0.2 sigma)"));
  EXPECT_THAT(d1, HasSubstr("16.2199"));  // 3 + 12.8 * 393.5/381
  EXPECT_THAT(d1, HasSubstr("+0.0070"));
  const std::string focus = LineWith(text, "in-focus object distance zf [mm]");
  EXPECT_THAT(focus, HasSubstr("393.5"));
  EXPECT_THAT(focus, HasSubstr("-6.5"));
  EXPECT_THAT(LineWith(text, "blur ratio kappa"), HasSubstr("0.4512 +- 0.0021"));
  EXPECT_THAT(LineWith(text, "normalised sharpness"), HasSubstr("400.9 +- 1.3 mm"));
  EXPECT_THAT(LineWith(text, "image scale"), HasSubstr("12.29 +- 0.11 mm"));
  EXPECT_THAT(text, HasSubstr("\ncalibrated (2.7 s)\n"));
}

TEST(CalibrationText, AnErrorThatTheIntervalAllowsForIsNotCountedInSigmas) {
  MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  made.calibration.summary.image_distance_mm->value = 16.2159;  // 16.2129 is the truth: 2.5 sigma
  made.calibration.summary.image_distance_mm->systematic = Eigen::Vector2d(16.2128, 16.2190);
  const auto d1 = [&] {
    return LineWith(CalibrationText(made.sweep, made.calibration, &made.truth),
                    "image distance d1 [mm]");
  };
  EXPECT_THAT(d1(), HasSubstr("+0.0030 (within the interval)"));
  made.calibration.summary.image_distance_mm->systematic = Eigen::Vector2d(16.2130, 16.2190);
  EXPECT_THAT(d1(), HasSubstr("+0.0030 (+2.5 sigma)"));
}

TEST(CalibrationText, AlignsItsColumns) {
  const MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  const std::string text = CalibrationText(made.sweep, made.calibration, &made.truth);
  const std::size_t width = LineWith(text, "systematic interval").size();
  for (const char* row : {"image distance d1 [mm]", "in-focus object distance zf [mm]",
                          "blur ratio kappa  ", "blur floor [px]", "bench offset [mm]"})
    EXPECT_EQ(LineWith(text, row).size(), width) << row;
}

TEST(CalibrationText, WithoutTruthHasNoErrorColumns) {
  const MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  EXPECT_THAT(CalibrationText(made.sweep, made.calibration, nullptr), Not(HasSubstr("truth")));
}

TEST(CalibrationText, RejectedFramesHaveTheirReasons) {
  MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  RejectFrame(0, "dark: mean 0.001 below 0.016", &made.calibration);
  RejectFrame(1, "dark: mean 0.002 below 0.016", &made.calibration);
  RejectFrame(9, "blank", &made.calibration);
  made.calibration.summary.warnings = {"focus extrapolated by 3 mm"};
  made.calibration.summary.outcome = calib::Outcome::kPartial;
  made.calibration.summary.reason = "floor unknown";
  const std::string text = CalibrationText(made.sweep, made.calibration, nullptr);
  EXPECT_THAT(text, HasSubstr("camera bench-camera, 41 frames: 38 used, 3 rejected\n"));
  EXPECT_THAT(text, HasSubstr("  dark (2 frames):\n    frame_000.png: mean 0.001"));
  EXPECT_THAT(text, HasSubstr("  frame_009.png: blank\n"));
  EXPECT_THAT(text, HasSubstr("warning: focus extrapolated by 3 mm\n"));
  EXPECT_THAT(text, HasSubstr("\npartly calibrated: floor unknown; the other results are "
                              "determined (2.7 s)\n"));
  EXPECT_THAT(CalibrationText(made.sweep, made.calibration, nullptr, "out/camera.yaml"),
              HasSubstr("; the other results are in out/camera.yaml (2.7 s)\n"));
}

TEST(CalibrationText, DetailsTakeFewLines) {
  MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  const std::string text = CalibrationText(made.sweep, made.calibration, &made.truth);
  EXPECT_THAT(LineWith(text, "paper's recipe: "), HasSubstr("zf is the depth of frame_"));
  EXPECT_THAT(LineWith(text, "magnification: "),
              HasSubstr("5 mm is 26.481 px in the image: d1 = 16.100 +- 0.050 mm, -0.70 %"));
  EXPECT_THAT(text, HasSubstr("radial distortion +0.420 +- 0.060 % of the image height"));
  EXPECT_THAT(LineWith(text, "sides of focus: "),
              HasSubstr("near side zf 398.60 +- 0.90 mm; far side zf 401.10 +- 0.90 mm; "
                        "apart +2.5 +- 1.3 mm"));
  EXPECT_THAT(text, HasSubstr("field: tilt about the vertical axis +1.210 +- 0.090 deg"));
  EXPECT_THAT(text, HasSubstr("colours: red 400.61 +- 0.12 mm, green 400.02"));
  EXPECT_THAT(LineWith(text, "blur shape: "), HasSubstr("(misfit 1.04 against 2.31)"));
  EXPECT_THAT(LineWith(text, "error: blur floor"),
              HasSubstr("zf +-3.2 mm, d1 +-0.0014 mm, kappa +-0.0075"));
  EXPECT_LE(std::count(text.begin(), text.end(), '\n'), 35);
  made.calibration.diagnostics.blur.outside_mm = 2.5;
  EXPECT_THAT(CalibrationText(made.sweep, made.calibration, nullptr),
              HasSubstr("2.5 mm outside the sweep and is extrapolated"));
}

// Where is focus, what is the blur, can I trust it, what is the largest error, what next: in this
// order, at the beginning.
TEST(CalibrationText, AnswersFirst) {
  MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  made.calibration.summary.warnings = {"the sides disagree"};
  const std::string text = CalibrationText(made.sweep, made.calibration, nullptr);
  std::size_t last = 0;
  for (const char* question :
       {"focus: ", "\nblur: ", "\ntrust: ", "\nlargest error: ", "\nnext: ", "\ncamera "}) {
    const std::size_t at = text.find(question);
    ASSERT_NE(at, std::string::npos) << question;
    EXPECT_GE(at, last) << question;
    last = at;
  }
  EXPECT_EQ(text.rfind("focus: ", 0), 0U);
  EXPECT_THAT(LineWith(text, "focus: "), HasSubstr("in-focus object distance zf = "));
  EXPECT_THAT(LineWith(text, "trust: "), HasSubstr("with care: "));
  EXPECT_THAT(LineWith(text, "trust: "), HasSubstr("1 warning below says what the checks found"));
  // The largest term of the made-up table: the tolerance of the lens.
  const std::string term = "lens.front_focal_length_mm";
  EXPECT_THAT(LineWith(text, "largest error: "), HasSubstr(term));
  EXPECT_THAT(LineWith(text, "next: "), HasSubstr("have the lens measured"));
  const std::size_t first_error = text.find("\nerror: ");
  EXPECT_EQ(text.compare(first_error, 8 + term.size(), "\nerror: " + term), 0);
}

TEST(CalibrationText, CountsAddUp) {
  MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  RejectFrame(0, "dark: mean 0.001 below 0.016", &made.calibration);
  for (const std::size_t i : {3U, 4U}) {
    made.calibration.frames[i].in_blur_fit = false;
    made.calibration.frames[i].not_in_fit = "its scale differs too much";
  }
  const std::string text = CalibrationText(made.sweep, made.calibration, nullptr);
  EXPECT_THAT(text, HasSubstr("41 frames: 38 used, 1 rejected, 2 left out\n"));
  EXPECT_THAT(text, HasSubstr("  left out of the fit (2 frames): its scale differs too much\n"));
}

TEST(CalibrationText, WithoutDetailsSaysNothingOfThem) {
  MadeUpCalibration made = MakeUpCalibration(41, 320, 4);
  RemoveDetails(&made.calibration);
  const std::string text = CalibrationText(made.sweep, made.calibration, nullptr);
  for (const char* about :
       {"field:", "colours:", "sides", "shape", "magnification", "distortion", "worst", "not run"})
    EXPECT_THAT(text, Not(HasSubstr(about)));
}

TEST(CalibrationText, KeepsControlCharactersOffTheTerminal) {
  MadeUpCalibration made = MakeUpCalibration(7, 340, 20);
  made.calibration.frames[2].image = "evil\x1b[2J.png";
  RejectFrame(2, "dark", &made.calibration);
  EXPECT_THAT(CalibrationText(made.sweep, made.calibration, nullptr), Not(HasSubstr("\x1b")));
}

}  // namespace
}  // namespace thicklens::tools
