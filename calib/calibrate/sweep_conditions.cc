#include "calib/calibrate/sweep_conditions.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "calib/calibrate/plan_texture.h"
#include "calib/sweep/frame_selection.h"

namespace thicklens::calib {
namespace {

constexpr double kUsualFloorPx = 0.5, kUsualTexturePx = 2;
constexpr double kBeyondFocalLength = 0.1;  // part of zf - f1
constexpr double kMinNoise = 1e-4;          // of full scale

}  // namespace

PlanConditions ConditionsOfFrames(const FocusSweep& sweep,
                                  const std::vector<const FrameMeasurement*>& frames,
                                  double focus_depth_mm, double blur_ratio) {
  PlanConditions conditions;
  conditions.camera = sweep.camera;
  model::Sensor& sensor = conditions.camera.sensor;
  const cv::Size region = RegionSize(sweep);
  sensor.width_px = std::min(region.width, kConditionsPx);
  sensor.height_px = std::min(region.height, kConditionsPx);
  sensor.principal_point_px = {0.5 * (sensor.width_px - 1), 0.5 * (sensor.height_px - 1)};
  conditions.focus_depth_mm = focus_depth_mm;
  conditions.blur_ratio = std::min(blur_ratio, 1.0);
  conditions.blur_floor_px = kUsualFloorPx;
  conditions.blur_floor_sigma_px = 0;
  std::vector<double> noises;
  const FrameMeasurement* sharpest = frames.front();
  for (const FrameMeasurement* frame : frames) {
    noises.push_back(frame->statistics.noise_sigma);
    if (frame->normalised_edge_slope > sharpest->normalised_edge_slope) sharpest = frame;
  }
  const auto middle = noises.begin() + static_cast<std::ptrdiff_t>(noises.size() / 2);
  std::nth_element(noises.begin(), middle, noises.end());
  conditions.noise_sigma = std::max(*middle, kMinNoise);
  conditions.light_level = std::clamp(sharpest->statistics.mean_linear, 0.01, 1.0);
  // The levels of the leaves are evenly distributed between the darkest and the brightest.
  conditions.contrast = std::clamp(std::sqrt(3.0) * sharpest->statistics.contrast, 0.05, 1.0);
  conditions.lamp_falloff = false;
  return conditions;
}

double UsualTextureMm(const PlanConditions& conditions) {
  return kUsualTexturePx * PixelAtFocusMm(conditions);
}

double NearestDepthMm(const PlanConditions& conditions) {
  const double f1 = conditions.camera.lens.front_focal_length_mm;
  return f1 + kBeyondFocalLength * (conditions.focus_depth_mm - f1);
}

}  // namespace thicklens::calib
