// Measures H of the solver `scene`, which is limited by memory bandwidth, on a slanted plane of
// 2048 x 1536 px, 7 x 7 views of one weight, one channel. `bytes_per_second` counts the minimum
// traffic of H (its tables, the image that it reads and the one that it writes, once each).
// Compare it with that of the triad, which is the bandwidth of this machine for two threads. Steps
// and H on an OpenCL device are compared by time. If the device is the processor, column CPU (all
// threads of the process) can be compared as well. FormNative measures H of a whole light field, as
// `thicklens bench paper --table 2` does; its minimum traffic is the light field, which it reads,
// and the image, which it writes.
#include <benchmark/benchmark.h>

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "estimator/projection/scene_projection.h"
#include "estimator/scene/scene_data.h"
#include "estimator/scene/scene_priors.h"
#include "kernels/opencl/opencl_device.h"
#include "kernels/opencl/opencl_program.h"
#include "kernels/opencl/opencl_projection.h"
#include "thicklens/base/parallel.h"
#include "thicklens/estimator/render.h"
#include "thicklens/kernels/device.h"
#include "thicklens/kernels/radiance_steps.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::estimator {
namespace {

constexpr int kThreads = 2;
constexpr int kWidth = 2048, kHeight = 1536, kViews = 7;
constexpr double kMaxDisparityPx = 1;
constexpr double kMu = 1e-2;  // weight of the ridge

void Report(benchmark::State* state, double bytes) {
  state->SetBytesProcessed(
      static_cast<std::int64_t>(bytes * static_cast<double>(state->iterations())));
}

void TriadOf(const float* b, const float* c, float scale, std::size_t count, float* a) {
  for (std::size_t i = 0; i < count; ++i) a[i] = b[i] + scale * c[i];
}

// Counts bytes as the STREAM benchmark does: two arrays are read and one is written.
void Triad(benchmark::State& state) {
  constexpr std::size_t kCount = std::size_t{1} << 27U;
  constexpr int kParts = 64;
  std::vector<float> a(kCount), b(kCount, 1.0F), c(kCount, 2.0F);
  for (auto _ : state) {
    ParallelFor(kParts, kThreads, [&](int part) {
      constexpr std::size_t kOfPart = kCount / kParts;
      const std::size_t first = static_cast<std::size_t>(part) * kOfPart;
      TriadOf(b.data() + first, c.data() + first, 3, kOfPart, a.data() + first);
    });
    benchmark::ClobberMemory();
  }
  Report(&state, 3.0 * sizeof(float) * kCount);
}

struct Problem {
  DisparityMap disparity{kWidth, kHeight, {}, {1, 1}};
  Eigen::ArrayXXd weights = model::ApertureWeights(model::ApertureShape::kUniform, kViews, kViews);
  SceneProjection<float> projection;
  DataTerm<float> data;

  Problem() {
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        disparity.disparity.push_back(
            static_cast<float>(kMaxDisparityPx * (2.0 * x / (kWidth - 1) - 1)));
        data.photograph.push_back(static_cast<float>((x / 16 + y / 16) % 2));
      }
    }
    ProjectionOptions options;
    options.threads = kThreads;
    projection = MakeSceneProjection<float>(disparity, weights, options);
    data.width_px = kWidth;
    data.height_px = kHeight;
    data.channels = 1;
    data.threads = kThreads;
    data.projection.apply = [this](const float* x, int channels, float* y) {
      projection.Apply(x, channels, y);
    };
    data.projection.apply_transposed = [this](const float* y, int channels, float* x) {
      projection.ApplyTransposed(y, channels, x);
    };
    for (const auto& term : projection.terms) {
      data.filters.products.push_back({&term.across, &term.down});
    }
    data.filters.rows = &projection.rows;
    data.weight.assign(data.pixels(), 1.0F);
    data.row_norm2 = SquaredRows<float>(disparity, weights);
  }
  Problem(const Problem&) = delete;

  double LeastBytes() const {
    return projection.bytes(0, kHeight) + 2.0 * sizeof(float) * static_cast<double>(data.pixels());
  }
};
const Problem& TheProblem() {
  static const Problem problem;
  return problem;
}

