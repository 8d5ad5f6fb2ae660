// One view of a picture with a step in its depth, 640 x 480 px in 3 channels: by C++ on two
// threads, two views at a time, and by an OpenCL device. `views_per_second` compares them.
#include <benchmark/benchmark.h>

#include <cstddef>
#include <memory>
#include <random>
#include <vector>

#include "thicklens/estimator/view_geometry.h"
#include "thicklens/kernels/device.h"
#include "thicklens/model/parallel.h"

namespace thicklens::estimator {
namespace {

constexpr int kWidth = 640, kHeight = 480, kChannels = 3;
constexpr int kViews = 2;

struct Scene {
  model::LinearPicture picture{kWidth, kHeight, kChannels, {}};
  DisparityMap map{kWidth, kHeight, {}, {1, 1}};
  ViewDisparity view;

  Scene() {
    std::mt19937 engine(1);
    std::uniform_real_distribution<float> uniform(0, 1);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const bool near = x > 200 && x < 400 && y > 100 && y < 300;
        map.disparity.push_back(near ? 1.3F : -1 + 0.001F * static_cast<float>(x));
        for (int c = 0; c < kChannels; ++c) picture.values.push_back(uniform(engine));
      }
    }
    view = RenderDisparity(map, 2, -1);
  }
};
const Scene& TheScene() {
  static const Scene scene;
  return scene;
}

void Count(benchmark::State* state) {
  state->counters["views_per_second"] = benchmark::Counter(
      static_cast<double>(state->iterations()) * kViews, benchmark::Counter::kIsRate);
}

void ViewNative(benchmark::State& state) {
  const Scene& scene = TheScene();
  const PictureWarper warper(scene.picture, scene.map);
  for (auto _ : state) {
    model::ParallelFor(
        kViews, 2, [&](int) { benchmark::DoNotOptimize(warper.Warp(scene.view).values.data()); });
  }
  Count(&state);
}
BENCHMARK(ViewNative)->UseRealTime()->Unit(benchmark::kMillisecond);

void ViewOpenCl(benchmark::State& state) {
  const Scene& scene = TheScene();
  const auto backend = kernels::OpenBackend(kernels::ParseDeviceRequest("opencl"), nullptr);
  const auto warp = backend->NewWarp(
      {kWidth, kHeight, kChannels, &scene.picture.values, &scene.map.disparity, 0.3F});
  const kernels::ViewSources sources{&scene.view.disparity, &scene.view.source_x,
                                     &scene.view.source_y};
  std::vector<float> values;
  warp->Warp(sources, &values);  // a first call compiles
  for (auto _ : state) {
    for (int i = 0; i < kViews; ++i) warp->Warp(sources, &values);
    benchmark::DoNotOptimize(values.data());
  }
  Count(&state);
}
BENCHMARK(ViewOpenCl)->UseRealTime()->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace thicklens::estimator
