#ifndef THICKLENS_TESTS_TOOLS_SUPPORT_FAKE_CALIBRATION_H_
#define THICKLENS_TESTS_TOOLS_SUPPORT_FAKE_CALIBRATION_H_

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <utility>

#include "support/test_cameras.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::tools {

namespace made_up {

inline constexpr double kFocusMm = 400, kKappa = 0.45, kFloorPx = 0.5, kOffsetMm = 12.34;
using Normal = std::normal_distribution<double>;

// The fit of one side, which differs from the typical values by this much.
inline calib::SideFit Side(double off_mm, int frames) {
  calib::SideFit side;
  side.done = true;
  side.message = "done";
  side.focus_depth_mm = {kFocusMm + off_mm, 0.9};
  side.blur_ratio = {kKappa - 0.01 * off_mm, 0.006};
  side.frames_used = frames;
  return side;
}

// Five by four tiles of a target that is tilted about the vertical axis, in a curved field; the
// last one could not be fitted.
inline calib::FieldMap Field(std::mt19937* generator) {
  Normal normal;
  calib::FieldMap field;
  field.done = true;
  field.message = "done";
  field.columns = 5;
  field.rows = 4;
  for (int row = 0; row < field.rows; ++row) {
    for (int column = 0; column < field.columns; ++column) {
      calib::FieldTile tile;
      tile.centre_px = {64 + 128.0 * column, 60 + 120.0 * row};
      const double x = (column - 2) / 2.0, y = (row - 1.5) / 1.5;
      tile.done = row < 3 || column < 4;
      tile.message = tile.done ? "done" : "no texture above noise";
      if (tile.done)
        tile.focus_depth_mm = {
            kFocusMm - 1.6 * x - 0.9 * (x * x + y * y) + 0.15 * normal(*generator), 0.15};
      field.tiles.push_back(tile);
    }
  }
  field.tilt_right_deg = model::Estimate{1.21, 0.09};
  field.tilt_down_deg = model::Estimate{-0.05, 0.08};
  field.curvature_mm = model::Estimate{-1.83, 0.21};
  field.astigmatism_mm = model::Estimate{0.42, 0.11};
  field.clusters = {{{kFocusMm - 0.28, 0.04}, 19}};
  return field;
}

// The transfer of a frame relative to the sharpest: a Gaussian's with noise, and the disc of the
// same second moment (radius 2 sigma).
inline calib::BlurExample Example(int frame, double added_sigma_px, std::mt19937* generator) {
  constexpr double kPi = 3.14159265358979323846;
  Normal normal;
  calib::BlurExample example;
  example.frame = frame;
  for (int i = 0; i < 40; ++i) {
    const double f = 0.008 * (i + 1), w = 2 * kPi * f * added_sigma_px;
    const double gaussian = std::exp(-w * w / 2);
    if (gaussian < 0.1) break;
    example.x.push_back(f);
    example.gaussian.push_back(gaussian);
    example.disc.push_back(w > 0 ? std::cyl_bessel_j(1.0, 2 * w) / w : 1);
    example.measured.push_back(gaussian + 0.015 * normal(*generator));
  }
  return example;
}

// Adds all details that a calibration may report beyond its results.
inline void AddDetails(calib::Calibration* calibration) {
  calib::Calibration& c = *calibration;
  std::mt19937 generator(8);
  const int count = static_cast<int>(c.frames.size());
  c.diagnostics.paper_recipe.sharpest_normalised_frame = count / 2;
  c.diagnostics.paper_recipe.normalised_focus_depth_mm =
      c.frames[static_cast<std::size_t>(count / 2)].depth_mm;
  c.diagnostics.scale.kind = calib::ScaleKind::kInverseDepth;
  c.diagnostics.scale.distortion_at_corner = model::Estimate{0.0042, 0.0006};
  c.diagnostics.blur.weak_direction = "blur_floor_px against focus_depth_mm";
  c.diagnostics.blur.weak_correlation = -0.9;
  c.diagnostics.blur.estimator = "relative spectrum";
  c.diagnostics.blur.gaussian_misfit = 1.04;
  c.diagnostics.blur.disc_misfit = 2.31;
  c.diagnostics.nearer = Side(-1.4, count / 2);
  c.diagnostics.farther = Side(1.1, count - count / 2);
  c.diagnostics.field = Field(&generator);
  for (const auto& [name, off_mm] :
       {std::pair("red", 0.61), std::pair("green", 0.02), std::pair("blue", 1.44)}) {
    calib::ChannelFocus channel;
    channel.name = name;
    channel.done = true;
    channel.message = "done";
    channel.focus_depth_mm = {kFocusMm + off_mm, 0.12};
    c.diagnostics.channels.push_back(channel);
  }
  c.diagnostics.magnification = calib::MagnificationCheck{26.4812, 5, {16.1, 0.05}};
  c.diagnostics.systematic_parts = {
      {"blur floor", {-2.9, 3.6}, {-0.0015, 0.0012}, {-0.007, 0.008}, "photograph a knife edge"},
      {"lens.front_focal_length_mm",
       {0, 0},
       {-0.1, 0.1},
       {-0.002, 0.002},
       "have the lens measured"},
      {"side of focus",
       {-1.1, 1.4},
       {-0.0005, 0.0005},
       {-0.004, 0.005},
       "more frames on both sides"}};
  c.diagnostics.advice =
      "photograph a knife edge: the floor is 80 % of your error, +-3.6 mm would become +-1.5";
  for (const int i : {0, count / 2, count - 1})
    c.examples.push_back(
        Example(i, c.frames[static_cast<std::size_t>(i)].blur_sigma_px, &generator));
}

}  // namespace made_up

