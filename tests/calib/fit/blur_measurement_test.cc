#include "calib/fit/blur_measurement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "calib/uncertainty/blur_choices.h"
#include "tests/calib/measured_sweep.h"

namespace thicklens::calib {
namespace {

using model::SweepTarget;
using ::testing::Each;
using ::testing::Gt;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using namespace thicklens::testing;

// ---- the spectral blur estimator ----

TEST(MeasureBlur, ATexturesBlurIsThatOfTheLens) {
  MeasuredSweep m = Measured(Leaves());
  int ticks = 0;
  m.task->tick = [&] { ++ticks; };
  const BlurEvidence evidence = m.Measure();
  EXPECT_EQ(evidence.spectrum, 0);
  EXPECT_EQ(evidence.edges, -1);
  ASSERT_EQ(evidence.setup.estimators.size(), 1U);
  EXPECT_EQ(evidence.message, "");
  EXPECT_EQ(ticks, kFrames);  // the expectation was right, so there is one pass
  EXPECT_EQ(Spectrum(evidence).frames.size(), static_cast<std::size_t>(kFrames));
  ExpectTrueVariances(m, evidence, Spectrum(evidence), 0.02);
  ASSERT_EQ(evidence.frame_noise_ratios.size(), static_cast<std::size_t>(kFrames));
  EXPECT_THAT(evidence.frame_noise_ratios, Each(Gt(0.1)));
  EXPECT_FALSE(evidence.setup.floor_variance_px2);
}

// Windows and bands depend on the expected blur. If the expected focus is wrong, a second pass is
// made.
TEST(MeasureBlur, AWrongStartIsFoundOutAndRightedInASecondPass) {
  MeasuredSweep m = Measured(Leaves());
  const BlurEvidence right = m.Measure();
  for (const double start_mm : {340.0, 430.0, 465.0}) {
    SCOPED_TRACE(start_mm);
    int ticks = 0;
    m.task->tick = [&] { ++ticks; };
    m.task->start_focus_depth_mm = start_mm;
    const BlurEvidence evidence = m.Measure();
    EXPECT_EQ(ticks, 2 * kFrames);
    ASSERT_EQ(evidence.spectrum, 0);
    for (const EstimatorFrame& frame : evidence.spectral.frames) {
      EXPECT_NEAR(frame.expected_variance_px2 * frame.place.scale * frame.place.scale /
                      m.TrueVariance(frame.frame),
                  1, 0.05);
    }
    ASSERT_EQ(Spectrum(evidence).frames, Spectrum(right).frames);
    EXPECT_LT((Spectrum(evidence).variances_px2 - Spectrum(right).variances_px2).norm(), 0.02);
  }
}

// The blur differs from that of the default ratio and the stated aperture.
TEST(MeasureBlur, AWrongApertureIsFoundOutToo) {
  for (const double factor : {0.5, 2.0}) {
    SCOPED_TRACE(factor);
    MeasuredSweep m = Measured(Leaves());
    m.simulated.sweep.camera.lens.aperture_radius_mm *= factor;
    int ticks = 0;
    m.task->tick = [&] { ++ticks; };
    const BlurEvidence evidence = m.Measure();
    EXPECT_EQ(ticks, 2 * kFrames);
    ASSERT_EQ(evidence.spectrum, 0);
    for (const EstimatorFrame& frame : evidence.spectral.frames) {
      EXPECT_NEAR(frame.expected_variance_px2 * frame.place.scale * frame.place.scale /
                      m.TrueVariance(frame.frame),
                  1, 0.05);
    }
    ExpectTrueVariances(m, evidence, Spectrum(evidence), 0.02);
  }
}

// Strong blur: a window for a focus at the end of the sweep contains few of the frames that a
// window for the true focus contains.
TEST(MeasureBlur, InStrongBlurTheLastPassIsLaidOutForTheTruth) {
  model::SweepSimulationOptions options = thicklens::testing::SweepCase("ii", kFieldPx, 3);
  options.drift_sigma_px = options.reading_sigma_mm = options.flicker = 0;
  options.first_depth_mm = 293.2;
  options.step_mm = 0.8;
  options.frame_count = 21;
  MeasuredSweep m(Simulate(options));
  const BlurEvidence right = m.Measure();
  m.task->start_focus_depth_mm = 306;
  int ticks = 0;
  m.task->tick = [&] { ++ticks; };
  const BlurEvidence evidence = m.Measure();
  EXPECT_GE(ticks, 2 * 21);
  EXPECT_LE(ticks, 3 * 21);
  ASSERT_EQ(evidence.spectrum, 0);
  EXPECT_EQ(Spectrum(evidence).frames, Spectrum(right).frames);
  ExpectTrueVariances(m, evidence, Spectrum(evidence), 0.1);
}

// One frame was rejected and one could not be registered. Every sample must still refer to its own
// frame.
TEST(MeasureBlur, SamplesBelongToTheFramesThatTheyName) {
  MeasuredSweep m = Measured(Leaves());
  m.task->frames.erase(m.task->frames.begin() + 2);
  m.task->scales.erase(m.task->scales.begin() + 5);
  BlurEvidence evidence = m.Measure();
  CompareChoices(model::Psf::kGaussian, &evidence);
  EXPECT_EQ(evidence.frames[2], 3U);
  EXPECT_EQ(evidence.setup.frames.size(), 15U);
  EXPECT_EQ(Spectrum(evidence).frames.size(), 14U);
  for (const std::size_t f : Spectrum(evidence).frames) EXPECT_NE(evidence.frames[f], 5U);
  ExpectTrueVariances(m, evidence, Spectrum(evidence), 0.02);
  ASSERT_TRUE(evidence.narrow_band && evidence.other_psf);
  ExpectTrueVariances(m, evidence, *evidence.narrow_band, 0.05);
  EXPECT_EQ(evidence.narrow_band->frames, Spectrum(evidence).frames);
  EXPECT_EQ(evidence.other_psf->frames, Spectrum(evidence).frames);
  for (std::size_t f = 0; f < evidence.frames.size(); ++f)
    EXPECT_EQ(evidence.frame_noise_ratios[f] > 0, evidence.frames[f] != 5) << f;
}

// ---- edges ----

// Indices of the frames that are least out of focus.
std::vector<std::size_t> Sharpest(const MeasuredSweep& m, std::size_t count) {
  std::vector<std::size_t> order = m.task->frames;
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return m.TrueVariance(a) < m.TrueVariance(b); });
  order.resize(count);
  std::sort(order.begin(), order.end());
  return order;
}

