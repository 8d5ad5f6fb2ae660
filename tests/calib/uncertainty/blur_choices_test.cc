#include "calib/uncertainty/blur_choices.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "tests/calib/measured_sweep.h"

namespace thicklens::calib {
namespace {

using model::TargetKind;
using ::testing::IsEmpty;
using namespace thicklens::testing;

TEST(CompareChoices, NamesTheShapeThatMadeTheFrames) {
  for (const model::Psf made : {model::Psf::kGaussian, model::Psf::kDisc}) {
    const SimulatedSweep simulated =
        made == model::Psf::kGaussian ? Leaves() : Rendered(TargetKind::kDeadLeaves, made);
    for (const model::Psf stated : {model::Psf::kGaussian, model::Psf::kDisc}) {
      SCOPED_TRACE(PsfName(made) + " stated as " + PsfName(stated));
      MeasuredSweep m = Measured(simulated);
      m.simulated.sweep.camera.psf = stated;
      BlurEvidence evidence = m.Measure();
      ASSERT_EQ(evidence.spectrum, 0) << evidence.message;
      CompareChoices(stated, &evidence);
      EXPECT_EQ(evidence.better_psf, made);
      ASSERT_TRUE(evidence.gaussian_misfit && evidence.disc_misfit);
      const double right =
          made == model::Psf::kGaussian ? *evidence.gaussian_misfit : *evidence.disc_misfit;
      const double wrong =
          made == model::Psf::kGaussian ? *evidence.disc_misfit : *evidence.gaussian_misfit;
      EXPECT_GT(wrong, 1.01 * right);
      // The right shape has the right second moment, whether it is the stated one or the other.
      ASSERT_TRUE(evidence.other_psf);
      ExpectTrueVariances(m, evidence, made == stated ? Spectrum(evidence) : *evidence.other_psf,
                          0.05);
    }
  }
}

TEST(CompareChoices, HalfTheBandSaysTheSameLessWell) {
  MeasuredSweep m = Measured(Leaves());
  BlurEvidence evidence = m.Measure();
  CompareChoices(model::Psf::kGaussian, &evidence);
  ASSERT_TRUE(evidence.narrow_band);
  EXPECT_EQ(evidence.narrow_band->frames, Spectrum(evidence).frames);
  ExpectTrueVariances(m, evidence, *evidence.narrow_band, 0.03);
  // The outermost frames lose most of their modes.
  EXPECT_GT(evidence.narrow_band->covariance(0, 0), 1.2 * Spectrum(evidence).covariance(0, 0));
  // No frame was excluded, so the samples stay.
  const BlurEvidence before = m.Measure();
  EXPECT_TRUE(Spectrum(before).variances_px2 == Spectrum(evidence).variances_px2);
  // The leakage of the window stays as well; it differs between shapes.
  const std::size_t modes = before.region.modes.size();
  EXPECT_TRUE((before.region.leakage.At(2, modes) == evidence.region.leakage.At(2, modes)).all());
}

// The result is the same as if the frame had never been measured: it must not affect the texture
// either.
TEST(CompareChoices, WhatWasThrownOutHasNoSayInTheRest) {
  SimulatedSweep damaged = Leaves();
  damaged.stored = std::make_shared<std::vector<cv::Mat>>(*Leaves().stored);
  // The other target is the next one after those by which the modes are selected.
  model::SweepSimulationOptions other =
      StillSweep(TargetKind::kDeadLeaves, kFieldPx, kFirstMm, kStepMm, kFrames);
  other.seed = 77;
  other.first_depth_mm = kFirstMm + 9 * kStepMm;
  other.frame_count = 1;
  damaged.frame(9) = Simulate(other).frame(0);
  damaged.sweep.read_frame = [stored = damaged.stored](std::size_t i) { return (*stored)[i]; };
  MeasuredSweep with = Measured(damaged);
  BlurEvidence evidence = with.Measure();
  ASSERT_EQ(evidence.spectrum, 0) << evidence.message;
  BlurSamples& samples = evidence.setup.estimators[0];
  ASSERT_EQ(samples.frames[9], 9U);
  std::vector<Eigen::Index> kept;
  for (Eigen::Index i = 0; i < kFrames; ++i) {
    if (i != 9) kept.push_back(i);
  }
  samples.frames.erase(samples.frames.begin() + 9);
  samples.variances_px2 = Eigen::VectorXd(samples.variances_px2(kept));
  samples.covariance = Eigen::MatrixXd(samples.covariance(kept, kept));
  const Eigen::VectorXd influenced = samples.variances_px2;
  CompareChoices(model::Psf::kGaussian, &evidence);

  MeasuredSweep without = Measured(Leaves());
  without.task->frames.erase(without.task->frames.begin() + 9);
  BlurEvidence expected = without.Measure();
  CompareChoices(model::Psf::kGaussian, &expected);
  const auto apart = [&](const Eigen::VectorXd& v) {
    return (v - Spectrum(expected).variances_px2).cwiseAbs().maxCoeff();
  };
  ASSERT_EQ(Spectrum(evidence).variances_px2.size(), kFrames - 1);
  EXPECT_LT(apart(Spectrum(evidence).variances_px2), 1e-4);
  EXPECT_GT(apart(influenced), 5e-3);
  for (std::size_t i = 0; i + 1 < kFrames; ++i) {
    EXPECT_EQ(evidence.frames[Spectrum(evidence).frames[i]],
              expected.frames[Spectrum(expected).frames[i]]);
  }
  ASSERT_TRUE(evidence.narrow_band && evidence.other_psf);
  EXPECT_EQ(evidence.narrow_band->frames, Spectrum(evidence).frames);
  EXPECT_EQ(evidence.other_psf->frames, Spectrum(evidence).frames);
}

// All samples are relative to the reference.
TEST(CompareChoices, WithoutItsReferenceNothingIsCompared) {
  MeasuredSweep m = Measured(Leaves());
  BlurEvidence evidence = m.Measure();
  BlurSamples& samples = evidence.setup.estimators[0];
  std::vector<Eigen::Index> kept;
  for (Eigen::Index i = 0; i < kFrames; ++i) {
    if (i != static_cast<Eigen::Index>(m.task->reference)) kept.push_back(i);
  }
  samples.frames.erase(samples.frames.begin() + static_cast<std::ptrdiff_t>(m.task->reference));
  samples.variances_px2 = Eigen::VectorXd(samples.variances_px2(kept));
  samples.covariance = Eigen::MatrixXd(samples.covariance(kept, kept));
  CompareChoices(model::Psf::kGaussian, &evidence);
  EXPECT_FALSE(evidence.narrow_band || evidence.other_psf || evidence.gaussian_misfit);
  EXPECT_EQ(Spectrum(evidence).frames.size(), static_cast<std::size_t>(kFrames - 1));
}

TEST(CompareChoices, WithoutASpectralEstimatorThereIsNothingToCompare) {
  BlurEvidence evidence;
  CompareChoices(model::Psf::kGaussian, &evidence);
  EXPECT_FALSE(evidence.narrow_band || evidence.other_psf || evidence.gaussian_misfit);
  EXPECT_THAT(evidence.examples, IsEmpty());
}

// ---- examples ----

TEST(CompareChoices, ExamplesAreTheNearestTheSharpestAndTheFarthest) {
  for (const auto direction : {model::BenchDirection::kAway, model::BenchDirection::kToward}) {
    SimulatedSweep simulated = Leaves();
    if (direction == model::BenchDirection::kToward) {
      // The images are the same but in reverse order, and the scale runs in the other direction.
      simulated.sweep.direction = direction;
      std::reverse(simulated.truth.frames.begin(), simulated.truth.frames.end());
      for (std::size_t i = 0; i < kFrames; ++i)
        simulated.sweep.frames[i].reading_mm = -simulated.truth.frames[i].depth_mm;
      simulated.sweep.read_frame = [stored = simulated.stored](std::size_t i) {
        return (*stored)[kFrames - 1 - i];
      };
    }
    MeasuredSweep m = Measured(simulated);
    BlurEvidence evidence = m.Measure();
    CompareChoices(model::Psf::kGaussian, &evidence);
    ASSERT_EQ(evidence.examples.size(), 3U);
    const int nearest = direction == model::BenchDirection::kAway ? 0 : kFrames - 1;
    EXPECT_EQ(evidence.examples[0].frame, nearest);
    EXPECT_EQ(evidence.examples[1].frame, static_cast<int>(m.task->reference));
    EXPECT_EQ(evidence.examples[2].frame, kFrames - 1 - nearest);
    for (const BlurExample& example : evidence.examples) {
      EXPECT_FALSE(example.is_edge);
      const std::size_t n = example.x.size();
      ASSERT_GT(n, 3U);
      ASSERT_EQ(example.measured.size(), n);
      ASSERT_EQ(example.gaussian.size(), n);
      ASSERT_EQ(example.disc.size(), n);
      // The true transfer relative to the reference: exp(-2 pi^2 (sigma^2 - sigma_r^2 s^2) nu^2),
      // nu in cycles per px of the frame.
      const auto frame = static_cast<std::size_t>(example.frame);
      const double s = m.simulated.TrueScale(frame, m.task->reference);
      const double added = m.TrueVariance(frame) - m.TrueVariance(m.task->reference) * s * s;
      for (std::size_t k = 0; k < n; ++k) {
        const double truth = std::exp(-2 * CV_PI * CV_PI * added * example.x[k] * example.x[k]);
        EXPECT_NEAR(example.gaussian[k], truth, 0.02);
        EXPECT_NEAR(example.measured[k], truth, 0.1);
        EXPECT_NEAR(example.disc[k], truth, 0.15);
        EXPECT_TRUE(k == 0 || example.x[k] > example.x[k - 1]);
      }
    }
  }
}

}  // namespace
}  // namespace thicklens::calib
