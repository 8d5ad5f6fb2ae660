#ifndef THICKLENS_TESTS_CALIB_SIMULATED_SWEEP_H_
#define THICKLENS_TESTS_CALIB_SIMULATED_SWEEP_H_

#include <cmath>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/pupil_law.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::testing {

// An image as the camera stores it, as a matrix.
inline cv::Mat EncodedMat(const model::EncodedImage& image) {
  cv::Mat stored(image.height_px, image.width_px,
                 CV_MAKETYPE(image.bits == 8 ? CV_8U : CV_16U, image.channels));
  const int values = stored.cols * image.channels;
  for (int y = 0; y < stored.rows; ++y) {
    for (int i = 0; i < values; ++i) {
      const auto value =
          image.values[static_cast<std::size_t>(y) * static_cast<std::size_t>(values) +
                       static_cast<std::size_t>(i)];
      if (image.bits == 8) {
        stored.ptr<std::uint8_t>(y)[i] = static_cast<std::uint8_t>(value);
      } else {
        stored.ptr<std::uint16_t>(y)[i] = value;
      }
    }
  }
  return stored;
}

// One of configs/sweeps, restricted to the middle `size_px` pixels of its sensor (0: all of them).
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

// A simulated sweep in the form that a calibration gets, with the truth. The frames are rendered
// once and kept. The camera has no calibration, the bench offset is given and the floor is not.
struct SimulatedSweep {
  calib::FocusSweep sweep;
  model::SweepTruth truth;
  // The frames that read_frame returns; a test may damage them
  std::shared_ptr<std::vector<cv::Mat>> stored;

  // Depth of the centre of perspective, which the pupil law puts before or behind the aperture.
  // Sizes in a frame are proportional to one over the distance from this centre.
  double centre_mm = 0;

  cv::Mat& frame(int index) { return (*stored)[static_cast<std::size_t>(index)]; }
  // Scale of one frame relative to another.
  double TrueScale(std::size_t frame, std::size_t reference) const {
    return (truth.frames[reference].depth_mm - centre_mm) /
           (truth.frames[frame].depth_mm - centre_mm);
  }
};

// `target_image` is used for a target of that kind only.
inline SimulatedSweep Simulate(const model::SweepSimulationOptions& options,
                               const model::LinearImage& target_image = {}) {
  const model::SweepSimulator simulator(options, target_image);
  SimulatedSweep result;
  result.truth = simulator.truth();
  result.stored = std::make_shared<std::vector<cv::Mat>>();
  result.sweep.camera = options.camera;
  result.centre_mm = model::CentreOfPerspectiveMm(
      options.camera.lens, options.camera.psf, model::PupilLawFromName(result.truth.pupil_law),
      result.truth.blur_ratio, result.truth.focus_depth_mm);
  result.sweep.camera.calibration.reset();
  for (int i = 0; i < options.frame_count; ++i) {
    const auto index = static_cast<std::size_t>(i);
    result.stored->push_back(EncodedMat(simulator.RenderFrame(i)));
    result.sweep.frames.push_back(
        {"frame-" + std::to_string(i), result.truth.frames[index].reading_mm});
  }
  result.sweep.read_frame = [stored = result.stored](std::size_t i) { return (*stored)[i]; };
  result.sweep.reading_sigma_mm = options.reading_sigma_mm;
  result.sweep.offset_mm = model::Estimate{options.bench_offset_mm, 0};
  result.sweep.direction = options.direction;
  if (options.counts_per_mm > 0) {
    result.sweep.readings_are_counts = true;
    result.sweep.reading_sigma_mm *= options.counts_per_mm;
    result.sweep.offset_mm.reset();
  }
  return result;
}

// States the floor, as known to a user who has measured the blur floor on a knife edge before.
inline void GiveFloor(SimulatedSweep* simulated) {
  simulated->sweep.floor.given_px = model::Estimate{simulated->truth.blur_floor_px, 0.01};
}

// States the floor as a real measurement gives it: the variance is drawn about the truth with the
// stated error, d(floor) = d(variance)/(2 floor).
inline void GiveDrawnFloor(SimulatedSweep* simulated, std::uint64_t seed) {
  constexpr double kVarianceSigmaPx2 = 0.01;
  constexpr double kTwoPi = 6.283185307179586;
  std::mt19937_64 engine(seed);
  // The method of Box and Muller is used, because std::normal_distribution differs between standard
  // libraries.
  const auto uniform = [&engine] { return (static_cast<double>(engine() >> 11) + 0.5) * 0x1p-53; };
  const double radius = std::sqrt(-2 * std::log(uniform()));
  const double normal = radius * std::cos(kTwoPi * uniform());
  const double truth_px = simulated->truth.blur_floor_px;
  const double floor_px = std::sqrt(truth_px * truth_px + kVarianceSigmaPx2 * normal);
  simulated->sweep.floor.given_px = model::Estimate{floor_px, kVarianceSigmaPx2 / (2 * floor_px)};
}

// One of configs/sweeps, simulated, with its floor given.
inline SimulatedSweep SweepWithFloor(const std::string& name, int size_px, std::uint64_t seed) {
  SimulatedSweep simulated = Simulate(SweepCase(name, size_px, seed));
  GiveFloor(&simulated);
  return simulated;
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_CALIB_SIMULATED_SWEEP_H_