// A sweep and a possible calibration of it, computed from the laws and seeded noise: nothing is
// measured. Depths are offset + reading; the truth is that of the camera below.
struct MadeUpCalibration {
  calib::FocusSweep sweep;
  calib::Calibration calibration;
  model::SweepTruth truth;
};

inline MadeUpCalibration MakeUpCalibration(int frame_count, double first_depth_mm, double step_mm) {
  using made_up::kFloorPx, made_up::kFocusMm, made_up::kKappa, made_up::kOffsetMm;
  MadeUpCalibration made;
  model::Camera& camera = made.sweep.camera;
  camera.name = "bench-camera";
  camera.lens = testing::WideLens();
  camera.sensor = testing::CentredSensor(640, 480, 0.006);
  camera.statements["lens.lens_thickness_mm"] = {0.1, true};
  made.sweep.reading_sigma_mm = 0.07;

  const double k_mm = 12.5 * kFocusMm / (kFocusMm - 12.5);
  const double d1_mm = 3.0 + 12.8 * kFocusMm / (kFocusMm - 12.5);
  made.truth.image_distance_mm = d1_mm;
  made.truth.focus_depth_mm = kFocusMm;
  made.truth.blur_ratio = kKappa;
  made.truth.blur_floor_px = kFloorPx;
  made.truth.bench_offset_mm = kOffsetMm;

  std::mt19937 generator(7);
  std::normal_distribution<double> normal;
  calib::Calibration& c = made.calibration;
  c.summary.outcome = calib::Outcome::kOk;
  c.summary.reason.clear();
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
    frame.image_scale_sigma = 1e-4;
    frame.reading_error_sigma_mm = 0.03;
    frame.reading_error_mm = frame.reading_mm + kOffsetMm - z_mm + 0.03 * normal(generator);
    made.sweep.frames.push_back({frame.image, frame.reading_mm});
    made.truth.frames.push_back({frame.image, z_mm, frame.reading_mm, sigma_px});
    c.frames.push_back(frame);
  }
  const int middle = frame_count / 2;
  const double reference_mm = first_depth_mm + step_mm * middle;
  for (int i = 0; i < frame_count; ++i)
    c.frames[static_cast<std::size_t>(i)].image_scale =
        reference_mm / (first_depth_mm + step_mm * i);

  c.summary.image_distance_mm = {d1_mm + 0.0003, 0.0012,
                                 Eigen::Vector2d(d1_mm - 0.004, d1_mm + 0.003)};
  c.summary.focus_depth_mm = {kFocusMm - 0.28, 1.1,
                              Eigen::Vector2d(kFocusMm - 3.1, kFocusMm + 3.9)};
  c.summary.blur_ratio = {kKappa + 0.0012, 0.0021, Eigen::Vector2d(0.441, 0.462)};
  c.summary.blur_floor_px = {kFloorPx + 0.008, 0.012, std::nullopt};
  c.summary.bench_offset_mm = {kOffsetMm - 0.05, 0.11, std::nullopt};
  c.diagnostics.covariance_order = {"image_distance_mm", "blur_ratio", "blur_floor_px",
                                    "bench_offset_mm"};
  const Eigen::Vector4d sigmas(0.0012, 0.0021, 0.012, 0.11);
  Eigen::Matrix4d correlation = Eigen::Matrix4d::Identity();
  correlation(0, 3) = correlation(3, 0) = -0.71;
  correlation(1, 2) = correlation(2, 1) = -0.55;
  c.diagnostics.covariance = sigmas.asDiagonal() * correlation * sigmas.asDiagonal();

  c.diagnostics.paper_recipe.done = true;
  c.diagnostics.paper_recipe.message = "done";
  c.diagnostics.paper_recipe.sharpest_frame = std::max(0, middle - 1);
  c.diagnostics.paper_recipe.focus_depth_mm = kFocusMm - 6.5;
  c.diagnostics.paper_recipe.image_distance_mm = 3.0 + 12.8 * 393.5 / (393.5 - 12.5);
  c.diagnostics.paper_recipe.blur_ratio = 0.77;
  c.diagnostics.paper_recipe.ratio_frames = frame_count - 1;

  c.diagnostics.sharpness.done = true;
  c.diagnostics.sharpness.message = "done";
  c.diagnostics.sharpness.focus_depth_mm = kFocusMm + 0.9;
  c.diagnostics.sharpness.sigma_mm = 1.3;
  c.diagnostics.sharpness.reference_depth_mm = kFocusMm;
  // ln of the index above to second order in x = z0/z - 1: the blur is sigma = B |x|, so that
  // ln(0.3/sqrt(S0 + 0.4^2 + B^2 x^2)) = ln(0.3/sqrt(0.41)) - B^2 x^2/(2 * 0.41).
  const double b_px = kKappa * 4.46 * k_mm / kFocusMm / 0.006;
  c.diagnostics.sharpness.log_parabola = {std::log(0.3 / std::sqrt(0.41)), 0, -b_px * b_px / 0.82};
  c.diagnostics.sharpness.from_depth_mm = 385;
  c.diagnostics.sharpness.to_depth_mm = 416;
  c.diagnostics.sharpness.frames_used = 8;

  c.diagnostics.scale.done = true;
  c.diagnostics.scale.message = "done";
  c.diagnostics.scale.reference_frame = middle;
  c.diagnostics.scale.offset_mm = {kOffsetMm - 0.05, 0.11, std::nullopt};
  c.diagnostics.scale.reference_depth_mm = reference_mm;
  c.diagnostics.scale.reading_rms_mm = 0.068;
  c.diagnostics.scale.frames_used = frame_count;

  c.diagnostics.blur.done = true;
  c.diagnostics.blur.message = "done";
  c.diagnostics.blur.chi2_per_dof = 1.04;
  c.diagnostics.blur.frames_used = frame_count;
  c.summary.frames_used = frame_count;
  c.summary.seconds = 2.7;
  made_up::AddDetails(&c);
  return made;
}

