// The terms of the error of a calibration, their order, and the numbers of its frames.
#include "thicklens/calib/error_budget.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

namespace thicklens::calib {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

// zf 300 +- 0.5 mm, d1 60 +- 0.02 mm and kappa 0.45 +- 0.002, from two frames at 250 and 375 mm.
Calibration Found() {
  Calibration c;
  c.summary.focus_depth_mm = Result{300, 0.5, Eigen::Vector2d(298, 303)};
  c.summary.image_distance_mm = Result{60, 0.02, Eigen::Vector2d(59.9, 60.1)};
  c.summary.blur_ratio = Result{0.45, 0.002, Eigen::Vector2d(0.44, 0.47)};
  for (const double depth_mm : {250.0, 375.0}) {
    FrameMeasurement frame;
    frame.depth_mm = depth_mm;
    frame.in_blur_fit = true;
    c.frames.push_back(frame);
  }
  return c;
}

SystematicPart Part(const std::string& name, double zf_mm, double d1_mm, double kappa) {
  SystematicPart part;
  part.name = name;
  part.focus_depth_mm = {-zf_mm, zf_mm};
  part.image_distance_mm = {-d1_mm, d1_mm};
  part.blur_ratio = {-kappa, kappa};
  part.remedy = "change " + name;
  return part;
}

// [D164] by hand: zf/z - 1 is 0.2 and -0.2 in the two frames.
TEST(ErrorTerms, AreComparedByWhatTheyDoToTheBlur) {
  Calibration c = Found();
  c.diagnostics.systematic_parts = {Part("first", 3, 0.12, 0), Part("second", 0, 0, 0.03),
                                    Part("third", 0.6, 0.024, 0.009)};
  const std::vector<ErrorTerm> terms = ErrorTerms(c);
  ASSERT_EQ(terms.size(), 4U);
  EXPECT_EQ(terms[0].name, "second");
  EXPECT_NEAR(terms[0].effect, 0.03 / 0.45, 1e-12);
  EXPECT_EQ(terms[1].name, "first");
  EXPECT_NEAR(terms[1].effect, 3 / (300 * 0.2), 1e-12);
  EXPECT_EQ(terms[2].name, "third");
  EXPECT_NEAR(terms[2].effect, std::hypot(0.6 / (300 * 0.2), 0.009 / 0.45), 1e-12);
  EXPECT_EQ(terms[3].name, kNoiseTerm);
  EXPECT_TRUE(terms[3].is_statistical);
  EXPECT_NEAR(terms[3].focus_depth_mm, 0.98, 1e-12);
  EXPECT_NEAR(terms[3].blur_ratio, 0.00392, 1e-12);
  EXPECT_NEAR(terms[3].effect, std::hypot(0.98 / (300 * 0.2), 0.00392 / 0.45), 1e-12);
}

// A tolerance of the lens moves d1 and not zf. d1 = 60 +- 0.02 for zf = 300 +- 0.5: an error of
// 0.06 mm of d1 is one of 1.5 mm of zf.
TEST(ErrorTerms, AnErrorOfTheImageDistanceCountsAsThatOfZf) {
  Calibration c = Found();
  c.diagnostics.systematic_parts = {Part("lens.rear_focal_length_mm", 0, 0.06, 0)};
  const std::vector<ErrorTerm> terms = ErrorTerms(c);
  ASSERT_EQ(terms.size(), 2U);
  EXPECT_EQ(terms[0].name, "lens.rear_focal_length_mm");
  EXPECT_NEAR(terms[0].effect, 1.5 / (300 * 0.2), 1e-12);
}

// The share of the offset is the regression of a result on it: sigma(x) times the correlation.
TEST(ErrorTerms, TheBenchOffsetHasThePartThatTheCovarianceGivesIt) {
  Calibration c = Found();
  c.summary.bench_offset_mm = Result{100, 0.4, {}};
  c.diagnostics.covariance_order = {"image_distance_mm", "blur_ratio", "bench_offset_mm"};
  Eigen::Vector3d sigma(0.02, 0.002, 0.4);
  Eigen::Matrix3d correlation;
  correlation << 1, 0, -0.8, 0, 1, 0.6, -0.8, 0.6, 1;
  c.diagnostics.covariance = sigma.asDiagonal() * correlation * sigma.asDiagonal();
  const std::vector<ErrorTerm> terms = ErrorTerms(c);
  ASSERT_EQ(terms.size(), 2U);
  EXPECT_EQ(terms[0].name, kOffsetTerm);
  EXPECT_NEAR(terms[0].image_distance_mm, 1.96 * 0.02 * 0.8, 1e-9);
  EXPECT_NEAR(terms[0].focus_depth_mm, 1.96 * 0.5 * 0.8, 1e-9);
  EXPECT_NEAR(terms[0].blur_ratio, 1.96 * 0.002 * 0.6, 1e-9);
  EXPECT_NEAR(terms[1].image_distance_mm, 1.96 * 0.02 * 0.6, 1e-9);
  EXPECT_NEAR(terms[1].blur_ratio, 1.96 * 0.002 * 0.8, 1e-9);
}

TEST(ErrorTerms, AreNoneWithoutAResult) {
  EXPECT_TRUE(ErrorTerms(Calibration()).empty());
  EXPECT_EQ(LargestErrorInWords({}), "");
}

// Whatever the parts are, the sentence names the largest of them, and the first one with a remedy.
TEST(LargestError, IsThatOfTheTableInEveryCase) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> size(0, 1);
  for (int round = 0; round < 500; ++round) {
    Calibration c = Found();
    c.summary.bench_offset_mm = Result{100, 0.5 * size(random), {}};
    for (const char* name : {"alpha", "beta", "gamma"}) {
      SystematicPart part = Part(name, 3 * size(random), 0.1 * size(random), 0.02 * size(random));
      if (size(random) < 0.4) part.remedy = "no remedy: it is so";
      c.diagnostics.systematic_parts.push_back(part);
    }
    const std::vector<ErrorTerm> terms = ErrorTerms(c);
    for (std::size_t i = 1; i < terms.size(); ++i) ASSERT_GE(terms[i - 1].effect, terms[i].effect);
    const std::string words = LargestErrorInWords(terms);
    EXPECT_THAT(words, HasSubstr(" % of the error is due to " + TermInWords(terms[0].name)));
    std::size_t first = 0;
    while (HasNoRemedy(terms[first])) ++first;
    EXPECT_THAT(words, ::testing::EndsWith(terms[first].remedy));
    EXPECT_EQ(first > 0, words.find("which no measurement makes smaller") != std::string::npos);
  }
}

