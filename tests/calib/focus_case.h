#ifndef THICKLENS_TESTS_CALIB_FOCUS_CASE_H_
#define THICKLENS_TESTS_CALIB_FOCUS_CASE_H_

#include <Eigen/Dense>
#include <cmath>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "calib/calibrate/focus_solution.h"
#include "calib/uncertainty/systematic_advice.h"
#include "tests/calib/blur_samples.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::testing {

// A sweep whose blur is known in closed form, in the state in which SolveFocus gets it: checked,
// with depths, measured. A dark frame comes first, so that the number of a frame differs from its
// number in the fit.
struct FocusCase {
  static constexpr std::size_t kChecked = 1;

  BlurBench bench;
  calib::FocusSweep sweep;
  calib::BlurEvidence evidence;
  calib::BlurFitResult fit;
  calib::Calibration calibration;
  std::mt19937 random{1};

  explicit FocusCase(BlurBench its_bench = ExactBench(), double offset_sigma_mm = 0)
      : bench(std::move(its_bench)) {
    evidence.setup = bench.Setup(&random);
    evidence.setup.offset_mm.sigma = offset_sigma_mm;
    sweep.camera.lens = bench.lens;
    sweep.camera.sensor.pixel_pitch_mm = bench.pitch_mm;
    sweep.direction = bench.direction;
    calibration.diagnostics.bench_offset_from = calib::kFromScale;
    calibration.summary.bench_offset_mm =
        calib::Result{bench.offset_mm, offset_sigma_mm, std::nullopt};
    calib::FrameMeasurement dark;
    dark.image = "bench/dark.png";
    dark.reading_mm = evidence.setup.frames.front().reading_mm;
    dark.rejection = "dark: mean 1";
    calibration.frames.push_back(dark);
    for (std::size_t i = 0; i < evidence.setup.frames.size(); ++i) {
      calib::FrameMeasurement frame;
      frame.image = "bench/frame-" + std::to_string(i) + ".png";
      frame.image_scale = evidence.setup.frames[i].scale;
      calibration.frames.push_back(frame);
      evidence.frames.push_back(i + kChecked);
      WriteReading(i, evidence.setup.frames[i].reading_mm);
    }
  }

  // Changes the reading of a frame in the table of readings.
  void WriteReading(std::size_t fit_frame, double reading_mm) {
    evidence.setup.frames[fit_frame].reading_mm = reading_mm;
    frame(fit_frame).reading_mm = reading_mm;
    frame(fit_frame).depth_mm =
        bench.offset_mm + model::DirectionSign(bench.direction) * reading_mm;
  }

  FocusCase& WithTexture(double error_px2) {
    evidence.spectrum = static_cast<int>(evidence.setup.estimators.size());
    evidence.setup.estimators.push_back(bench.Relative(error_px2, kReferencePx2, &random));
    return *this;
  }
  FocusCase& WithKnifeEdge(double error_px2) {
    WithPrintedEdge(error_px2, 0);
    evidence.setup.estimators.back().held_softness_px2 = 0;
    return *this;
  }
  FocusCase& WithPrintedEdge(double error_px2, double ink_px2) {
    evidence.edges = static_cast<int>(evidence.setup.estimators.size());
    evidence.setup.estimators.push_back(bench.Absolute(error_px2, ink_px2, &random));
    return *this;
  }
  FocusCase& WithFloor(double floor_px, double sigma_px) {
    sweep.floor.given_px = model::Estimate{floor_px, sigma_px};
    return *this;
  }
  FocusCase& WithTrueFloor(double sigma_px = 0) {
    return WithFloor(std::sqrt(bench.floor_px2), sigma_px);
  }

  FocusCase& Solve() {
    calib::SolveFocus(sweep, &evidence, &fit, &calibration);
    return *this;
  }

  calib::FrameMeasurement& frame(std::size_t fit_frame) {
    return calibration.frames[fit_frame + kChecked];
  }
  const calib::SystematicPart* Part(const std::string& name) const {
    for (const calib::SystematicPart& part : calibration.diagnostics.systematic_parts) {
      if (part.name == name) return &part;
    }
    return nullptr;
  }
};

// The covariance of (d1, kappa, floor in px, bench offset) by linear error propagation for exact
// readings, from finite differences of the bench's own formulas. `softness_is_free`: all V have one
// unknown constant in common. `floor_sigma_px`: sigma of a given floor, 0 for none.
struct LinearReference {
  double error_px2 = 0;
  bool softness_is_free = false;
  double floor_sigma_px = 0;
  bool floor_is_held = false;
  double offset_sigma_mm = 0;
  std::vector<std::size_t> frames{};  // empty: all

  Eigen::Matrix4d Covariance(const BlurBench& bench) const {
    std::vector<std::size_t> chosen = frames;
    for (std::size_t i = 0; frames.empty() && i < static_cast<std::size_t>(bench.count); ++i)
      chosen.push_back(i);
    const auto n = static_cast<Eigen::Index>(chosen.size());
    const double d1_mm = model::ImageDistanceMm(bench.lens, bench.focus_mm);
    const double floor_px = std::sqrt(bench.floor_px2);
    Eigen::MatrixXd jacobian(n, 4);
    Eigen::VectorXd by_offset(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const double depth_mm = bench.Depth(chosen[static_cast<std::size_t>(i)]);
      const double s2 = std::pow(bench.Scale(depth_mm), 2);
      const auto at = [&](double d1_step, double ratio_step, double floor_step, double step_mm) {
        BlurBench moved = bench;
        moved.focus_mm = model::FocusDepthMm(bench.lens, d1_mm + d1_step);
        moved.ratio += ratio_step;
        moved.floor_px2 = std::pow(floor_px + floor_step, 2);
        return moved.Variance(depth_mm + step_mm) / s2;
      };
      const double h = 1e-5;
      jacobian(i, 0) = (at(0.01 * h, 0, 0, 0) - at(-0.01 * h, 0, 0, 0)) / (0.02 * h);
      jacobian(i, 1) = (at(0, h, 0, 0) - at(0, -h, 0, 0)) / (2 * h);
      jacobian(i, 2) = floor_is_held ? 0 : (at(0, 0, h, 0) - at(0, 0, -h, 0)) / (2 * h);
      jacobian(i, 3) = softness_is_free ? 1 : 0;
      by_offset[i] = (at(0, 0, 0, 1e-3) - at(0, 0, 0, -1e-3)) / 2e-3;
    }
    const double weight = 1 / (error_px2 * error_px2);
    Eigen::Matrix4d information = weight * jacobian.transpose() * jacobian;
    if (floor_sigma_px > 0) information(2, 2) += 1 / (floor_sigma_px * floor_sigma_px);
    const Eigen::Matrix4d inverse =
        information.completeOrthogonalDecomposition().pseudoInverse().eval();
    Eigen::Vector4d slope = -inverse * (weight * jacobian.transpose() * by_offset);
    Eigen::Matrix4d covariance = inverse;
    covariance.row(3).setZero();
    covariance.col(3).setZero();
    slope[3] = 1;
    return covariance + slope * slope.transpose() * offset_sigma_mm * offset_sigma_mm;
  }
};

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_CALIB_FOCUS_CASE_H_