// Leaves only the results: no sides, field, colours, examples, parts.
inline void RemoveDetails(calib::Calibration* calibration) {
  calib::Calibration& c = *calibration;
  c.diagnostics.paper_recipe.sharpest_normalised_frame = -1;
  c.diagnostics.paper_recipe.normalised_focus_depth_mm = 0;
  c.diagnostics.scale.kind = calib::ScaleKind::kUnknown;
  c.diagnostics.scale.distortion_at_corner.reset();
  c.diagnostics.blur.weak_direction.clear();
  c.diagnostics.blur.estimator.clear();
  c.diagnostics.blur.gaussian_misfit.reset();
  c.diagnostics.blur.disc_misfit.reset();
  c.diagnostics.nearer = c.diagnostics.farther = {};
  c.diagnostics.field = {};
  c.diagnostics.channels.clear();
  c.diagnostics.magnification.reset();
  c.diagnostics.systematic_parts.clear();
  c.diagnostics.advice.clear();
  c.examples.clear();
  for (calib::FrameMeasurement& frame : c.frames)
    frame.image_scale_sigma = frame.reading_error_mm = frame.reading_error_sigma_mm = 0;
}

// Leaves only what the quality checks keep of a frame: its statistics and the reason.
inline void RejectFrame(int index, const std::string& reason, calib::Calibration* calibration) {
  calib::FrameMeasurement& old = calibration->frames[static_cast<std::size_t>(index)];
  calib::FrameMeasurement frame;
  frame.image = old.image;
  frame.reading_mm = old.reading_mm;
  frame.depth_mm = old.depth_mm;
  frame.statistics = old.statistics;
  frame.rejection = reason;
  old = frame;
  --calibration->summary.frames_used;
}

// Replaces the calibration by one that refused the same sweep.
inline void RefuseAll(const std::string& reason, calib::Calibration* calibration) {
  calib::Calibration refused;
  refused.summary.reason = reason;
  refused.frames = calibration->frames;
  refused.summary.frames_used = calibration->summary.frames_used;
  *calibration = refused;
}

}  // namespace thicklens::tools

#endif  // THICKLENS_TESTS_TOOLS_SUPPORT_FAKE_CALIBRATION_H_
