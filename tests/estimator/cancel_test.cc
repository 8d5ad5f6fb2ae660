// How soon computations end that are cancelled, and that nothing takes the end for an error.
#include "thicklens/cancel.h"

#include <gtest/gtest.h>
#include <pthread.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <ctime>
#include <functional>
#include <optional>
#include <random>
#include <thread>

#include "scene_projection.h"
#include "thicklens/error.h"
#include "thicklens/estimator/compare.h"
#include "thicklens/estimator/estimate.h"
#include "thicklens/estimator/functional_solver.h"
#include "thicklens/estimator/grid_solver.h"
#include "thicklens/estimator/inpaint.h"
#include "thicklens/estimator/scene_solver.h"
#include "thicklens/kernels/device.h"

namespace thicklens::estimator {
namespace {

double CpuSecondsOf(pthread_t thread) {
  clockid_t clock{};
  timespec time{};
  ::pthread_getcpuclockid(thread, &clock);
  ::clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// The CPU time that `work` takes on this thread; of one that is cancelled after so much, what it
// goes on for. Not wall time: how busy the machine is does not matter then.
double CpuSeconds(const std::function<void()>& work) {
  const double start = CpuSecondsOf(::pthread_self());
  work();
  return CpuSecondsOf(::pthread_self()) - start;
}
double CpuSecondsAfterCancel(double after_s, const std::function<void()>& work) {
  CancelToken token;
  const pthread_t worker = ::pthread_self();
  const double start = CpuSecondsOf(worker);
  std::atomic<double> cancelled_at{0};
  std::atomic<bool> is_over{false};
  std::thread other([&] {
    while (!is_over && CpuSecondsOf(worker) < start + after_s) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    cancelled_at = CpuSecondsOf(worker);
    token.Cancel();
  });
  {
    const CancelScope scope(&token);
    EXPECT_THROW(work(), Interrupted);
  }
  const double end = CpuSecondsOf(worker);
  is_over = true;
  other.join();
  return end - cancelled_at;
}

EstimateInput RandomInput(int width_px, int height_px, float least_px, float most_px) {
  std::mt19937 engine(4);
  std::uniform_real_distribution<float> light(0.2F, 0.7F), disparity(least_px, most_px);
  EstimateInput input;
  const auto pixels = static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px);
  input.picture = {width_px, height_px, 3, {}};
  input.picture.values.resize(3 * pixels);
  for (float& value : input.picture.values) value = light(engine);
  input.disparity = {width_px, height_px, {}, {1, 1}};
  for (std::size_t i = 0; i < pixels; ++i) input.disparity.disparity.push_back(disparity(engine));
  input.weights = model::ApertureWeights(model::ApertureShape::kUniform, 3, 3);
  return input;
}

// 8-bit disparities taken as pixels per view step: nothing looked at the token while the rows of H
// were gathered, which takes most of the time.
TEST(CancelledProjection, EndsInAFractionOfItsTime) {
  const EstimateInput input = RandomInput(160, 120, 0, 60);
  const auto work = [&] {
    MakeSceneProjection<float>(input.disparity, input.weights, ProjectionOptions());
  };
  const double whole_s = CpuSeconds(work);
  for (const double share : {0.2, 0.4, 0.6, 0.8}) {
    EXPECT_LT(CpuSecondsAfterCancel(share * whole_s, work), whole_s / 10) << share << " of it";
  }
}

// `estimate(progress)` is cancelled at each of its steps, and must end by Interrupted each time.
void ExpectCancelledAtEachStep(
    const std::function<void(const std::function<void(int, int)>& progress)>& estimate) {
  int steps = 0;
  estimate([&](int, int) { ++steps; });
  ASSERT_GT(steps, 3);
  // Not at the last: then the work is done.
  for (int at = 1; at < steps - 1; at += 1 + steps / 20) {
    CancelToken token;
    const CancelScope scope(&token);
    int step = 0;
    const auto progress = [&](int, int) {
      if (++step == at) token.Cancel();
    };
    EXPECT_THROW(estimate(progress), Interrupted) << "at step " << at << " of " << steps;
    EXPECT_LE(step, at + 1);
  }
}

TEST(CancelledEstimate, OfAScene) {
  const EstimateInput input = RandomInput(40, 36, 0.5F, 1.5F);
  for (const Prior prior : {Prior::kRidge, Prior::kTotalVariation, Prior::kPatches}) {
    ExpectCancelledAtEachStep([&](const std::function<void(int, int)>& progress) {
      SceneOptions options;
      options.prior = prior;
      options.threads = 1;
      options.progress = progress;
      SceneSummary summary;
      EstimateScene(input, options, &summary, nullptr);
    });
  }
}

TEST(CancelledEstimate, ByBlocks) {
  const EstimateInput input = RandomInput(40, 36, 0.5F, 1.5F);
  const auto backend = kernels::OpenBackend(kernels::ParseDeviceRequest("cpu"), nullptr);
  ExpectCancelledAtEachStep([&](const std::function<void(int, int)>& progress) {
    BlockOptions options;
    options.block_px = 8;
    options.threads = 1;
    options.progress = progress;
    EstimateSummary summary;
    EstimateByBlocks(input, options, backend.get(), &summary);
  });
}

TEST(CancelledEstimate, ByTheFunctionalAndOnTheGrid) {
  const EstimateInput input = RandomInput(40, 36, 0.5F, 1.5F);
  for (const auto& solve : {EstimateFunctional, EstimateOnGrid}) {
    ExpectCancelledAtEachStep([&](const std::function<void(int, int)>& progress) {
      FunctionalOptions options;
      options.threads = 1;
      options.progress = progress;
      FunctionalSummary summary;
      solve(input, options, &summary);
    });
  }
}

// What is said about a view that cannot be compared has its place in front: the end of the work
// must not become such an error.
TEST(CancelledComparison, EndsByInterruptedToo) {
  const EstimateInput input = RandomInput(40, 36, 0.5F, 1.5F);
  const model::LightField light_field = WarpedLightField(input, false, 1);
  CancelToken token;
  token.Cancel();
  const CancelScope scope(&token);
  EXPECT_THROW(CompareLightFields(light_field, light_field, 0, std::nullopt, 1), Interrupted);
}

}  // namespace
}  // namespace thicklens::estimator
