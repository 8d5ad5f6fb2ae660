// Measures views of an image with a step in its depth, in 1 and in 3 channels. They are written to
// memory that exists, as the views of a light field are, two at a time on two threads, by C++ and
// by an OpenCL device. The sizes are 640 x 480 px and 160 x 120 px, for which the overhead of a
// device's calls dominates. Compare `views_per_second`. If the device is the processor, compare
// column CPU, the time of the process's threads, which other programs on the machine disturb less.
#include <benchmark/benchmark.h>

#include <array>
#include <cstddef>
#include <memory>
#include <random>
#include <vector>

#include "thicklens/base/parallel.h"
#include "thicklens/estimator/view_geometry.h"
#include "thicklens/kernels/device.h"
#include "thicklens/kernels/view_warp.h"

namespace thicklens::estimator {
namespace {

constexpr int kViews = 2;

struct Scene {
  model::LinearImage image;
  DisparityMap map;

  Scene(int channels, int width)
      : image{width, width * 3 / 4, channels, {}}, map{width, width * 3 / 4, {}, {1, 1}} {
    std::mt19937 engine(1);
    std::uniform_real_distribution<float> uniform(0, 1);
    for (int y = 0; y < map.height_px; ++y) {
      for (int x = 0; x < width; ++x) {
        const bool near =
            16 * x > 5 * width && 16 * x < 10 * width && 32 * y > 5 * width && 32 * y < 15 * width;
        map.disparity.push_back(
            near ? 1.3F : -1 + 0.64F * static_cast<float>(x) / static_cast<float>(width));
        for (int c = 0; c < channels; ++c) image.values.push_back(uniform(engine));
      }
    }
  }
};

void Count(benchmark::State* state) {
  state->counters["views_per_second"] = benchmark::Counter(
      static_cast<double>(state->iterations()) * kViews, benchmark::Counter::kIsRate);
}

void ViewNative(benchmark::State& state) {
  const Scene scene(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)));
  const CompactView view = DisparityRenderer(scene.map).RenderCompact(2, -1);
  const ImageWarper warper(scene.image, scene.map);
  std::array<model::LinearImage, kViews> warped;
  for (auto _ : state) {
    ParallelFor(kViews, 2, [&](int i) {
      warper.Warp(view, &warped[static_cast<std::size_t>(i)]);
      benchmark::ClobberMemory();
    });
  }
  Count(&state);
}
BENCHMARK(ViewNative)
    ->ArgNames({"channels", "width_px"})
    ->ArgsProduct({{1, 3}, {640, 160}})
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

void ViewOpenCl(benchmark::State& state) {
  const int channels = static_cast<int>(state.range(0));
  const Scene scene(channels, static_cast<int>(state.range(1)));
  const CompactView view = DisparityRenderer(scene.map).RenderCompact(2, -1);
  const auto backend = kernels::OpenBackend(kernels::ParseDeviceRequest("opencl"), nullptr);
  const auto warp = backend->NewWarp({scene.map.width_px, scene.map.height_px, channels,
                                      &scene.image.values, &scene.map.disparity, 0.3F});
  std::array<std::vector<float>, kViews> values;
  const auto make = [&](int i) {
    warp->Warp({&view.disparity, view.shift.x(), view.shift.y(), &view.occluded, &view.boundary},
               &values[static_cast<std::size_t>(i)]);
  };
  for (int i = 0; i < kViews; ++i) make(i);  // the first call compiles
  for (auto _ : state) {
    ParallelFor(kViews, 2, make);
    benchmark::ClobberMemory();
  }
  Count(&state);
}
BENCHMARK(ViewOpenCl)
    ->ArgNames({"channels", "width_px"})
    ->ArgsProduct({{1, 3}, {640, 160}})
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace thicklens::estimator
