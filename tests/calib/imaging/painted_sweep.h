#ifndef THICKLENS_TESTS_CALIB_PAINTED_SWEEP_H_
#define THICKLENS_TESTS_CALIB_PAINTED_SWEEP_H_

#include <cmath>
#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::testing {

// A sweep that is painted, independently of the simulator: a texture on a plane is scaled about the
// principal point and convolved with the shape of the aperture, point by point. The calibration
// that belongs to it is the truth.
struct PaintedSweep {
  calib::FocusSweep sweep;
  calib::Calibration calibration;
  std::shared_ptr<std::vector<cv::Mat>> stored = std::make_shared<std::vector<cv::Mat>>();
  cv::Mat texture;  // at the scale of the reference frame, without blur
};

// Smooth random texture of several scales, 0.2 to 0.8.
inline cv::Mat PaintedTexture(int size_px, unsigned seed) {
  cv::RNG random(seed);
  cv::Mat texture = cv::Mat::zeros(size_px, size_px, CV_32F);
  for (const double sigma_px : {0.8, 1.6, 3.2}) {
    cv::Mat noise(size_px, size_px, CV_32F);
    random.fill(noise, cv::RNG::NORMAL, 0, 1);
    cv::GaussianBlur(noise, noise, {}, sigma_px);
    texture += noise * sigma_px;
  }
  cv::normalize(texture, texture, 0.2, 0.8, cv::NORM_MINMAX);
  return texture;
}

// Light of the aperture at a place in blur radii, x to the right, y down in the scene.
using ApertureLight = std::function<double(double x, double y)>;

struct PaintedOptions {
  int size_px = 260;
  double focus_mm = 400, reference_mm = 400;
  std::vector<double> depths_mm;
  double blur_ratio = 0.5;
  double noise = 0.002;  // standard deviation in full scale
  unsigned seed = 1;
  // Height of the target toward the camera at a place of the reference frame, px from its middle,
  // mm.
  std::function<double(double x, double y)> height_mm;
};

inline model::Camera PaintedCamera(int size_px) {
  model::Camera camera;
  camera.name = "painted";
  camera.lens = {50, 52, 4, 8};
  camera.sensor = {size_px,
                   size_px,
                   0.005,
                   {0.5 * (size_px - 1), 0.5 * (size_px - 1)},
                   model::TransferCurve::Linear()};
  camera.psf = model::Psf::kDisc;
  return camera;
}

// The points of the aperture by which frames are painted: x, y and weight, with the sum 1.
inline std::vector<cv::Vec3d> PaintedPoints(const ApertureLight& light) {
  constexpr int kPoints = 21;  // along each axis, within 1.3 radii
  std::vector<cv::Vec3d> points;
  double sum = 0;
  for (int j = 0; j < kPoints; ++j) {
    for (int i = 0; i < kPoints; ++i) {
      const double x = 1.3 * (2.0 * (i + 0.5) / kPoints - 1);
      const double y = 1.3 * (2.0 * (j + 0.5) / kPoints - 1);
      const double weight = light(x, y);
      if (weight > 0) points.emplace_back(x, y, weight);
      sum += weight;
    }
  }
  for (cv::Vec3d& point : points) point[2] /= sum;
  return points;
}

// Second moments of these points about their centroid, along x and y, in blur radii.
inline cv::Vec2d PaintedMoments(const ApertureLight& light) {
  cv::Vec2d first(0, 0), second(0, 0);
  for (const cv::Vec3d& point : PaintedPoints(light)) {
    for (const int axis : {0, 1}) {
      first[axis] += point[2] * point[axis];
      second[axis] += point[2] * point[axis] * point[axis];
    }
  }
  return {second[0] - first[0] * first[0], second[1] - first[1] * first[1]};
}

