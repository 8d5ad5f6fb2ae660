// Whole calibrations of frames that were read with a wrong transfer or processed: they are reported
// with an interval of kappa that contains the truth, and good frames are not accused.
#include "calib/calibrate/response_effects.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "tests/calib/calibrated_sweep.h"
#include "tests/calib/simulated_sweep.h"

namespace thicklens::calib {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::Not;
using thicklens::testing::CalibrateWithoutMap;
using thicklens::testing::GiveFloor;
using thicklens::testing::Simulate;
using thicklens::testing::SimulatedSweep;
using thicklens::testing::SweepCase;

SimulatedSweep SweepOf(const std::string& name, model::TransferCurve transfer, std::uint64_t seed) {
  model::SweepSimulationOptions options = SweepCase(name, 240, seed);
  options.target.kind = model::TargetKind::kDeadLeaves;
  options.camera.sensor.transfer = transfer;
  SimulatedSweep simulated = Simulate(options);
  GiveFloor(&simulated);
  return simulated;
}

void Process(const std::function<cv::Mat(const cv::Mat&)>& process, SimulatedSweep* simulated) {
  for (cv::Mat& frame : *simulated->stored) {
    ASSERT_EQ(frame.depth(), CV_8U);
    frame = process(frame);
  }
}

// Noise reduction by non-local means: each pixel is the mean of those around which the image looks
// alike, weighted by the difference of their patches of 3 x 3 px.
cv::Mat Denoised(const cv::Mat& bytes) {
  constexpr int kReach = 4;        // px
  constexpr double kStrength = 8;  // grey levels
  cv::Mat grey, sum = cv::Mat::zeros(bytes.size(), CV_32F), weights = sum.clone();
  bytes.convertTo(grey, CV_32F);
  cv::Mat padded;
  cv::copyMakeBorder(grey, padded, kReach, kReach, kReach, kReach, cv::BORDER_REFLECT_101);
  for (int y = 0; y <= 2 * kReach; ++y) {
    for (int x = 0; x <= 2 * kReach; ++x) {
      const cv::Mat other = padded(cv::Rect({x, y}, grey.size()));
      cv::Mat difference = grey - other, weight;
      cv::blur(difference.mul(difference), difference, cv::Size(3, 3));
      cv::exp(difference / (-kStrength * kStrength), weight);
      sum += weight.mul(other);
      weights += weight;
    }
  }
  cv::Mat denoised;
  cv::Mat(sum / weights).convertTo(denoised, CV_8U);
  return denoised;
}

void ExpectCoversRatio(const Calibration& c, const model::SweepTruth& truth) {
  ASSERT_TRUE(c.summary.blur_ratio && c.summary.blur_ratio->systematic) << c.summary.reason;
  const Result& ratio = *c.summary.blur_ratio;
  EXPECT_LT(ratio.systematic->x() - 2 * ratio.sigma, truth.blur_ratio);
  EXPECT_GT(ratio.systematic->y() + 2 * ratio.sigma, truth.blur_ratio);
}

void ExpectNotAccused(const Calibration& c) {
  EXPECT_TRUE(c.diagnostics.response.measured);
  EXPECT_THAT(
      c.summary.warnings,
      Each(AllOf(Not(HasSubstr("contradict sensor.transfer")), Not(HasSubstr("weak detail")),
                 Not(HasSubstr("are sharpened")), Not(HasSubstr("are smoothed")),
                 Not(HasSubstr("contrast of detail")), Not(HasSubstr("compressed: ")))));
}

TEST(ResponseEffects, GoodFramesAreNotAccused) {
  for (const auto& transfer : {model::TransferCurve::Linear(), model::TransferCurve::Srgb()}) {
    const Calibration c = CalibrateWithoutMap(SweepOf("ii", transfer, 3));
    ExpectNotAccused(c);
    ASSERT_TRUE(c.diagnostics.response.light_exponent);
    const model::Estimate& exponent = *c.diagnostics.response.light_exponent;
    EXPECT_NEAR(exponent.value, 1, 4 * exponent.sigma + 0.02);
    EXPECT_LT(exponent.sigma, 0.05);
  }
}

TEST(ResponseEffects, LinearFramesReadAsSrgbAreNamed) {
  SimulatedSweep s = SweepOf("ii", model::TransferCurve::Linear(), 4);
  s.sweep.camera.sensor.transfer = model::TransferCurve::Srgb();
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_EQ(c.diagnostics.response.better_transfer, "linear");
  EXPECT_THAT(c.summary.warnings, Contains(AllOf(HasSubstr("contradict sensor.transfer: srgb"),
                                                 HasSubstr("with transfer linear kappa is"))));
  EXPECT_THAT(c.summary.warnings, Not(Contains(HasSubstr("weak detail"))));
  ExpectCoversRatio(c, s.truth);
}

TEST(ResponseEffects, FramesInSrgbReadAsLinearAreNamed) {
  SimulatedSweep s = SweepOf("ii", model::TransferCurve::Srgb(), 5);
  s.sweep.camera.sensor.transfer = model::TransferCurve::Linear();
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_EQ(c.diagnostics.response.better_transfer, "srgb");
  ExpectCoversRatio(c, s.truth);
}

TEST(ResponseEffects, AnUnusualCurveIsNamedByItsPower) {
  SimulatedSweep s = SweepOf("ii", model::TransferCurve::Gamma(1.5), 6);
  s.sweep.camera.sensor.transfer = model::TransferCurve::Linear();
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_THAT(c.diagnostics.response.better_transfer, HasSubstr("gamma-1."));
  ExpectCoversRatio(c, s.truth);
}

// A power beyond those of transfer curves: no curve is named, and no effect is stated.
TEST(ResponseEffects, ATransferWithoutABetterCurveHasAnUnknownEffect) {
  SimulatedSweep s = SweepOf("ii", model::TransferCurve::Linear(), 6);
  for (cv::Mat& frame : *s.stored) {
    cv::Mat values;
    frame.convertTo(values, CV_32F, 1.0 / 255);
    cv::pow(values, 1.0 / 15, values);
    values.convertTo(frame, CV_16U, 65535);
  }
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_EQ(c.diagnostics.response.better_transfer, "");
  EXPECT_THAT(c.summary.warnings,
              Contains(AllOf(HasSubstr("contradict sensor.transfer"),
                             HasSubstr("effect on kappa is unknown"), HasSubstr("Use frames"))));
}

TEST(ResponseEffects, RemovedWeakDetailIsReportedWithItsSize) {
  SimulatedSweep s = SweepOf("ii", model::TransferCurve::Srgb(), 7);
  Process(&Denoised, &s);
  const Calibration c = CalibrateWithoutMap(s);
  ASSERT_TRUE(c.diagnostics.response.weak_detail_loss);
  EXPECT_GT(c.diagnostics.response.weak_detail_loss->value, 0.02)
      << c.diagnostics.response.weak_detail_loss->sigma;
  EXPECT_THAT(c.summary.warnings, Contains(AllOf(HasSubstr("removed weak detail"),
                                                 HasSubstr("no blocks of a strong compression"),
                                                 HasSubstr("makes kappa too large"))));
  EXPECT_THAT(c.summary.warnings, Not(Contains(HasSubstr("contradict sensor.transfer"))));
  EXPECT_THAT(c.summary.warnings, Not(Contains(HasSubstr("A wrong sensor.transfer"))));
  ExpectCoversRatio(c, s.truth);
}

// At f/16 the blur changes little between frames, which then do not show the power of their
// transfer: a wrong one removes weak detail as noise reduction does, and moves kappa to either
// side.
TEST(ResponseEffects, AWrongTransferIsNamedBesideNoiseReduction) {
  for (const std::uint64_t seed : {1U, 4U}) {
    model::SweepSimulationOptions options = SweepCase("ii", 240, seed);
    options.target.kind = model::TargetKind::kDeadLeaves;
    options.camera.sensor.transfer = model::TransferCurve::Linear();
    constexpr double kFNumber = 16;
    model::ThickLens& lens = options.camera.lens;
    lens.aperture_radius_mm = lens.rear_focal_length_mm / (2 * kFNumber);
    SimulatedSweep s = Simulate(options);
    GiveFloor(&s);
    s.sweep.camera.sensor.transfer = model::TransferCurve::Srgb();
    const Calibration c = CalibrateWithoutMap(s);
    EXPECT_THAT(c.summary.warnings,
                Contains(AllOf(HasSubstr("removed weak detail"), HasSubstr("Noise reduction has"),
                               HasSubstr("A wrong sensor.transfer has this effect as well"))))
        << seed;
    ExpectCoversRatio(c, s.truth);
  }
}

// An under-exposed camera cuts off the darkest values, and an over-exposed one the brightest. The
// exponent would be 1.014 if the bright parts were not left out.
TEST(ResponseEffects, ClippedFramesAreNotAccused) {
  for (const bool dark : {true, false}) {
    SCOPED_TRACE(dark ? "under-exposed" : "over-exposed");
    SimulatedSweep s = SweepOf("ii", model::TransferCurve::Linear(), 10);
    const cv::Mat middle = s.stored->at(s.stored->size() / 2);
    int level = dark ? 0 : 255;
    for (double share = 0; share < 0.02;) {
      level += dark ? 1 : -1;
      share = cv::mean(dark ? middle <= level : middle >= level)[0] / 255;
    }
    Process(
        [&](const cv::Mat& bytes) {
          return cv::Mat(dark ? bytes - level : bytes * (255.0 / level));
        },
        &s);
    const Calibration c = CalibrateWithoutMap(s);
    ExpectNotAccused(c);
    ASSERT_TRUE(c.diagnostics.response.light_exponent && c.diagnostics.response.weak_detail_loss);
    EXPECT_NEAR(c.diagnostics.response.light_exponent->value, 1, 0.01);
  }
}

TEST(ResponseEffects, SharpeningIsReportedAndMovesKappaLittle) {
  SimulatedSweep s = SweepOf("ii", model::TransferCurve::Srgb(), 8);
  Process(
      [](const cv::Mat& bytes) {
        cv::Mat wide, sharp;
        cv::GaussianBlur(bytes, wide, cv::Size(), 1);
        cv::addWeighted(bytes, 2, wide, -1, 0, sharp);
        return sharp;
      },
      &s);
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_THAT(c.summary.warnings, Contains(HasSubstr("the frames are sharpened")));
  EXPECT_THAT(c.summary.warnings, Not(Contains(HasSubstr("weak detail"))));
  ExpectCoversRatio(c, s.truth);
}

// The overshoots of a sharpening filter change the mean of the light as a wrong transfer does.
TEST(ResponseEffects, StrongSharpeningIsNotTakenForATransfer) {
  for (const double radius_px : {1.0, 2.0}) {
    SimulatedSweep s = SweepOf("ii", model::TransferCurve::Srgb(), 8);
    Process(
        [&](const cv::Mat& bytes) {
          cv::Mat wide, sharp;
          cv::GaussianBlur(bytes, wide, cv::Size(), radius_px);
          cv::addWeighted(bytes, 2.5, wide, -1.5, 0, sharp);
          return sharp;
        },
        &s);
    const Calibration c = CalibrateWithoutMap(s);
    EXPECT_THAT(c.summary.warnings, Not(Contains(HasSubstr("contradict sensor.transfer"))));
    ExpectCoversRatio(c, s.truth);
  }
}

// Sharpening of what exceeds the noise leaves the noise as it is, and moves kappa.
TEST(ResponseEffects, SharpeningThatDependsOnTheContrastIsReported) {
  SimulatedSweep s = SweepOf("ii", model::TransferCurve::Srgb(), 8);
  Process(
      [](const cv::Mat& bytes) {
        cv::Mat wide, sharp, detail;
        cv::GaussianBlur(bytes, wide, cv::Size(), 1);
        cv::addWeighted(bytes, 2, wide, -1, 0, sharp);
        cv::absdiff(bytes, wide, detail);
        cv::Mat out = bytes.clone();
        sharp.copyTo(out, detail > 3);
        return out;
      },
      &s);
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_THAT(c.summary.warnings, Contains(HasSubstr("changed the contrast of detail")));
  EXPECT_THAT(c.summary.warnings, Not(Contains(HasSubstr("contradict sensor.transfer"))));
  ExpectCoversRatio(c, s.truth);
}

// Edges are kept, and the noise between them is removed. Demosaicing smooths noise as well, and
// is not accused.
TEST(ResponseEffects, SmoothedNoiseIsToldFromDemosaicing) {
  for (const bool demosaicing : {true, false}) {
    SCOPED_TRACE(demosaicing);
    SimulatedSweep s = SweepOf("ii", model::TransferCurve::Srgb(), 8);
    Process(
        [&](const cv::Mat& bytes) {
          cv::Mat out;
          if (demosaicing) {
            cv::cvtColor(bytes, out, cv::COLOR_BayerRG2RGB);
            cv::cvtColor(out, out, cv::COLOR_RGB2GRAY);
          } else {
            cv::bilateralFilter(bytes, out, 5, 8, 1);
          }
          return out;
        },
        &s);
    const Calibration c = CalibrateWithoutMap(s);
    if (demosaicing) {
      ExpectNotAccused(c);
    } else {
      EXPECT_THAT(c.summary.warnings, Contains(HasSubstr("the frames are smoothed")));
    }
    ExpectCoversRatio(c, s.truth);
  }
}

TEST(ResponseEffects, StrongCompressionIsReported) {
  SimulatedSweep s = SweepOf("ii", model::TransferCurve::Srgb(), 9);
  Process(
      [](const cv::Mat& bytes) {
        std::vector<unsigned char> file;
        cv::imencode(".jpg", bytes, file, {cv::IMWRITE_JPEG_QUALITY, 20});
        return cv::imdecode(file, cv::IMREAD_UNCHANGED);
      },
      &s);
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_THAT(c.summary.warnings, Contains(HasSubstr("blocks of 8 x 8 px")));
  ExpectCoversRatio(c, s.truth);
}

TEST(ResponseEffectsSlow, NoGoodSweepIsAccused) {
  for (const std::string name : {"i", "ii", "iii", "iv"}) {
    for (const model::TargetKind target :
         {model::TargetKind::kDeadLeaves, model::TargetKind::kPinkNoise,
          model::TargetKind::kWhiteNoise, model::TargetKind::kCheckerboard}) {
      for (const model::Psf psf : {model::Psf::kGaussian, model::Psf::kDisc}) {
        model::SweepSimulationOptions options = SweepCase(name, 240, 30);
        options.target.kind = target;
        options.camera.psf = psf;
        SimulatedSweep simulated = Simulate(options);
        GiveFloor(&simulated);
        const Calibration c = CalibrateWithoutMap(simulated);
        if (c.summary.outcome == Outcome::kRefused) continue;
        SCOPED_TRACE(name + " " + model::TargetKindName(target) + " " + model::PsfName(psf));
        ExpectNotAccused(c);
      }
    }
  }
}

}  // namespace
}  // namespace thicklens::calib
