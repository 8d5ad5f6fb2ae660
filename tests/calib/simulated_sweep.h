#ifndef THICKLENS_TESTS_CALIB_SIMULATED_SWEEP_H_
#define THICKLENS_TESTS_CALIB_SIMULATED_SWEEP_H_

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::testing {

// A picture as the camera stores it, as a matrix.
inline cv::Mat StoredMat(const model::StoredPicture& picture) {
  cv::Mat stored(picture.height_px, picture.width_px, picture.bits == 8 ? CV_8U : CV_16U);
  for (int y = 0; y < stored.rows; ++y) {
    for (int x = 0; x < stored.cols; ++x) {
      const auto value =
          picture.values[static_cast<std::size_t>(y) * static_cast<std::size_t>(stored.cols) +
                         static_cast<std::size_t>(x)];
      if (picture.bits == 8) {
        stored.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(value);
      } else {
        stored.at<std::uint16_t>(y, x) = value;
      }
    }
  }
  return stored;
}

// One of configs/sweeps, on the middle `size_px` pixels of its sensor (0: all of them).
inline model::SweepSimulationOptions SweepCase(const std::string& name, int size_px,
                                               std::uint64_t seed) {
  model::SweepSimulationOptions options =
      model::ReadSweepSimulation(THICKLENS_SOURCE_DIR "/configs/sweeps/case-" + name + ".yaml");
  if (size_px > 0) {
    options.camera.sensor.width_px = options.camera.sensor.height_px = size_px;
    options.camera.sensor.principal_point_px.setConstant(0.5 * (size_px - 1));
  }
  options.seed = seed;
  return options;
}

// A simulated sweep as a calibration gets it: frames rendered once and kept, the truth beside. The
// camera has no calibration, the bench zero is given, the floor is not.
struct SimulatedSweep {
  calib::FocusSweep sweep;
  model::SweepTruth truth;
  std::shared_ptr<std::vector<cv::Mat>> stored;  // what read_frame gives; a test may damage them

  cv::Mat& frame(int index) { return (*stored)[static_cast<std::size_t>(index)]; }
};

inline SimulatedSweep Simulate(const model::SweepSimulationOptions& options) {
  const model::SweepSimulator simulator(options, {});
  SimulatedSweep result;
  result.truth = simulator.truth();
  result.stored = std::make_shared<std::vector<cv::Mat>>();
  result.sweep.camera = options.camera;
  result.sweep.camera.calibration.reset();
  for (int i = 0; i < options.frame_count; ++i) {
    const auto index = static_cast<std::size_t>(i);
    result.stored->push_back(StoredMat(simulator.RenderFrame(i)));
    result.sweep.frames.push_back(
        {"frame-" + std::to_string(i), result.truth.frames[index].reading_mm});
  }
  result.sweep.read_frame = [stored = result.stored](std::size_t i) { return (*stored)[i]; };
  result.sweep.reading_sigma_mm = options.reading_sigma_mm;
  result.sweep.offset_mm = model::Estimate{options.bench_offset_mm, 0};
  result.sweep.direction = options.direction;
  return result;
}

// The same, told what a person can know who has measured the lens floor on a knife edge before.
inline void GiveFloor(SimulatedSweep* simulated) {
  simulated->sweep.floor.given_px = model::Estimate{simulated->truth.blur_floor_px, 0.01};
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_CALIB_SIMULATED_SWEEP_H_