// Paints one frame: every pixel is the mean of the texture over the points of the aperture.
inline cv::Mat PaintedFrame(const cv::Mat& texture, const model::Camera& camera,
                            const PaintedOptions& options, double depth_mm,
                            const ApertureLight& light) {
  const double d1_mm = model::ImageDistanceMm(camera.lens, options.focus_mm);
  const double middle = 0.5 * (options.size_px - 1);
  const double texture_middle = 0.5 * (texture.cols - 1);
  cv::Mat frame = cv::Mat::zeros(options.size_px, options.size_px, CV_32F);
  // Where the chief ray of a pixel meets the target, px of the texture, and the blur radius there.
  cv::Mat chief_x(frame.size(), CV_32F), chief_y(frame.size(), CV_32F);
  cv::Mat radius(frame.size(), CV_32F), seen;
  for (int y = 0; y < frame.rows; ++y) {
    for (int x = 0; x < frame.cols; ++x) {
      const double to_reference = depth_mm / options.reference_mm;
      const double height_mm = options.height_mm ? options.height_mm((x - middle) * to_reference,
                                                                     (y - middle) * to_reference)
                                                 : 0;
      const double z_mm = depth_mm - height_mm;
      const double scale = options.reference_mm / z_mm;
      // A point beyond the plane of focus has the light of the right of the aperture on its right;
      // a nearer one on its left.
      const double radius_px = model::BlurRadiusMm(camera.lens, d1_mm, z_mm) /
                               camera.sensor.pixel_pitch_mm * (z_mm > options.focus_mm ? 1 : -1);
      chief_x.at<float>(y, x) = static_cast<float>(texture_middle + (x - middle) / scale);
      chief_y.at<float>(y, x) = static_cast<float>(texture_middle + (y - middle) / scale);
      radius.at<float>(y, x) = static_cast<float>(radius_px / scale);
    }
  }
  for (const cv::Vec3d& point : PaintedPoints(light)) {
    cv::remap(texture, seen, cv::Mat(chief_x - point[0] * radius),
              cv::Mat(chief_y - point[1] * radius), cv::INTER_LINEAR, cv::BORDER_REFLECT);
    frame += seen * point[2];
  }
  return frame;
}

inline PaintedSweep Paint(const PaintedOptions& options, const ApertureLight& light) {
  PaintedSweep painted;
  model::Camera camera = PaintedCamera(options.size_px);
  const double d1_mm = model::ImageDistanceMm(camera.lens, options.focus_mm);
  painted.texture = PaintedTexture(options.size_px + 160, options.seed);
  painted.sweep.camera = camera;
  std::mt19937 random(options.seed);
  std::normal_distribution<double> noise(0, 1);
  calib::Calibration& found = painted.calibration;
  std::size_t reference = 0;
  for (std::size_t i = 0; i < options.depths_mm.size(); ++i) {
    const double depth_mm = options.depths_mm[i];
    cv::Mat frame = PaintedFrame(painted.texture, camera, options, depth_mm, light);
    cv::Mat stored(frame.size(), CV_16U);
    for (int y = 0; y < frame.rows; ++y) {
      for (int x = 0; x < frame.cols; ++x) {
        stored.at<std::uint16_t>(y, x) = cv::saturate_cast<std::uint16_t>(
            65535 * (frame.at<float>(y, x) + options.noise * noise(random)));
      }
    }
    painted.stored->push_back(stored);
    painted.sweep.frames.push_back({"frame", depth_mm, std::nullopt});
    calib::FrameMeasurement measured;
    measured.image = "frame_" + std::to_string(i);
    measured.reading_mm = measured.depth_mm = depth_mm;
    measured.image_scale = options.reference_mm / depth_mm;
    measured.image_scale_sigma = 1e-5;
    measured.in_blur_fit = true;
    found.frames.push_back(measured);
    if (std::abs(depth_mm - options.reference_mm) <
        std::abs(options.depths_mm[reference] - options.reference_mm))
      reference = i;
  }
  painted.sweep.read_frame = [stored = painted.stored](std::size_t i) { return stored->at(i); };
  found.summary.outcome = calib::Outcome::kOk;
  found.summary.image_distance_mm = calib::Result{d1_mm, 0.001, {}};
  found.summary.focus_depth_mm = calib::Result{options.focus_mm, 0.01, {}};
  found.summary.blur_ratio = calib::Result{options.blur_ratio, 0.001, {}};
  found.summary.blur_floor_px = calib::Result{0.3, 0.01, {}};
  found.summary.bench_offset_mm = calib::Result{0, 0.01, {}};
  found.diagnostics.blur.done = true;
  found.diagnostics.scale.done = true;
  found.diagnostics.scale.kind = calib::ScaleKind::kInverseDepth;
  found.diagnostics.scale.reference_frame = static_cast<int>(reference);
  found.diagnostics.scale.reference_depth_mm = options.reference_mm;
  found.diagnostics.scale.offset_mm = calib::Result{0, 0.01, {}};
  return painted;
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_CALIB_PAINTED_SWEEP_H_
