// Frames of a simulated sweep under a law of the pupil: their waves and their edges.
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <string>

#include "model/simulate/sweep/edge_spread.h"
#include "model/simulate/sweep/periodic_image.h"
#include "thicklens/model/pupil_law.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::model {
namespace {

constexpr double kPi = 3.14159265358979323846;
const PupilOptics kOptics = {Psf::kGaussian, 2.2, 120, 16.2, 12.9};

PupilOptics With(Psf psf) {
  PupilOptics optics = kOptics;
  optics.psf = psf;
  return optics;
}

// A wave keeps its phase, and its contrast is multiplied by the transfer function.
TEST(PupilLawBlur, WavesHaveTheContrastOfTheProfile) {
  constexpr int kSize = 64;
  for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
    for (const PupilLaw law : {PupilLaw::kCosineFourth, PupilLaw::kSineCondition}) {
      const PupilProfile profile(law, With(psf), 40);
      for (const auto& [a, b] : {std::pair{3, 0}, std::pair{5, 4}, std::pair{12, 7}}) {
        cv::Mat samples(kSize, kSize, CV_64F);
        for (int y = 0; y < kSize; ++y) {
          for (int x = 0; x < kSize; ++x)
            samples.at<double>(y, x) = std::cos(2 * kPi * (a * x + b * y) / kSize);
        }
        const PeriodicImage image(samples);
        FrameBlur blur{0.5, psf, 1.7, false, &profile};
        const AxisSampling axis{0, 1.0 / kSize, kSize};
        const cv::Mat seen = image.Evaluate(axis, axis, blur);
        const double nu = std::hypot(a, b) / kSize;
        const double expected =
            profile.Transfer(2 * kPi * 1.7 * nu) * std::exp(-2 * kPi * kPi * 0.25 * nu * nu);
        EXPECT_NEAR(seen.at<double>(0, 0), expected, 1e-8) << PupilLawName(law) << " " << a;
      }
    }
  }
}

// The second moment of the line that an edge's slope draws, per px^2: floor, defocus and box.
TEST(PupilLawBlur, EdgesHaveTheSecondMomentUnderAnyLaw) {
  constexpr double kStepPx = 0.02;
  for (const PupilLaw law : AllPupilLaws()) {
    for (const Psf psf : {Psf::kGaussian, Psf::kDisc}) {
      for (const double floor_px : {0.0, 0.5}) {
        for (const bool box : {false, true}) {
          SCOPED_TRACE(PupilLawName(law) + ", " + PsfName(psf) + ", floor " +
                       std::to_string(floor_px) + (box ? ", box" : ""));
          const PupilProfile profile(law, With(psf), 40);
          const EdgeSpread edge(0.1, floor_px, profile, 3, box);
          EXPECT_NEAR(edge.At(0), 0.5, 1e-6);
          double moment = 0, sum = 0;
          for (double x = -edge.reach_px() - 1; x < edge.reach_px() + 1; x += kStepPx) {
            const double line = edge.At(x + kStepPx / 2) - edge.At(x - kStepPx / 2);
            EXPECT_GT(line, -1e-8);
            sum += line;
            moment += x * x * line;
          }
          EXPECT_NEAR(sum, 1, 1e-9);
          EXPECT_NEAR(moment, 9 + floor_px * floor_px + (box ? 1.0 / 12 : 0), 3e-3);
        }
      }
    }
  }
}

// The uniform law by its rings is the closed form of the PSF.
TEST(PupilLawBlur, EdgesOfTheUniformLawAreThoseOfThePsf) {
  const PupilProfile gaussian(PupilLaw::kUniform, With(Psf::kGaussian));
  const PupilProfile disc(PupilLaw::kUniform, With(Psf::kDisc), 100);
  for (const bool box : {false, true}) {
    const EdgeSpread by_gaussian(0.1, 0.5, gaussian, 3, box), by_disc(0.1, 0, disc, 3, box),
        by_soft_disc(0.1, 0.5, disc, 3, box);
    const EdgeSpread closed_gaussian(0.1, std::hypot(3, 0.5), 0, box), closed_disc(0.1, 0, 6, box),
        closed_soft_disc(0.1, 0.5, 6, box);
    for (const double x : {-8.0, -5.9, -2.3, 0.0, 1.1, 4.0, 6.2}) {
      EXPECT_NEAR(by_gaussian.At(x), closed_gaussian.At(x), 1e-7) << x;
      EXPECT_NEAR(by_disc.At(x), closed_disc.At(x), 1e-4) << x;
      EXPECT_NEAR(by_soft_disc.At(x), closed_soft_disc.At(x), 1e-7) << x;
    }
  }
}

// The truth states the second moment, whatever the law; the law is named in the truth's file.
TEST(PupilLawBlur, TheTruthIsTheSecondMoment) {
  SweepSimulationOptions options =
      ReadSweepSimulation(THICKLENS_SOURCE_DIR "/configs/sweeps/case-iii.yaml");
  options.camera.sensor.width_px = options.camera.sensor.height_px = 64;
  options.camera.sensor.principal_point_px.setConstant(31.5);
  for (const PupilLaw law : AllPupilLaws()) {
    options.pupil_law = law;
    const SweepTruth truth = SweepSimulator(options, {}).truth();
    EXPECT_EQ(truth.pupil_law, PupilLawName(law));
    const SweepTruth::Frame& first = truth.frames.front();
    const double r_px = BlurRadiusMm(options.camera.lens, truth.image_distance_mm, first.depth_mm) /
                        options.camera.sensor.pixel_pitch_mm;
    EXPECT_NEAR(first.blur_sigma_px, std::hypot(truth.blur_floor_px, truth.blur_ratio * r_px),
                1e-12);
  }
  options.pupil_law.reset();
  EXPECT_EQ(SweepSimulator(options, {}).truth().pupil_law, "paper");
  options.effects.without = {Effect::kFalloff};
  EXPECT_EQ(SweepSimulator(options, {}).truth().pupil_law, "uniform");
}

}  // namespace
}  // namespace thicklens::model
