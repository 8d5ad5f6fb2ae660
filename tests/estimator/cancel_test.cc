// Computations that are cancelled end soon, and the cancellation is not mistaken for an error.
#include "thicklens/base/cancel.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstddef>
#include <ctime>
#include <functional>
#include <limits>
#include <optional>
#include <random>

#include "estimator/projection/scene_projection.h"
#include "thicklens/base/error.h"
#include "thicklens/estimator/block_solver.h"
#include "thicklens/estimator/compare.h"
#include "thicklens/estimator/functional_solver.h"
#include "thicklens/estimator/grid_solver.h"
#include "thicklens/estimator/inpaint.h"
#include "thicklens/estimator/scene_solver.h"
#include "thicklens/estimator/solve.h"
#include "thicklens/kernels/device.h"

namespace thicklens::estimator {
namespace {

// CPU time of this thread, which does not depend on how busy the machine is.
double CpuNow() {
  timespec time{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

CancelToken* token_of_timer = nullptr;
double cancelled_at_s = 0;

// The CPU time for which `work` goes on after it was cancelled, which happens after so much of it.
double CpuSecondsAfterCancel(double after_s, const std::function<void()>& work) {
  CancelToken token;
  token_of_timer = &token;
  const auto before = std::signal(SIGUSR1, [](int) {
    cancelled_at_s = CpuNow();
    token_of_timer->Cancel();
  });
  sigevent event{};
  event.sigev_notify = SIGEV_THREAD_ID;  // to this thread
  event.sigev_signo = SIGUSR1;
  event._sigev_un._tid = ::gettid();
  timer_t timer{};
  EXPECT_EQ(::timer_create(CLOCK_THREAD_CPUTIME_ID, &event, &timer), 0);
  itimerspec when{};
  when.it_value.tv_sec = static_cast<time_t>(after_s);
  when.it_value.tv_nsec =
      static_cast<long>(1e9 * (after_s - static_cast<double>(when.it_value.tv_sec)));
  ::timer_settime(timer, 0, &when, nullptr);
  {
    const CancelScope scope(&token);
    EXPECT_THROW(work(), Interrupted);
  }
  const double end_s = CpuNow();
  ::timer_delete(timer);
  std::signal(SIGUSR1, before);
  return end_s - cancelled_at_s;
}

EstimateInput RandomInput(int width_px, int height_px, float least_px, float most_px) {
  std::mt19937 engine(4);
  std::uniform_real_distribution<float> light(0.2F, 0.7F), disparity(least_px, most_px);
  EstimateInput input;
  const auto pixels = static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px);
  input.image = {width_px, height_px, 3, {}};
  input.image.values.resize(3 * pixels);
  for (float& value : input.image.values) value = light(engine);
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
  // The least of several runs: on a busy machine some take longer, and the work must not end before
  // it is cancelled.
  double whole_s = std::numeric_limits<double>::infinity();
  for (int run = 0; run < 4; ++run) {
    const double start_s = CpuNow();
    work();
    whole_s = std::min(whole_s, CpuNow() - start_s);
  }
  for (const double share : {0.2, 0.4, 0.6}) {
    EXPECT_LT(CpuSecondsAfterCancel(share * whole_s, work), whole_s / 10) << share << " of it";
  }
}

// `estimate(progress)` is cancelled at each of its steps, and must end by Interrupted each time.
void ExpectCancelledAtEachStep(
    const std::function<void(const std::function<void(int, int)>& progress)>& estimate) {
  int steps = 0;
  estimate([&](int, int) { ++steps; });
  ASSERT_GT(steps, 3);
  // The last step is left out, because the work is done then.
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

TEST(CancelledEstimate, TheSceneSolverStops) {
  const EstimateInput input = RandomInput(40, 36, 0.5F, 1.5F);
  for (const Prior prior : {Prior::kRidge, Prior::kTotalVariation, Prior::kPatches}) {
    ExpectCancelledAtEachStep([&](const std::function<void(int, int)>& progress) {
      SceneOptions options;
      SolverRun run;
      options.prior = prior;
      run.threads = 1;
      run.progress = progress;
      SceneSummary summary;
      EstimateScene(input, options, run, &summary);
    });
  }
}

TEST(CancelledEstimate, TheBlockSolverStops) {
  const EstimateInput input = RandomInput(40, 36, 0.5F, 1.5F);
  ExpectCancelledAtEachStep([&](const std::function<void(int, int)>& progress) {
    BlockOptions options;
    SolverRun run;
    options.block_px = 8;
    run.threads = 1;
    run.progress = progress;
    BlockSummary summary;
    EstimateByBlocks(input, options, run, &summary);
  });
}

TEST(CancelledEstimate, TheFunctionalAndTheGridSolverStop) {
  const EstimateInput input = RandomInput(40, 36, 0.5F, 1.5F);
  for (const SolverOptions& solver :
       {SolverOptions(FunctionalOptions()), SolverOptions(GridOptions())}) {
    SCOPED_TRACE(SolverName(solver));
    ExpectCancelledAtEachStep([&](const std::function<void(int, int)>& progress) {
      SolverRun run;
      run.threads = 1;
      run.progress = progress;
      Solve(input, solver, run, nullptr);
    });
  }
}

// A message about a view that cannot be compared begins with its position. A cancellation must not
// become such an error.
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
