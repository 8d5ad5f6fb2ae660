// Measures the time of each step of a calibration for one frame of 512 x 512 px.
#include <benchmark/benchmark.h>

#include <opencv2/core.hpp>
#include <string>

#include "calib/edges/edge_blur.h"
#include "calib/registration/image_scale.h"
#include "calib/sharpness/sharpness.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens {
namespace {

// A macro sweep of dead leaves, in which frame 0 is defocused by 8 px and frame 15 is in focus.
const model::SweepSimulator& Bench() {
  static const model::SweepSimulator simulator = [] {
    model::SweepSimulationOptions options = model::ReadSweepSimulation(
        std::string(THICKLENS_SOURCE_DIR) + "/configs/sweeps/case-ii.yaml");
    options.camera.sensor.width_px = 512;
    options.camera.sensor.height_px = 512;
    options.camera.sensor.principal_point_px = {255.5, 255.5};
    return model::SweepSimulator(options, {});
  }();
  return simulator;
}

cv::Mat Frame(int index) {
  const model::LinearImage image = Bench().RenderNoiseless(index);
  return cv::Mat(image.height_px, image.width_px, CV_32F, const_cast<float*>(image.values.data()))
      .clone();
}

void RenderFrame(benchmark::State& state) {
  Bench();
  for (auto _ : state) benchmark::DoNotOptimize(Bench().RenderFrame(0));
}
BENCHMARK(RenderFrame)->Unit(benchmark::kMillisecond);

void SharpnessIndex(benchmark::State& state) {
  const cv::Mat frame = Frame(15);
  calib::SharpnessOptions options;
  options.edge_threshold = 0.01;
  for (auto _ : state) benchmark::DoNotOptimize(calib::MeanEdgeSlope(frame, options));
}
BENCHMARK(SharpnessIndex)->Unit(benchmark::kMillisecond);

void SourceEdgeBlur(benchmark::State& state) {
  const cv::Mat frame = Frame(15);
  for (auto _ : state) benchmark::DoNotOptimize(calib::MeasureSourceEdgeBlur(frame));
}
BENCHMARK(SourceEdgeBlur)->Unit(benchmark::kMillisecond);

void RegisterFrame(benchmark::State& state) {
  const cv::Mat reference = Frame(15);
  const cv::Mat frame = Frame(static_cast<int>(state.range(0)));
  for (auto _ : state)
    benchmark::DoNotOptimize(calib::Register(reference, frame, 1.01, {255.5, 255.5}));
}
BENCHMARK(RegisterFrame)->Arg(10)->Arg(14)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace thicklens
