#include "tools/bench/bench_sweep.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <random>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/io/simulated_sweep.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::tools {
namespace {

constexpr double kTwoPi = 6.283185307179586;
// The accuracy of the squared floor from a knife edge.
constexpr double kFloorVarianceSigmaPx2 = 0.01;

// Implemented here, because the distributions of <random> differ between standard libraries.
class Draws {
 public:
  explicit Draws(std::uint64_t seed) {
    // This engine differs from the one that the simulator uses for this seed.
    std::seed_seq sequence{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32),
                           0xbe9c4U};
    engine_ = std::mt19937_64(sequence);
  }
  double Uniform() { return (static_cast<double>(engine_() >> 11) + 0.5) * 0x1p-53; }
  // The method of Box and Muller.
  double Normal() {
    const double radius = std::sqrt(-2 * std::log(Uniform()));
    return radius * std::cos(kTwoPi * Uniform());
  }

 private:
  std::mt19937_64 engine_;
};

// The error of the variance is Gaussian; near 0 the floor, its root, is not linear in it.
model::Estimate DrawnFloorPx(double truth_px, double normal) {
  const double variance_px2 = truth_px * truth_px + kFloorVarianceSigmaPx2 * normal;
  const double floor_px = std::sqrt(std::max(variance_px2, 0.0));
  const double sigma_px =
      std::min(kFloorVarianceSigmaPx2 / (2 * floor_px), std::sqrt(kFloorVarianceSigmaPx2));
  return {floor_px, sigma_px};
}

model::PixelRect MiddleOf(const model::Sensor& sensor, int side_px) {
  return {(sensor.width_px - side_px) / 2, (sensor.height_px - side_px) / 2, side_px, side_px};
}

}  // namespace

model::SweepSimulationOptions BenchSweepOptions() {
  constexpr double kFocusDepthMm = 300;
  model::SweepSimulationOptions options;
  model::Camera& camera = options.camera;
  camera.name = "bench";
  camera.lens.front_focal_length_mm = camera.lens.rear_focal_length_mm = 50;
  camera.lens.aperture_radius_mm = 8.9286;
  camera.sensor.width_px = camera.sensor.height_px = 512;
  camera.sensor.pixel_pitch_mm = 0.0045;
  camera.sensor.principal_point_px.setConstant(255.5);
  camera.sensor.transfer = model::TransferCurve::Linear();
  camera.calibration.emplace();
  camera.calibration->image_distance_mm =
      model::Estimate{model::ImageDistanceMm(camera.lens, kFocusDepthMm), 0};
  camera.calibration->blur_ratio = model::Estimate{0.45, 0};
  camera.calibration->blur_floor_px = model::Estimate{0.5, 0};
  camera.calibration->evidence.method = "assumed";
  options.step_mm = 1;
  options.frame_count = 31;
  options.first_depth_mm = kFocusDepthMm - 15;
  options.reading_sigma_mm = 0.07;
  options.flicker = 0.01;
  options.drift_sigma_px = 1;
  options.full_well_electrons = 10000;
  return options;
}

BenchSweep MakeBenchSweep(const model::SweepSimulationOptions& description,
                          const model::LinearImage& target_image, int field_px,
                          std::uint64_t seed) {
  Draws draws(seed);
  model::SweepSimulationOptions options = description;
  options.seed = seed;
  options.camera =
      model::CropCamera(description.camera, MiddleOf(description.camera.sensor, field_px));
  options.first_depth_mm += (draws.Uniform() - 0.5) * options.step_mm;
  const model::SweepSimulator simulator(options, target_image);

  BenchSweep bench;
  bench.frames_phase = draws.Uniform();
  bench.truth = simulator.truth();
  model::Camera camera = simulator.camera();
  camera.calibration.reset();
  bench.sweep = calib::MakeFocusSweep(io::DescribeSweep(options, simulator, false), camera);
  if (options.target.kind != model::TargetKind::kKnifeEdge)
    bench.sweep.floor.given_px = DrawnFloorPx(bench.truth.blur_floor_px, draws.Normal());
  const auto stored = std::make_shared<std::vector<cv::Mat>>();
  for (int i = 0; i < options.frame_count; ++i) {
    ThrowIfCancelled();
    stored->push_back(io::AsFile(simulator.RenderFrame(i)));
  }
  bench.sweep.read_frame = [stored](std::size_t i) { return (*stored)[i]; };
  return bench;
}

calib::FocusSweep PartOfSweep(const BenchSweep& bench, int frames, int field_px) {
  calib::FocusSweep part = bench.sweep;
  const model::PixelRect middle = MiddleOf(part.camera.sensor, field_px);
  part.roi = {middle.x, middle.y, middle.width, middle.height};
  const double every = static_cast<double>(bench.sweep.frames.size()) / frames;
  std::vector<std::size_t> taken;
  part.frames.clear();
  for (int i = 0; i < frames; ++i) {
    taken.push_back(std::min(static_cast<std::size_t>((i + bench.frames_phase) * every),
                             bench.sweep.frames.size() - 1));
    part.frames.push_back(bench.sweep.frames[taken.back()]);
  }
  part.read_frame = [taken, all = bench.sweep.read_frame](std::size_t i) { return all(taken[i]); };
  return part;
}

}  // namespace thicklens::tools
