#ifndef THICKLENS_TESTS_SUPPORT_TEST_CAMERAS_H_
#define THICKLENS_TESTS_SUPPORT_TEST_CAMERAS_H_

#include <Eigen/Core>
#include <string>

#include "thicklens/model/camera.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::testing {

// Lenses, sensors and cameras that several tests use, and parts from which a test builds its own.

// A thick lens of a short focal length: f1 12.5 mm, f2 12.8 mm, thickness 3 mm. The default
// aperture is f/1.4.
inline model::ThickLens WideLens(double aperture_radius_mm = 4.46) {
  return {12.5, 12.8, 3, aperture_radius_mm};
}
// A thick macro lens: f1 50 mm, f2 52 mm, thickness 4 mm.
inline model::ThickLens ThickMacroLens(double aperture_radius_mm) {
  return {50, 52, 4, aperture_radius_mm};
}
inline model::ThickLens ThinLens(double focal_length_mm, double aperture_radius_mm) {
  return {focal_length_mm, focal_length_mm, 0, aperture_radius_mm};
}

inline model::Sensor TestSensor(
    int width_px, int height_px, double pixel_pitch_mm, const Eigen::Vector2d& principal_point_px,
    const model::TransferCurve& transfer = model::TransferCurve::Srgb()) {
  return {width_px, height_px, pixel_pitch_mm, principal_point_px, transfer};
}
// A sensor whose principal point is its centre.
inline model::Sensor CentredSensor(
    int width_px, int height_px, double pixel_pitch_mm,
    const model::TransferCurve& transfer = model::TransferCurve::Srgb()) {
  return TestSensor(width_px, height_px, pixel_pitch_mm,
                    {(width_px - 1) / 2.0, (height_px - 1) / 2.0}, transfer);
}

// A calibrated camera with a Gaussian defocus blur.
inline model::Camera TestCamera(const std::string& name, const model::ThickLens& lens,
                                const model::Sensor& sensor,
                                const model::Estimate& image_distance_mm,
                                const model::Estimate& blur_ratio = {0.45, 0}) {
  model::Camera camera;
  camera.name = name;
  camera.lens = lens;
  camera.sensor = sensor;
  camera.calibration.emplace();
  camera.calibration->image_distance_mm = image_distance_mm;
  camera.calibration->blur_ratio = blur_ratio;
  return camera;
}
// TestCamera() with the exact image distance for that plane of focus.
inline model::Camera TestCameraFocusedAt(double focus_depth_mm, const std::string& name,
                                         const model::ThickLens& lens, const model::Sensor& sensor,
                                         const model::Estimate& blur_ratio = {0.45, 0}) {
  return TestCamera(name, lens, sensor, {model::ImageDistanceMm(lens, focus_depth_mm), 0},
                    blur_ratio);
}
// Adds a description of how the camera was calibrated. "assumed" means that nothing was measured.
inline model::Camera WithMethod(model::Camera camera, const std::string& method = "assumed") {
  camera.calibration->evidence.method = method;
  return camera;
}

// The wide lens on pixels of 6 um, focused at 1155 mm.
inline model::Camera SmallCamera(
    int width_px, int height_px, const Eigen::Vector2d& principal_point_px,
    const model::TransferCurve& transfer = model::TransferCurve::Srgb()) {
  return TestCamera("small", WideLens(),
                    TestSensor(width_px, height_px, 0.006, principal_point_px, transfer),
                    {15.94, 0});
}

// The wide lens on pixels of 6 um, focused at 800 mm.
inline model::Camera PhotographCamera(
    int width_px, int height_px,
    const model::TransferCurve& transfer = model::TransferCurve::Srgb()) {
  return WithMethod(TestCameraFocusedAt(800, "bench", WideLens(),
                                        CentredSensor(width_px, height_px, 0.006, transfer)));
}

// A camera for the solvers, focused at 800 mm: a wide aperture, large pixels, and a principal point
// that is not in the centre.
inline model::Camera SolverCamera(int width_px, int height_px) {
  return WithMethod(TestCameraFocusedAt(
      800, "simulated", WideLens(6),
      TestSensor(width_px, height_px, 0.02, {width_px / 2.0 - 0.3, height_px / 2.0})));
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_SUPPORT_TEST_CAMERAS_H_
