#ifndef THICKLENS_TESTS_CALIB_MEASURED_SWEEP_H_
#define THICKLENS_TESTS_CALIB_MEASURED_SWEEP_H_

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "calib/fit/blur_measurement.h"
#include "calib/sweep/frame_store.h"
#include "tests/calib/simulated_sweep.h"

namespace thicklens::testing {

// Case iii on a small field, in which only the noise is unknown: the results of the registration
// are replaced by the truth.
inline model::SweepSimulationOptions StillSweep(model::TargetKind kind, int size_px,
                                                double first_mm, double step_mm, int count) {
  model::SweepSimulationOptions options = SweepCase("iii", size_px, 3);
  options.target.kind = kind;
  options.first_depth_mm = first_mm;
  options.step_mm = step_mm;
  options.frame_count = count;
  options.drift_sigma_px = 0;
  options.reading_sigma_mm = 0;
  options.flicker = 0;
  return options;
}

// A sweep and the task of measuring its blur. The reference is the frame nearest to focus.
struct MeasuredSweep {
  SimulatedSweep simulated;
  std::unique_ptr<calib::FrameStore> store;
  std::unique_ptr<calib::BlurTask> task;

  explicit MeasuredSweep(SimulatedSweep its_sweep) : simulated(std::move(its_sweep)) {
    calib::FocusSweep& sweep = simulated.sweep;
    store = std::make_unique<calib::FrameStore>(sweep);
    task = std::make_unique<calib::BlurTask>(sweep, *store);
    const model::SweepTruth& truth = simulated.truth;
    for (std::size_t i = 0; i < sweep.frames.size(); ++i) {
      task->frames.push_back(i);
      if (truth.frames[i].blur_sigma_px < truth.frames[task->reference].blur_sigma_px)
        task->reference = i;
    }
    for (const std::size_t i : task->frames) {
      calib::ScaleSample sample;
      sample.frame = i;
      sample.reading_mm = sweep.frames[i].reading_mm;
      sample.scale = sample.registration.scale = simulated.TrueScale(i, task->reference);
      sample.registration.scale_sigma = 1e-5;
      task->scales.push_back(sample);
    }
    task->offset_mm = {truth.bench_offset_mm, 0};
    task->start_focus_depth_mm = truth.focus_depth_mm;
    task->pixel_noise = 0.008;  // at the level of the light
    task->threads = 1;
  }

  calib::BlurEvidence Measure() { return calib::MeasureBlur(*task); }

  double TrueVariance(std::size_t frame) const {
    const double sigma_px = simulated.truth.frames[frame].blur_sigma_px;
    return sigma_px * sigma_px;
  }
};

inline constexpr int kFieldPx = 128;
inline constexpr int kFrames = 16;
inline constexpr double kFirstMm = 330, kStepMm = 9.3;  // focus at 400 mm, between two frames

inline SimulatedSweep Rendered(model::TargetKind kind, model::Psf psf = model::Psf::kGaussian) {
  model::SweepSimulationOptions options = StillSweep(kind, kFieldPx, kFirstMm, kStepMm, kFrames);
  options.camera.psf = psf;
  return Simulate(options);
}

// The images are read only, so one rendering serves all tests of a target.
inline const SimulatedSweep& Leaves() {
  static const SimulatedSweep rendered = Rendered(model::TargetKind::kDeadLeaves);
  return rendered;
}
inline const SimulatedSweep& Edge() {
  static const SimulatedSweep rendered = Rendered(model::TargetKind::kKnifeEdge);
  return rendered;
}

inline MeasuredSweep Measured(const SimulatedSweep& simulated,
                              model::SweepTarget target = model::SweepTarget::kAuto) {
  MeasuredSweep m(simulated);
  m.simulated.sweep.target = target;
  return m;
}

// Compares V of every sample with the truth, in px^2 of the target. The reference of a relative
// blur estimator has its expected blur.
inline void ExpectTrueVariances(const MeasuredSweep& m, const calib::BlurEvidence& evidence,
                                const calib::BlurSamples& samples, double within_px2) {
  ASSERT_EQ(samples.variances_px2.size(), static_cast<Eigen::Index>(samples.frames.size()));
  ASSERT_EQ(samples.covariance.rows(), samples.variances_px2.size());
  for (std::size_t i = 0; i < samples.frames.size(); ++i) {
    const std::size_t frame = evidence.frames[samples.frames[i]];
    const double scale = m.simulated.TrueScale(frame, m.task->reference);
    const auto k = static_cast<Eigen::Index>(i);
    EXPECT_NEAR(samples.variances_px2[k], m.TrueVariance(frame) / (scale * scale),
                within_px2 + 4 * std::sqrt(samples.covariance(k, k)))
        << frame;
  }
}

inline const calib::BlurSamples& Spectrum(const calib::BlurEvidence& evidence) {
  return evidence.setup.estimators.at(static_cast<std::size_t>(evidence.spectrum));
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_CALIB_MEASURED_SWEEP_H_
