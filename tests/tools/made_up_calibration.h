#ifndef THICKLENS_TESTS_TOOLS_MADE_UP_CALIBRATION_H_
#define THICKLENS_TESTS_TOOLS_MADE_UP_CALIBRATION_H_

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::tools {

// A sweep and what a calibration of it could look like, filled by the laws and seeded noise:
// nothing is measured here. Depths are offset + reading, the truth that of the camera below.
struct MadeUpCalibration {
  calib::FocusSweep sweep;
  calib::Calibration calibration;
  model::SweepTruth truth;
};

inline MadeUpCalibration MakeUpCalibration(int frame_count, double first_depth_mm, double step_mm) {
  constexpr double kFocusMm = 400, kKappa = 0.45, kFloorPx = 0.5, kOffsetMm = 12.34;
  MadeUpCalibration made;
  model::Camera& camera = made.sweep.camera;
  camera.name = "bench-camera";
  camera.lens = {12.5, 12.8, 3.0, 4.46};
  camera.sensor.width_px = 640;
  camera.sensor.height_px = 480;
  camera.sensor.pixel_pitch_mm = 0.006;
  camera.sensor.principal_point_px = {319.5, 239.5};
  camera.statements["lens.lens_thickness_mm"] = {0.1, true};
  made.sweep.reading_sigma_mm = 0.07;

  const double k_mm = 12.5 * kFocusMm / (kFocusMm - 12.5);
  const double d1_mm = 3.0 + 12.8 * kFocusMm / (kFocusMm - 12.5);
  made.truth = {d1_mm, kFocusMm, kKappa, kFloorPx, kOffsetMm, {}};

  std::mt19937 generator(7);
  std::normal_distribution<double> normal;
  calib::Calibration& c = made.calibration;
  c.outcome = calib::Outcome::kOk;
  c.reason.clear();
  for (int i = 0; i < frame_count; ++i) {
    const double z_mm = first_depth_mm + step_mm * i;
    calib::FrameMeasurement frame;
    frame.image = fmt::format("/sweeps/bench/frame_{:03}.png", i);
    frame.reading_mm = z_mm - kOffsetMm + 0.07 * normal(generator);
    frame.depth_mm = frame.reading_mm + kOffsetMm;
    frame.statistics = {0.4, 0.2, 0.3, 0.004, 0.05, 0.001, 0};
    const double defocus_px = kKappa * 4.46 * k_mm * std::abs(1 / z_mm - 1 / kFocusMm) / 0.006;
    const double sigma_px = std::hypot(kFloorPx, defocus_px);
    frame.blur_sigma_error_px = 0.01 + 0.004 * sigma_px;
    frame.blur_sigma_px = sigma_px + frame.blur_sigma_error_px * normal(generator);
    frame.source_blur_sigma_px = std::hypot(0.7, 0.85 * sigma_px) + 0.02 * normal(generator);
    frame.normalised_edge_slope = 0.3 / std::hypot(sigma_px, 0.4);
    frame.mean_edge_slope = frame.normalised_edge_slope * 0.2 * std::pow(kFocusMm / z_mm, 2);
    frame.edge_count = 5000;
    frame.in_blur_fit = true;
    frame.blur_fit_weight = 1;
    frame.in_scale_fit = true;
    made.sweep.frames.push_back({frame.image, frame.reading_mm});
    made.truth.frames.push_back({frame.image, z_mm, frame.reading_mm, sigma_px});
    c.frames.push_back(frame);
  }
  const int middle = frame_count / 2;
  const double reference_mm = first_depth_mm + step_mm * middle;
  for (int i = 0; i < frame_count; ++i)
    c.frames[static_cast<std::size_t>(i)].image_scale =
        reference_mm / (first_depth_mm + step_mm * i);

  c.image_distance_mm = {d1_mm + 0.0003, 0.0012, Eigen::Vector2d(d1_mm - 0.004, d1_mm + 0.003)};
  c.focus_depth_mm = {kFocusMm - 0.28, 1.1, Eigen::Vector2d(kFocusMm - 3.1, kFocusMm + 3.9)};
  c.blur_ratio = {kKappa + 0.0012, 0.0021, Eigen::Vector2d(0.441, 0.462)};
  c.blur_floor_px = {kFloorPx + 0.008, 0.012, std::nullopt};
  c.bench_offset_mm = {kOffsetMm - 0.05, 0.11, std::nullopt};
  c.covariance_order = {"image_distance_mm", "blur_ratio", "blur_floor_px", "bench_offset_mm"};
  const Eigen::Vector4d sigmas(0.0012, 0.0021, 0.012, 0.11);
  Eigen::Matrix4d correlation = Eigen::Matrix4d::Identity();
  correlation(0, 3) = correlation(3, 0) = -0.71;
  correlation(1, 2) = correlation(2, 1) = -0.55;
  c.covariance = sigmas.asDiagonal() * correlation * sigmas.asDiagonal();

  c.source.done = true;
  c.source.message = "done";
  c.source.sharpest_frame = std::max(0, middle - 1);
  c.source.focus_depth_mm = kFocusMm - 6.5;
  c.source.image_distance_mm = 3.0 + 12.8 * 393.5 / (393.5 - 12.5);
  c.source.blur_ratio = 0.77;
  c.source.ratio_frames = frame_count - 1;

  c.sharpness.done = true;
  c.sharpness.message = "done";
  c.sharpness.focus_depth_mm = kFocusMm + 0.9;
  c.sharpness.sigma_mm = 1.3;
  c.sharpness.reference_depth_mm = kFocusMm;
  // ln of the index above to second order in x = z0/z - 1: the blur is sigma = B |x|, so that
  // ln(.3/sqrt(S0 + .4^2 + B^2 x^2)) = ln(.3/sqrt(.41)) - B^2 x^2/(2 * .41).
  const double b_px = kKappa * 4.46 * k_mm / kFocusMm / 0.006;
  c.sharpness.log_parabola = {std::log(0.3 / std::sqrt(0.41)), 0, -b_px * b_px / 0.82};
  c.sharpness.from_depth_mm = 385;
  c.sharpness.to_depth_mm = 416;
  c.sharpness.frames_used = 8;

  c.scale.done = true;
  c.scale.message = "done";
  c.scale.reference_frame = middle;
  c.scale.offset_mm = {kOffsetMm - 0.05, 0.11, std::nullopt};
  c.scale.reference_depth_mm = reference_mm;
  c.scale.reading_rms_mm = 0.068;
  c.scale.frames_used = frame_count;

  c.blur.done = true;
  c.blur.message = "done";
  c.blur.chi2_per_dof = 1.04;
  c.blur.frames_used = frame_count;
  c.frames_used = frame_count;
  c.seconds = 2.7;
  return made;
}

// What the gates leave of a frame: its statistics and the reason.
inline void RejectFrame(int index, const std::string& reason, calib::Calibration* calibration) {
  calib::FrameMeasurement& old = calibration->frames[static_cast<std::size_t>(index)];
  calib::FrameMeasurement frame;
  frame.image = old.image;
  frame.reading_mm = old.reading_mm;
  frame.depth_mm = old.depth_mm;
  frame.statistics = old.statistics;
  frame.rejection = reason;
  old = frame;
  --calibration->frames_used;
}

// The same sweep when nothing came of it.
inline void RefuseAll(const std::string& reason, calib::Calibration* calibration) {
  calib::Calibration refused;
  refused.reason = reason;
  refused.frames = calibration->frames;
  refused.frames_used = calibration->frames_used;
  *calibration = refused;
}

}  // namespace thicklens::tools

#endif  // THICKLENS_TESTS_TOOLS_MADE_UP_CALIBRATION_H_