TEST(MeasureBlur, AKnifeEdgeIsMeasuredThroughoutAndHasNoSoftness) {
  MeasuredSweep m = Measured(Edge(), SweepTarget::kKnifeEdge);
  const BlurEvidence evidence = m.Measure();
  ASSERT_GE(evidence.edges, 0);
  const BlurSamples& edges = evidence.setup.estimators[static_cast<std::size_t>(evidence.edges)];
  EXPECT_EQ(edges.held_softness_px2, 0.0);
  EXPECT_EQ(edges.frames.size(), static_cast<std::size_t>(kFrames));
  ExpectTrueVariances(m, evidence, edges, 0.02);
  EXPECT_FALSE(evidence.unstated_edges);
  // d(sigma^2/s^2) = 2 sigma d sigma/s^2: about a per cent of the variance.
  for (Eigen::Index i = 0; i < edges.covariance.rows(); ++i) {
    EXPECT_GT(std::sqrt(edges.covariance(i, i)), 0.001 * edges.variances_px2[i]);
    EXPECT_LT(std::sqrt(edges.covariance(i, i)), 0.05 * edges.variances_px2[i]);
    EXPECT_EQ(edges.covariance.row(i).cwiseAbs().sum(), edges.covariance(i, i));
  }
  // The spectra are used as well, with a free constant.
  ASSERT_GE(evidence.spectrum, 0);
  EXPECT_FALSE(Spectrum(evidence).held_softness_px2);
}

TEST(MeasureBlur, EdgesThatServeAsABoundAreMeasuredAboutFocusAndKeptApart) {
  for (const SweepTarget target : {SweepTarget::kAuto, SweepTarget::kPrintedEdge}) {
    MeasuredSweep m = Measured(Edge(), target);
    int ticks = 0;
    m.task->tick = [&] { ++ticks; };
    const BlurEvidence evidence = m.Measure();
    EXPECT_EQ(ticks, kFrames + 9);
    EXPECT_EQ(evidence.edges, -1);
    EXPECT_EQ(evidence.setup.estimators.size(), 1U);
    ASSERT_TRUE(evidence.unstated_edges);
    EXPECT_EQ(evidence.unstated_edges->frames, Sharpest(m, 9));
    EXPECT_FALSE(evidence.unstated_edges->held_softness_px2);
    ExpectTrueVariances(m, evidence, *evidence.unstated_edges, 0.02);
  }
}

