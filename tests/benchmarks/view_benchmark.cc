// Views of a picture with a step in its depth, 640 x 480 px in 1 and in 3 channels, to memory that
// is there, as a light field's are made, two at a time on two threads: by C++, and by an OpenCL
// device. `views_per_second` compares them; where the device is the processor, so does column CPU,
// the time of the process's threads, which other programs on the machine disturb less.
#include <benchmark/benchmark.h>

#include <array>
#include <cstddef>
#include <memory>
#include <random>
#include <vector>

#include "thicklens/estimator/view_geometry.h"
#include "thicklens/kernels/device.h"
#include "thicklens/model/parallel.h"

namespace thicklens::estimator {
namespace {

constexpr int kWidth = 640, kHeight = 480;
constexpr int kViews = 2;

struct Scene {
  model::LinearPicture picture;
  DisparityMap map{kWidth, kHeight, {}, {1, 1}};

  explicit Scene(int channels) : picture{kWidth, kHeight, channels, {}} {
    std::mt19937 engine(1);
    std::uniform_real_distribution<float> uniform(0, 1);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const bool near = x > 200 && x < 400 && y > 100 && y < 300;
        map.disparity.push_back(near ? 1.3F : -1 + 0.001F * static_cast<float>(x));
        for (int c = 0; c < channels; ++c) picture.values.push_back(uniform(engine));
      }
    }
  }
};

void Count(benchmark::State* state) {
  state->counters["views_per_second"] = benchmark::Counter(
      static_cast<double>(state->iterations()) * kViews, benchmark::Counter::kIsRate);
}

void ViewNative(benchmark::State& state) {
  const Scene scene(static_cast<int>(state.range(0)));
  const CompactView view = DisparityRenderer(scene.map).RenderCompact(2, -1);
  const PictureWarper warper(scene.picture, scene.map);
  std::array<model::LinearPicture, kViews> warped;
  for (auto _ : state) {
    model::ParallelFor(kViews, 2, [&](int i) {
      warper.Warp(view, &warped[static_cast<std::size_t>(i)]);
      benchmark::ClobberMemory();
    });
  }
  Count(&state);
}
BENCHMARK(ViewNative)
    ->ArgName("channels")
    ->Arg(1)
    ->Arg(3)
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

void ViewOpenCl(benchmark::State& state) {
  const int channels = static_cast<int>(state.range(0));
  const Scene scene(channels);
  const CompactView view = DisparityRenderer(scene.map).RenderCompact(2, -1);
  const auto backend = kernels::OpenBackend(kernels::ParseDeviceRequest("opencl"), nullptr);
  const auto warp = backend->NewWarp(
      {kWidth, kHeight, channels, &scene.picture.values, &scene.map.disparity, 0.3F});
  std::array<std::vector<float>, kViews> values;
  const auto make = [&](int i) {
    warp->Warp({&view.disparity, view.shift.x(), view.shift.y(), &view.hidden},
               &values[static_cast<std::size_t>(i)]);
  };
  for (int i = 0; i < kViews; ++i) make(i);  // a first call compiles
  for (auto _ : state) {
    model::ParallelFor(kViews, 2, make);
    benchmark::ClobberMemory();
  }
  Count(&state);
}
BENCHMARK(ViewOpenCl)
    ->ArgName("channels")
    ->Arg(1)
    ->Arg(3)
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace thicklens::estimator
