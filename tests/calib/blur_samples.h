#ifndef THICKLENS_TESTS_CALIB_BLUR_SAMPLES_H_
#define THICKLENS_TESTS_CALIB_BLUR_SAMPLES_H_

#include <Eigen/Dense>
#include <cmath>
#include <random>
#include <vector>

#include "calib/fit/blur_fit.h"
#include "support/test_cameras.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::testing {

// A bench whose blur is known in closed form, and the samples that its blur estimators return. It
// is case iii of the sweeps: A uf^2 = 116.6 px^2.
struct BlurBench {
  model::ThickLens lens = WideLens(4.4643);
  double pitch_mm = 0.006;
  double focus_mm = 400, ratio = 0.45, floor_px2 = 0.25;
  double offset_mm = 30;
  calib::BlurModel law = calib::BlurModel::kPerspective;
  model::BenchDirection direction = model::BenchDirection::kAway;
  double first_mm = 330, last_mm = 480;
  int count = 31;
  std::size_t reference = 12;
  double reading_sigma_mm = 0;       // sigma of the readings
  double scale_sigma = 0;            // sigma of the scales, if `scales_tell`
  bool scales_tell = false;          // the setup gets the errors of the scales
  bool states_reading_sigma = true;  // false: the setup gets 0
  double noise = 1;                  // noise of the blur estimators, in their stated errors

  double Depth(std::size_t i) const {
    return first_mm + (last_mm - first_mm) * static_cast<double>(i) / (count - 1);
  }
  // A uf^2, px^2, computed from the lens: (kappa r f1/(p (zf - f1)))^2.
  double Curvature() const {
    return std::pow(ratio * lens.aperture_radius_mm * lens.front_focal_length_mm /
                        (pitch_mm * (focus_mm - lens.front_focal_length_mm)),
                    2);
  }
  // sigma^2 of the lens, px^2 of the sensor, computed from the blur radius of the lens, or for a
  // telecentric lens from the same slope at focus.
  double Variance(double depth_mm) const {
    const double d1_mm = model::ImageDistanceMm(lens, focus_mm);
    double radius_mm = 0;
    if (law == calib::BlurModel::kPerspective) {
      radius_mm = model::BlurRadiusMm(lens, d1_mm, depth_mm);
    } else {
      radius_mm = lens.aperture_radius_mm * model::DefocusScaleMm(lens, d1_mm) *
                  (depth_mm - focus_mm) / (focus_mm * focus_mm);
    }
    return floor_px2 + std::pow(ratio * radius_mm / pitch_mm, 2);
  }
  double Scale(double depth_mm) const {
    return law == calib::BlurModel::kPerspective ? Depth(reference) / depth_mm : 1;
  }
  double OnTarget(double depth_mm) const {
    return Variance(depth_mm) / std::pow(Scale(depth_mm), 2);
  }

  // Returns everything except the blur samples. `errors_mm` gets the errors of the readings.
  calib::BlurFitSetup Setup(std::mt19937* random, std::vector<double>* errors_mm = nullptr) const {
    std::normal_distribution<double> normal(0, 1);
    calib::BlurFitSetup setup;
    setup.lens = lens;
    setup.pixel_pitch_mm = pitch_mm;
    setup.law = law;
    setup.offset_mm = {offset_mm, 0};
    setup.direction = direction;
    setup.reading_sigma_mm = states_reading_sigma ? reading_sigma_mm : 0;
    for (int i = 0; i < count; ++i) {
      const double depth_mm = Depth(static_cast<std::size_t>(i));
      const double error_mm = reading_sigma_mm * normal(*random);
      calib::FitFrame frame;
      frame.reading_mm = model::DirectionSign(direction) * (depth_mm - offset_mm) + error_mm;
      frame.scale = Scale(depth_mm) * (1 + scale_sigma * normal(*random));
      if (scales_tell && static_cast<std::size_t>(i) != reference) frame.scale_sigma = scale_sigma;
      setup.frames.push_back(frame);
      if (errors_mm != nullptr) errors_mm->push_back(error_mm);
    }
    return setup;
  }

  // sigma^2/scale^2 + softness of every frame, each with an independent error.
  calib::BlurSamples Absolute(double error_px2, double softness_px2, std::mt19937* random) const {
    std::normal_distribution<double> normal(0, 1);
    calib::BlurSamples samples;
    samples.variances_px2.resize(count);
    for (int i = 0; i < count; ++i) {
      const auto frame = static_cast<std::size_t>(i);
      samples.frames.push_back(frame);
      samples.variances_px2[i] =
          OnTarget(Depth(frame)) + softness_px2 + noise * error_px2 * normal(*random);
    }
    samples.covariance = Eigen::VectorXd::Constant(count, error_px2 * error_px2).asDiagonal();
    return samples;
  }

  // Returns the samples relative to the reference frame, whose variance is stated as
  // `reference_px2` without an error. Its own error is in all the other samples.
  calib::BlurSamples Relative(double error_px2, double reference_px2, std::mt19937* random) const {
    calib::BlurSamples samples = Absolute(error_px2, 0, random);
    const auto r = static_cast<Eigen::Index>(reference);
    samples.variances_px2.array() += reference_px2 - samples.variances_px2[r];
    samples.covariance.array() += error_px2 * error_px2;
    samples.covariance.row(r).setZero();
    samples.covariance.col(r).setZero();
    return samples;
  }
};

// A bench without noise.
inline BlurBench ExactBench() {
  BlurBench bench;
  bench.noise = 0;
  return bench;
}

// The blur of the reference that a relative blur estimator states
inline constexpr double kReferencePx2 = 1.7;

// A setup with one blur estimator of a kind, with the noise of the bench.
inline calib::BlurFitSetup WithEdge(const BlurBench& bench, double error_px2,
                                    std::mt19937* random) {
  calib::BlurFitSetup setup = bench.Setup(random);
  setup.estimators = {bench.Absolute(error_px2, 0, random)};
  setup.estimators[0].held_softness_px2 = 0;
  return setup;
}

inline calib::BlurFitSetup WithTexture(const BlurBench& bench, double error_px2,
                                       double floor_sigma_px2, std::mt19937* random) {
  std::normal_distribution<double> normal(0, 1);
  calib::BlurFitSetup setup = bench.Setup(random);
  setup.estimators = {bench.Relative(error_px2, kReferencePx2, random)};
  // A given floor was measured, so it scatters with its error.
  setup.floor_variance_px2 = model::Estimate{
      bench.floor_px2 + bench.noise * floor_sigma_px2 * normal(*random), floor_sigma_px2};
  return setup;
}

inline BlurBench WithReadings(double sigma_mm, double scale_sigma) {
  BlurBench bench;
  bench.reading_sigma_mm = sigma_mm;
  bench.scale_sigma = scale_sigma;
  bench.scales_tell = true;
  return bench;
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_CALIB_BLUR_SAMPLES_H_