void ForwardNative(benchmark::State& state) {
  const Problem& problem = TheProblem();
  std::vector<float> y(problem.data.pixels());
  for (auto _ : state) {
    problem.projection.Apply(problem.data.photograph.data(), 1, y.data());
    benchmark::ClobberMemory();
  }
  Report(&state, problem.LeastBytes());
}

// An image of 640 x 480 px whose rays land 0 or 0.37 px farther from view to view, so that each
// pixel gets one sample or four of each view.
void FormNative(benchmark::State& state) {
  model::LightField field = model::MakeLightField(640, 480, kViews, kViews, 1);
  std::fill(field.values.begin(), field.values.end(), 0.5F);
  field.landing_step_px.setConstant(static_cast<double>(state.range(0)) / 100);
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        Photograph(field, field.weights, nullptr, nullptr, nullptr, kThreads).values.data());
  }
  Report(&state, sizeof(float) * static_cast<double>(field.values.size() + field.view_size()));
}

// The images are on the device.
void ForwardOpenCl(benchmark::State& state) {
  const Problem& problem = TheProblem();
  const kernels::DeviceRequest place = kernels::ParseDeviceRequest(
      kernels::OpenBackend(kernels::ParseDeviceRequest("opencl"), nullptr)->name());
  const auto device = kernels::OpenOpenClDevice(place.platform, place.device);
  kernels::OpenClQueue queue(device, kernels::BuildKernels(*device, "float"),
                             kernels::HostMemory::kCopied);
  kernels::OpenClProjection<float> projection(&queue, problem.data,
                                              kernels::FormOf(*device, sizeof(float)));
  kernels::DeviceImage<float> x(&queue, "image", projection.layout(), 1);
  kernels::DeviceImage<float> y(&queue, "photograph", projection.layout(), 1);
  x.Write(problem.data.photograph);
  const kernels::DeviceMemory last(&queue, "last", sizeof(double));
  double unused = 0;
  projection.Apply(x, 1, nullptr, &y);
  last.Read(&unused);  // waits until all earlier calls are done
  for (auto _ : state) {
    projection.Apply(x, 1, nullptr, &y);
    last.Read(&unused);
  }
  Report(&state, problem.LeastBytes());
}

// Runs steepest descent, of which a step costs as much as one of conjugate gradients.
void RunSteps(benchmark::State* state, kernels::RadianceSteps<float>* steps) {
  const Problem& problem = TheProblem();
  const auto run_one = [&] {
    steps->UpdateResidual();
    const double steepness = steps->UpdateDirection(0);
    steps->UpdateSolution(steepness / steps->ApplyNormalOperator());
  };
  steps->SetPrior(RidgePrior(problem.data.weight, kMu));
  steps->Start(problem.data.photograph);
  run_one();
  // Until the device has done all earlier calls, which include compilation
  steps->UpdateResidual();
  for (auto _ : *state) run_one();
}
void StepNative(benchmark::State& state) {
  RunSteps(&state, kernels::NewCpuRadianceSteps(TheProblem().data).get());
}
void StepOpenCl(benchmark::State& state) {
  const auto backend = kernels::OpenBackend(kernels::ParseDeviceRequest("opencl"), nullptr);
  RunSteps(&state, backend->NewSteps(TheProblem().data).get());
}

void Usual(benchmark::internal::Benchmark* benchmark) {
  benchmark->MeasureProcessCPUTime()->UseRealTime()->Unit(benchmark::kMillisecond);
}
BENCHMARK(Triad)->Apply(Usual);
BENCHMARK(FormNative)->Arg(0)->Arg(37)->Apply(Usual);
BENCHMARK(ForwardNative)->Apply(Usual);
BENCHMARK(ForwardOpenCl)->Apply(Usual);
BENCHMARK(StepNative)->Apply(Usual);
BENCHMARK(StepOpenCl)->Apply(Usual);

}  // namespace
}  // namespace thicklens::estimator
