#ifndef THICKLENS_TESTS_CALIB_GRID_GRID_BENCH_H_
#define THICKLENS_TESTS_CALIB_GRID_GRID_BENCH_H_

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <functional>
#include <opencv2/calib3d.hpp>
#include <random>
#include <vector>

#include "calib/grid/grid_adjustment.h"
#include "calib/grid/grid_geometry.h"
#include "tests/support/test_cameras.h"
#include "thicklens/model/target_grid.h"

namespace thicklens::testing {

// Points of a grid as OpenCV's projectPoints images them, which is no code of this project.
struct GridBench {
  model::TargetGrid grid;
  double focal_px = 1500, cx = 330, cy = 230;
  std::vector<double> coefficients = {0, 0, 0, 0, 0};  // k1, k2, p1, p2, k3
  double noise_px = 0.05;
  int width_px = 640, height_px = 480;
  // Departure of the sheet from what was stated, mm: the place of a point for the place stated.
  std::function<Eigen::Vector3d(const Eigen::Vector2d&)> sheet = [](const Eigen::Vector2d& at) {
    return Eigen::Vector3d(at.x(), at.y(), 0);
  };
  std::mt19937_64 engine;

  explicit GridBench(std::uint64_t seed) : engine(seed) {
    grid.columns = 12;
    grid.rows = 9;
    grid.square_mm = 8;
  }

  double Normal() {
    const auto uniform = [this] { return (static_cast<double>(engine() >> 11) + 0.5) * 0x1p-53; };
    const double radius = std::sqrt(-2 * std::log(uniform()));
    return radius * std::cos(6.283185307179586 * uniform());
  }

  std::vector<Eigen::Vector2d> Centred() const {
    std::vector<Eigen::Vector2d> points = model::GridPoints(grid);
    Eigen::Vector2d mean(0, 0);
    for (const auto& point : points) mean += point / static_cast<double>(points.size());
    for (auto& point : points) point -= mean;
    return points;
  }

  // The points that lie in the image.
  calib::GridView View(const Eigen::Vector3d& rotation, const Eigen::Vector3d& place_mm) {
    std::vector<cv::Point3d> target;
    for (const Eigen::Vector2d& at : Centred()) {
      const Eigen::Vector3d point = sheet(at);
      target.emplace_back(point.x(), point.y(), point.z());
    }
    std::vector<cv::Point2d> image;
    const cv::Matx33d camera(focal_px, 0, cx, 0, focal_px, cy, 0, 0, 1);
    cv::projectPoints(target, cv::Vec3d(rotation.x(), rotation.y(), rotation.z()),
                      cv::Vec3d(place_mm.x(), place_mm.y(), place_mm.z()), camera, coefficients,
                      image);
    calib::GridView view;
    for (std::size_t i = 0; i < image.size(); ++i) {
      const double x = image[i].x + noise_px * Normal(), y = image[i].y + noise_px * Normal();
      if (x < 0 || y < 0 || x > width_px - 1 || y > height_px - 1) continue;
      view.ids.push_back(static_cast<int>(i));
      view.image_px.emplace_back(x, y);
    }
    return view;
  }

  // Frames of a target that moves along a line; dx/dz and dy/dz of the motion. Readings grow away
  // from the camera, and are 0 at the place `at_mm`.
  void Sweep(int count, double range_mm, const Eigen::Vector3d& rotation,
             const Eigen::Vector3d& at_mm, const Eigen::Vector2d& direction,
             calib::GridViews* views) {
    const double per_mm = 1 / std::sqrt(1 + direction.squaredNorm());
    for (int i = 0; i < count; ++i) {
      const double reading_mm = range_mm * (static_cast<double>(i) / (count - 1) - 0.5);
      const double dz = reading_mm * per_mm;
      calib::GridView view =
          View(rotation, at_mm + dz * Eigen::Vector3d(direction.x(), direction.y(), 1));
      view.position_mm = reading_mm;
      views->frames.push_back(view);
      views->readings_mm.push_back(reading_mm);
    }
  }

  // Views of the target turned by 20 to 30 degrees about several axes.
  void Tilted(int count, double distance_mm, calib::GridViews* views) {
    for (int i = 0; i < count; ++i) {
      const double around = 6.283185307179586 * i / count + 0.3;
      const double lean = 0.4 + 0.02 * i;
      views->views.push_back(
          View({lean * std::cos(around), lean * std::sin(around), 0.05 * i},
               {3.0 * std::cos(2 * around), 2.0 * std::sin(2 * around), distance_mm + 10 * i}));
    }
  }

  // A sweep of a camera whose file is right to a few per cent.
  calib::FocusSweep Camera() const {
    calib::FocusSweep sweep;
    model::Camera& camera = sweep.camera;
    camera.sensor.width_px = width_px;
    camera.sensor.height_px = height_px;
    camera.sensor.pixel_pitch_mm = 0.006;
    camera.sensor.principal_point_px = {0.5 * (width_px - 1), 0.5 * (height_px - 1)};
    camera.lens = {8.0, 8.0, 0.0, 2.0};
    sweep.target_grid = grid;
    sweep.reading_sigma_mm = 0.02;
    return sweep;
  }
};

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_CALIB_GRID_GRID_BENCH_H_