TEST(HalfWidth, AddsTheLongerSideAndTwoSidedNoise) {
  EXPECT_NEAR(HalfWidth({300, 0.5, Eigen::Vector2d(298, 303)}), 3 + 0.98, 1e-12);
  EXPECT_NEAR(HalfWidth({300, 0.5, {}}), 0.98, 1e-12);
}

TEST(CountFrames, AddUp) {
  Calibration c = Found();
  c.frames.resize(6);
  c.frames[2].rejection = "dark: mean 0.001";
  c.frames[3].rejection = "blank";
  c.frames[4].not_in_fit = "its scale differs";
  c.diagnostics.blur.done = true;
  CountFrames(&c);
  EXPECT_EQ(c.summary.frames_used, 2);
  EXPECT_EQ(c.summary.frames_rejected, 2);
  EXPECT_EQ(c.summary.frames_left_out, 2);
  EXPECT_THAT(c.frames[5].not_in_fit, StartsWith("its blur could not be measured"));
  c.diagnostics.blur.done = false;  // before a fit, all frames that passed the checks are used
  CountFrames(&c);
  EXPECT_EQ(c.summary.frames_used, 4);
  EXPECT_EQ(c.summary.frames_left_out, 0);
}

}  // namespace
}  // namespace thicklens::calib
