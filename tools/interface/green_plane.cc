#include "tools/interface/green_plane.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>

namespace thicklens {
namespace {

constexpr int kSensorPxPerPx = 2;

void Multiply(double factor, calib::Result* result) {
  result->value *= factor;
  result->sigma *= factor;
  if (result->systematic) *result->systematic *= factor;
}

// Widens the interval of a floor that was measured on edges, px of the sensor, by what the places
// of the two sites change: by the angle of the edge, -1/4 to 1/4 px^2.
void AllowForDiagonal(calib::Result* floor) {
  constexpr double kDiagonalPx2 = 0.25;
  const Eigen::Vector2d known = floor->systematic.value_or(Eigen::Vector2d::Constant(floor->value));
  const Eigen::Vector2d squares = known.cwiseMax(0).cwiseAbs2();
  floor->systematic = Eigen::Vector2d(std::sqrt(std::max(0.0, squares.x() - kDiagonalPx2)),
                                      std::sqrt(squares.y() + kDiagonalPx2));
}

void ConvertFrame(calib::FrameMeasurement* frame) {
  constexpr double kPx = kSensorPxPerPx;
  frame->statistics.top_gradient /= kPx;
  frame->mean_edge_slope /= kPx;
  frame->normalised_edge_slope /= kPx;
  frame->source_blur_sigma_px *= kPx;
  frame->blur_sigma_px *= kPx;
  frame->blur_sigma_error_px *= kPx;
}

void ConvertCovariance(calib::CalibrationDiagnostics* found) {
  for (std::size_t i = 0; i < found->covariance_order.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    if (found->covariance_order[i] != "blur_floor_px" || row >= found->covariance.rows()) continue;
    found->covariance.row(row) *= kSensorPxPerPx;
    found->covariance.col(row) *= kSensorPxPerPx;
  }
}

void ConvertExample(calib::BlurExample* example) {
  // Distances, or frequencies.
  const double factor = example->is_edge ? kSensorPxPerPx : 1.0 / kSensorPxPerPx;
  for (double& x : example->x) x *= factor;
}

}  // namespace

calib::FocusSweep GreenPlaneSweep(const calib::FocusSweep& sweep) {
  constexpr double kPx = kSensorPxPerPx;
  calib::FocusSweep green = sweep;
  green.sensor_px_per_px = kSensorPxPerPx * sweep.sensor_px_per_px;
  green.camera.calibration.reset();  // its floor is in pixels of the sensor
  model::Sensor& sensor = green.camera.sensor;
  sensor.width_px /= kSensorPxPerPx;
  sensor.height_px /= kSensorPxPerPx;
  sensor.pixel_pitch_mm *= kPx;
  sensor.principal_point_px =
      (sensor.principal_point_px - Eigen::Vector2d::Constant((kPx - 1) / 2)) / kPx;
  for (auto& [field, statement] : green.camera.statements) {
    if (field == "sensor.pixel_pitch_mm") statement.tolerance *= kPx;
    if (field.rfind("sensor.principal_point_px", 0) == 0) statement.tolerance /= kPx;
  }
  if (green.floor.given_px) {
    green.floor.given_px->value /= kPx;
    green.floor.given_px->sigma /= kPx;
  }
  if (green.floor.from_px) *green.floor.from_px /= kPx;
  if (green.floor.to_px) *green.floor.to_px /= kPx;
  model::RegionOfInterest& roi = green.roi;
  if (roi.width > 0) {  // the pixels of the green plane that lie inside
    const int right = (roi.x + roi.width) / kSensorPxPerPx;
    const int bottom = (roi.y + roi.height) / kSensorPxPerPx;
    roi.x = (roi.x + 1) / kSensorPxPerPx;
    roi.y = (roi.y + 1) / kSensorPxPerPx;
    roi.width = std::max(right - roi.x, 1);
    roi.height = std::max(bottom - roi.y, 1);
  }
  return green;
}

void ConvertToSensorPixels(calib::Calibration* calibration) {
  constexpr double kPx = kSensorPxPerPx;
  if (calibration->summary.blur_floor_px) {
    Multiply(kPx, &*calibration->summary.blur_floor_px);
    if (calibration->diagnostics.blur.estimator == "edges") {
      AllowForDiagonal(&*calibration->summary.blur_floor_px);
      calibration->summary.warnings.emplace_back(
          "the square of the blur floor of edges on the green sites differs by 1/4 sin(2 angle) "
          "px^2 from that of the lens, where angle is that of the edge from the columns or rows "
          "(at 5 degrees: a floor of 0.5 px by 0.04 px): measure the floor on demosaiced frames");
    }
  }
  for (calib::FrameMeasurement& frame : calibration->frames) ConvertFrame(&frame);
  for (calib::BlurExample& example : calibration->examples) ConvertExample(&example);
  calib::CalibrationDiagnostics& found = calibration->diagnostics;
  ConvertCovariance(&found);
  // The logarithm of a slope per pixel.
  if (found.sharpness.done) found.sharpness.log_parabola[0] -= std::log(kPx);
  for (calib::FieldTile& tile : found.field.tiles)
    tile.centre_px = kPx * tile.centre_px + Eigen::Vector2d::Constant((kPx - 1) / 2);
  if (auto& region = found.target.relief.region) {
    region->x *= kSensorPxPerPx;
    region->y *= kSensorPxPerPx;
    region->width *= kSensorPxPerPx;
    region->height *= kSensorPxPerPx;
  }
  if (found.magnification) found.magnification->period_px *= kPx;
  if (found.blur_slope_px_per_mm) {
    found.blur_slope_px_per_mm->value *= kPx;
    found.blur_slope_px_per_mm->sigma *= kPx;
  }
}

}  // namespace thicklens