TEST(MeasureBlur, OfATextureNoEdgesAreMeasured) {
  MeasuredSweep m = Measured(Edge(), SweepTarget::kTexture);
  const BlurEvidence evidence = m.Measure();
  EXPECT_EQ(evidence.edges, -1);
  EXPECT_FALSE(evidence.unstated_edges);
  EXPECT_GE(evidence.spectrum, 0);
}

// Without spectra only the edges are left: every frame is used, and the softness is free unless the
// target is a knife edge.
TEST(MeasureBlur, EdgesStandInWhereNothingRegisters) {
  for (const SweepTarget target :
       {SweepTarget::kAuto, SweepTarget::kPrintedEdge, SweepTarget::kKnifeEdge}) {
    MeasuredSweep m = Measured(Edge(), target);
    m.task->scales.clear();
    const BlurEvidence evidence = m.Measure();
    EXPECT_EQ(evidence.spectrum, -1);
    ASSERT_EQ(evidence.edges, 0);
    ASSERT_EQ(evidence.setup.estimators.size(), 1U);
    EXPECT_FALSE(evidence.unstated_edges);
    EXPECT_EQ(evidence.setup.estimators[0].held_softness_px2.has_value(),
              target == SweepTarget::kKnifeEdge);
    EXPECT_EQ(evidence.setup.estimators[0].frames.size(), static_cast<std::size_t>(kFrames));
    ExpectTrueVariances(m, evidence, evidence.setup.estimators[0], 0.02);
  }
}

// Four frames with an edge are not enough for a blur estimator.
TEST(MeasureBlur, TooFewFramesWithAnEdgeAreNoEstimator) {
  for (const std::size_t count : {4U, 5U}) {
    MeasuredSweep m = Measured(Edge(), SweepTarget::kKnifeEdge);
    m.task->scales.clear();
    m.task->frames = Sharpest(m, count);
    const BlurEvidence evidence = m.Measure();
    EXPECT_EQ(evidence.setup.estimators.size(), count < 5 ? 0U : 1U);
    EXPECT_THAT(evidence.message, HasSubstr("too few frames"));
  }
}

// ---- failed measurements ----

TEST(MeasureBlur, FewerThanFiveRegisteredFramesAreReported) {
  MeasuredSweep m = Measured(Leaves(), SweepTarget::kTexture);
  m.task->scales = {m.task->scales.begin() + 6, m.task->scales.begin() + 10};
  const BlurEvidence evidence = m.Measure();
  EXPECT_THAT(evidence.setup.estimators, IsEmpty());
  EXPECT_EQ(evidence.spectrum, -1);
  EXPECT_THAT(evidence.message, HasSubstr("too few frames show enough of the same target"));
}

TEST(MeasureBlur, FramesThatDoNotOverlapAreReported) {
  MeasuredSweep m = Measured(Leaves(), SweepTarget::kTexture);
  for (std::size_t i = 0; i < m.task->scales.size(); ++i)
    m.task->scales[i].registration.shift_px.x() = 90.0 * static_cast<double>(i);
  const BlurEvidence evidence = m.Measure();
  EXPECT_THAT(evidence.setup.estimators, IsEmpty());
  EXPECT_THAT(evidence.message, HasSubstr("too few frames show enough of the same target"));
}

// The reference is far out of focus itself, so that the window is too small for its blur.
TEST(MeasureBlur, ABlurredReferenceIsNoReference) {
  MeasuredSweep m = Measured(Leaves(), SweepTarget::kTexture);
  m.simulated.sweep.camera.lens.aperture_radius_mm *= 8;
  m.task->reference = 0;
  for (ScaleSample& sample : m.task->scales)
    sample.scale =
        m.simulated.truth.frames[0].depth_mm / m.simulated.truth.frames[sample.frame].depth_mm;
  const BlurEvidence evidence = m.Measure();
  EXPECT_THAT(evidence.setup.estimators, IsEmpty());
  EXPECT_THAT(evidence.message, HasSubstr("too few frames show enough of the same target"));
}

TEST(MeasureBlur, ABlankTargetShowsTooLittleTexture) {
  SimulatedSweep blank = Leaves();
  blank.sweep.read_frame = [](std::size_t i) {
    cv::Mat image(kFieldPx, kFieldPx, CV_8U);
    cv::RNG random(40 + i);
    random.fill(image, cv::RNG::NORMAL, 100, 2);
    return image;
  };
  MeasuredSweep m = Measured(blank);
  const BlurEvidence evidence = m.Measure();
  EXPECT_THAT(evidence.setup.estimators, IsEmpty());
  EXPECT_THAT(evidence.message, HasSubstr("too little texture above the noise"));
}

}  // namespace
}  // namespace thicklens::calib
