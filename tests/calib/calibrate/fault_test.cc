// Faults of a bench must not enter the result unnoticed. Damaged frames are named and do no harm,
// sweeps that would give a wrong answer with a small error are refused, and harmless changes are
// accepted.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <regex>
#include <string>

#include "tests/calib/calibrated_sweep.h"
#include "tests/calib/damaged_sweep.h"
#include "thicklens/calib/calibrate.h"

namespace thicklens::calib {
namespace {

using namespace thicklens::testing;
using ::testing::ContainsRegex;

constexpr int kSizePx = 192;

// Dead leaves with the floor and the bench offset given, rendered once.
const SimulatedSweep& Clean(const std::string& name) {
  static std::map<std::string, SimulatedSweep> rendered;
  const auto found = rendered.find(name);
  if (found != rendered.end()) return found->second;
  SimulatedSweep sweep = SweepWithFloor(name, kSizePx, 1);
  return rendered.emplace(name, sweep).first->second;
}

// The calibration of the clean sweep of a case, computed once.
const Calibration& CleanResult(const std::string& name) {
  static std::map<std::string, Calibration> results;
  const auto found = results.find(name);
  if (found != results.end()) return found->second;
  return results.emplace(name, CalibrateWithoutMap(Clean(name))).first->second;
}

// Distinguishes "frame-3" from "frame-31".
bool NamesFrame(const std::string& text, const std::string& name) {
  return std::regex_search(text, std::regex(name + "([^0-9]|$)"));
}

// Returns all messages about one frame.
std::string Said(const Calibration& c, std::size_t frame) {
  std::string said = c.frames[frame].rejection;
  for (const std::string& warning : c.summary.warnings) {
    if (NamesFrame(warning, c.frames[frame].image)) said += " | " + warning;
  }
  return said;
}

void ExpectRefused(const Calibration& c, const std::string& why) {
  EXPECT_EQ(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
  EXPECT_THAT(c.summary.reason, ContainsRegex(why));
  EXPECT_FALSE(c.summary.image_distance_mm);
  EXPECT_FALSE(c.summary.focus_depth_mm);
  EXPECT_FALSE(c.summary.blur_ratio);
}

// Returns the amount in "reading off by 15.1 mm", without its sign.
std::optional<double> AmountOff(const std::string& said) {
  static const std::regex amount(R"(reading off by (?:about )?([-+]?[0-9]+\.?[0-9]*) mm)");
  std::smatch found;
  if (!std::regex_search(said, found, amount)) return std::nullopt;
  return std::abs(std::stod(found[1]));
}

void ExpectReadingOffBy(const Calibration& c, std::size_t frame, double amount_mm) {
  SCOPED_TRACE(c.frames[frame].image + ": " + Said(c, frame));
  const std::optional<double> off_mm = AmountOff(Said(c, frame));
  ASSERT_TRUE(off_mm);
  EXPECT_NEAR(*off_mm, std::abs(amount_mm), 0.1 * std::abs(amount_mm) + 0.3);
}

void ExpectRightInSpiteOfFaults(const std::string& name) {
  SimulatedSweep damaged = DeepCopy(Clean(name));
  const PlantedFaults faults = PlantFaults(&damaged);
  const Calibration& clean = CleanResult(name);
  ASSERT_TRUE(clean.summary.focus_depth_mm) << clean.summary.reason;
  const Calibration c = CalibrateWithoutMap(damaged);
  ASSERT_TRUE(c.summary.focus_depth_mm && c.summary.blur_ratio && c.summary.image_distance_mm)
      << c.summary.reason;
  const model::SweepTruth& truth = damaged.truth;
  const auto within = [](const Result& r, double true_value) {
    EXPECT_LT(std::abs(r.value - true_value), 2.5 * r.sigma);
  };
  within(*c.summary.focus_depth_mm, truth.focus_depth_mm);
  within(*c.summary.image_distance_mm, truth.image_distance_mm);
  within(*c.summary.blur_ratio, truth.blur_ratio);
  EXPECT_LT(c.summary.focus_depth_mm->sigma, 1.5 * clean.summary.focus_depth_mm->sigma);
  EXPECT_LT(c.summary.blur_ratio->sigma, 1.5 * clean.summary.blur_ratio->sigma);
  for (const std::size_t frame : {faults.black, faults.white, faults.overexposed, faults.smeared}) {
    EXPECT_NE(Said(c, frame), "") << "nothing is said of " << c.frames[frame].image;
  }
  ExpectReadingOffBy(c, faults.shifted, faults.shift_mm);
  ExpectReadingOffBy(c, faults.swapped_first, faults.swap_mm);
  ExpectReadingOffBy(c, faults.swapped_second, faults.swap_mm);
  // Hardly any undamaged frame is reported.
  EXPECT_LE(std::count_if(c.frames.begin(), c.frames.end(),
                          [&](const FrameMeasurement& frame) { return !frame.rejection.empty(); }),
            7 + static_cast<int>(c.frames.size()) / 20);
}

TEST(PlantedFaults, AreNamedAndDoNoHarmInStrongDefocus) { ExpectRightInSpiteOfFaults("ii"); }
TEST(PlantedFaults, AreNamedAndDoNoHarmBehindAThickLens) { ExpectRightInSpiteOfFaults("iii"); }
TEST(PlantedFaults, SlowAreNamedAndDoNoHarmInWeakDefocus) { ExpectRightInSpiteOfFaults("i"); }
TEST(PlantedFaults, SlowAreNamedAndDoNoHarmAtASmallAperture) { ExpectRightInSpiteOfFaults("iv"); }

class WrongSweep : public ::testing::TestWithParam<std::string> {};

TEST_P(WrongSweep, TheSameImageRepeatedIsRefusedForItsScale) {
  SimulatedSweep s = DeepCopy(Clean(GetParam()));
  for (cv::Mat& frame : *s.stored) frame = s.frame(12).clone();
  ExpectRefused(CalibrateWithoutMap(s), "scale|repeated|does not change");
}

// Independent noise does not make images different.
TEST_P(WrongSweep, TheSameSceneWithFreshNoiseIsRefusedForItsScale) {
  SimulatedSweep s = DeepCopy(Clean(GetParam()));
  cv::RNG random(3);
  const cv::Mat repeated = s.frame(12).clone();
  for (cv::Mat& frame : *s.stored) {
    cv::Mat noise(repeated.size(), CV_16S), sum;
    random.fill(noise, cv::RNG::NORMAL, 0, 2);
    cv::add(repeated, noise, sum, cv::noArray(), CV_8U);
    frame = sum;
  }
  ExpectRefused(CalibrateWithoutMap(s), "scale|repeated|does not change");
}

TEST_P(WrongSweep, ReversedReadingsAreRefusedNamingTheDirection) {
  SimulatedSweep s = DeepCopy(Clean(GetParam()));
  ReverseReadings(&s);
  ExpectRefused(CalibrateWithoutMap(s), "direction");
}

TEST_P(WrongSweep, ReadingsInCentimetresAreRefused) {
  SimulatedSweep s = DeepCopy(Clean(GetParam()));
  ScaleReadings(&s, 0.1);
  s.sweep.reading_sigma_mm *= 0.1;
  ExpectRefused(CalibrateWithoutMap(s), "unit");
}

TEST_P(WrongSweep, ReadingsOfCentimetresInMillimetresAreRefused) {
  SimulatedSweep s = DeepCopy(Clean(GetParam()));
  ScaleReadings(&s, 10);
  s.sweep.reading_sigma_mm *= 10;
  ExpectRefused(CalibrateWithoutMap(s), "unit");
}

INSTANTIATE_TEST_SUITE_P(LongLens, WrongSweep, ::testing::Values("ii"));
INSTANTIATE_TEST_SUITE_P(SlowThickLens, WrongSweep, ::testing::Values("iii"));

// If the focal length is stated as 35 mm instead of 50, the blur law requires kappa = 0.975.
// Because the rim fall-off of such a short lens darkens more, an aperture that looks so wide
// requires kappa = 1.00. A Gaussian of this width contains more light than an aperture passes.
TEST(WrongSweepOfALongLens, AWrongFocalLengthIsRefusedOrWarnedOf) {
  SimulatedSweep s = DeepCopy(Clean("ii"));
  model::ThickLens& lens = s.sweep.camera.lens;
  lens.front_focal_length_mm = lens.rear_focal_length_mm = 35;
  lens.aperture_radius_mm *= 35.0 / 50;  // follows from the f-number
  const Calibration c = CalibrateWithoutMap(s);
  std::string said = c.summary.outcome == Outcome::kRefused ? c.summary.reason : "";
  for (const std::string& warning : c.summary.warnings) said += " | " + warning;
  EXPECT_THAT(said, ContainsRegex("0\\.9[0-9]|1\\.0[0-9]"));
  EXPECT_THAT(said, ContainsRegex("no lens|not physical|kappa|blur ratio"));
}

// Expects no wrong result with a small error: either the sweep is refused, or the truth is within 3
// sigma of the stated values.
void ExpectHonest(const Calibration& c, const model::SweepTruth& truth) {
  if (c.summary.outcome == Outcome::kRefused) {
    EXPECT_FALSE(c.summary.focus_depth_mm);
    return;
  }
  ASSERT_TRUE(c.summary.focus_depth_mm) << c.summary.reason;
  const Result& zf = *c.summary.focus_depth_mm;
  const Eigen::Vector2d interval = zf.systematic.value_or(Eigen::Vector2d(zf.value, zf.value));
  EXPECT_GT(truth.focus_depth_mm, std::min(interval.x(), zf.value) - 3 * zf.sigma);
  EXPECT_LT(truth.focus_depth_mm, std::max(interval.y(), zf.value) + 3 * zf.sigma);
}

TEST(PeriodicTarget, SlowIsNeverConfidentlyWrong) {
  for (const std::string name : {"ii", "iii", "v"}) {
    SCOPED_TRACE(name);
    model::SweepSimulationOptions options = SweepCase(name, kSizePx, 1);
    options.target.kind = model::TargetKind::kCheckerboard;
    SimulatedSweep s = Simulate(options);
    GiveFloor(&s);
    ExpectHonest(CalibrateWithoutMap(s), s.truth);
  }
}

// Expects that a change is harmless: zf stays within 2.5 sigma of the truth or within 5 % of a
// step, and moves by less than 2 sigma or 5 % of a step; the same holds for kappa, with 1 % instead
// of 5 % of a step; sigma stays the same. (If sigma is 1 % of a step, the effect of JPEG is
// invisible to the eye.)
void ExpectHarmless(const SimulatedSweep& touched, const std::string& name) {
  const Calibration& clean = CleanResult(name);
  ASSERT_TRUE(clean.summary.focus_depth_mm) << clean.summary.reason;
  const Calibration c = CalibrateWithoutMap(touched);
  ASSERT_TRUE(c.summary.focus_depth_mm && c.summary.blur_ratio) << c.summary.reason;
  const Result& zf = *c.summary.focus_depth_mm;
  const double step_mm =
      std::abs(touched.sweep.frames[1].reading_mm - touched.sweep.frames[0].reading_mm);
  EXPECT_LT(std::abs(zf.value - touched.truth.focus_depth_mm),
            std::max(2.5 * zf.sigma, 0.05 * step_mm));
  EXPECT_LT(std::abs(zf.value - clean.summary.focus_depth_mm->value),
            std::max(2 * zf.sigma, 0.05 * step_mm));
  EXPECT_LT(zf.sigma, 1.5 * clean.summary.focus_depth_mm->sigma);
  const Result& ratio = *c.summary.blur_ratio;
  EXPECT_LT(std::abs(ratio.value - touched.truth.blur_ratio),
            std::max(2.5 * ratio.sigma, 0.01 * ratio.value));
  EXPECT_LT(std::abs(ratio.value - clean.summary.blur_ratio->value),
            std::max(2 * ratio.sigma, 0.01 * ratio.value));
}

class Harmless : public ::testing::TestWithParam<std::string> {};

TEST_P(Harmless, FlickerOfAFifth) {
  model::SweepSimulationOptions options = SweepCase(GetParam(), kSizePx, 1);
  options.flicker = 0.2;
  options.light_level *= 0.7;  // flicker that is bright enough to clip is another case
  SimulatedSweep s = Simulate(options);
  GiveFloor(&s);
  ExpectHarmless(s, GetParam());
}

TEST_P(Harmless, JpegOfQuality90) {
  SimulatedSweep s = DeepCopy(Clean(GetParam()));
  StoreAsJpeg(&s, 90);
  ExpectHarmless(s, GetParam());
}

TEST_P(Harmless, DustOnTheSensor) {
  SimulatedSweep s = DeepCopy(Clean(GetParam()));
  AddDust(&s);
  ExpectHarmless(s, GetParam());
}

INSTANTIATE_TEST_SUITE_P(LongLens, Harmless, ::testing::Values("ii"));
INSTANTIATE_TEST_SUITE_P(SlowThickLens, Harmless, ::testing::Values("iii"));

}  // namespace
}  // namespace thicklens::calib
