// The whole scene solver: simulated scenes with known views, limits, and documented guarantees.
#include "thicklens/estimator/scene_solver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <mutex>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "support/error_message.h"
#include "support/test_cameras.h"
#include "tests/estimator/solver_runs.h"
#include "thicklens/base/error.h"
#include "thicklens/estimator/compare.h"
#include "thicklens/estimator/fill_holes.h"
#include "thicklens/estimator/view_geometry.h"
#include "thicklens/kernels/device.h"
#include "thicklens/kernels/kernels.h"
#include "thicklens/kernels/radiance_steps.h"
#include "thicklens/kernels/view_warp.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::estimator {
namespace {

using ::testing::AllOf;
using testing::ErrorOf;
using ::testing::HasSubstr;
using thicklens::testing::CentredSensor;
using thicklens::testing::TestCameraFocusedAt;
using thicklens::testing::WideLens;
using thicklens::testing::WithMethod;

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

// A blurred card before a slanted wall.
struct Simulated {
  model::LightField truth;
  EstimateInput input;
};

Simulated Simulate(bool falloff) {
  model::SceneSimulationOptions options;
  options.camera =
      WithMethod(TestCameraFocusedAt(800, "simulated", WideLens(6), CentredSensor(96, 80, 0.008)));
  model::SceneLayer wall;
  wall.plane.depth_mm = 1100;
  wall.plane.slope = {0.5, 0};
  model::SceneLayer card;
  card.plane.depth_mm = 700;
  card.outline.shape = model::OutlineOptions::Shape::kDisc;
  card.outline.centre = {35, 40};
  card.outline.radius = 18;
  card.texture.colour = {0.6, 0.4, 0.3};
  wall.texture.feature_size_px = card.texture.feature_size_px = 4;
  options.layers = {wall, card};
  options.effects.base = model::EffectSelectionOptions::Base::kAll;
  options.effects.without = {model::Effect::kDiffraction};
  if (!falloff) options.effects.without.Add(model::Effect::kFalloff);
  options.sampling_error_grey_levels = 0;
  options.noise_sigma_grey_levels = 1;
  options.rays_per_pixel = 200;
  const model::SceneSimulator simulator(options, std::vector<model::LayerPixels>(2));
  Simulated simulated;
  simulated.truth = simulator.RenderLightField(5, 5, {});
  const model::RawDepthMap depth = simulator.RenderDepth();
  const model::EncodedImage photograph = simulator.Store(simulator.RenderNoiseless({}));
  EstimateInput& input = simulated.input;
  input.image = model::ToLinear(photograph, options.camera.sensor.transfer);
  input.transfer = options.camera.sensor.transfer;
  input.weights = simulated.truth.weights;
  input.grid = simulated.truth.grid;
  input.camera = options.camera;
  input.disparity = DisparityOnGrid(*input.grid, depth.values, depth.width_px, depth.height_px);
  return simulated;
}

// The scene with fall-off, simulated once.
const Simulated& SimulatedScene() {
  static const Simulated simulated = Simulate(true);
  return simulated;
}

constexpr Prior kPriors[] = {Prior::kRidge, Prior::kGradient, Prior::kTotalVariation,
                             Prior::kPatches};

double MeanPsnr(const model::LightField& truth, const model::LightField& found) {
  return CompareLightFields(truth, found, 8, std::nullopt, 1).mean.psnr_db;
}

EstimateInput MadeUp(float disparity_px, int channels = 3) {
  std::mt19937 engine(4);
  std::uniform_real_distribution<float> uniform(0.2F, 0.7F);
  EstimateInput input;
  input.image = {40, 36, channels, {}};
  input.image.values.resize(40 * 36 * Index(channels));
  for (float& value : input.image.values) value = uniform(engine);
  input.disparity = {40, 36, std::vector<float>(40 * 36, disparity_px), {1, 1}};
  input.weights = model::ApertureWeights(model::ApertureShape::kUniform, 3, 3);
  return input;
}

TEST(SceneSolver, BeatsWarpingOnASimulatedScene) {
  const Simulated& simulated = SimulatedScene();
  const double dibr = MeanPsnr(simulated.truth, WarpedLightField(simulated.input, true, 2));
  double best = 0, of_variation = 0;
  for (const Prior prior : kPriors) {
    SceneOptions options;
    options.prior = prior;
    SceneSummary summary;
    SceneMaps maps;
    const model::LightField found = EstimateScene(simulated.input, options, {}, &summary, &maps);
    const double psnr = MeanPsnr(simulated.truth, found);
    EXPECT_GT(psnr, dibr + 1) << PriorName(prior);
    best = std::max(best, psnr);
    if (prior == Prior::kTotalVariation) of_variation = psnr;
    if (prior == Prior::kPatches) {
      EXPECT_GT(psnr, of_variation - 0.4);
    }
    EXPECT_TRUE(summary.converged) << summary.message;
    EXPECT_LE(summary.relative_residual, options.tolerance_or_usual());
    EXPECT_GT(255 * summary.noise_sigma, 1);
    EXPECT_LT(255 * summary.noise_sigma, 1.3);
    // H and the noise, but no more.
    EXPECT_GT(255 * summary.residual_rms, 0.5);
    EXPECT_LT(255 * summary.residual_rms, 3);
    EXPECT_GT(summary.strength, 0);
    EXPECT_EQ(summary.reweightings > 0,
              prior == Prior::kTotalVariation || prior == Prior::kPatches);
    EXPECT_EQ(found.origin.method, "scene");
    EXPECT_EQ(found.origin.prior, PriorName(prior));
    EXPECT_EQ(found.origin.iterations, summary.iterations);
    EXPECT_EQ(found.origin.strength, summary.strength);
    EXPECT_EQ(found.origin.effects, (std::vector<std::string>{"defocus", "falloff"}));
    std::string why;
    EXPECT_TRUE(found.IsValid(&why)) << why;
  }
  EXPECT_GT(best, dibr + 3);
}

// A sensor's shadow to the right of the card and speckle, a twentieth of the image.
TEST(SceneSolver, LosesLittleByHolesInTheDepth) {
  EstimateInput input = SimulatedScene().input;
  const DisparityMap truth = input.disparity;
  std::mt19937 engine(9);
  std::bernoulli_distribution is_speckle(0.03);
  for (int y = 0; y < truth.height_px; ++y) {
    for (int x = 0; x < truth.width_px; ++x) {
      const bool is_shadow = std::hypot(x - 35, y - 40) > 18 && std::hypot(x - 40, y - 40) < 18;
      if (!is_speckle(engine) && !is_shadow) continue;
      input.disparity.disparity[Index(y * truth.width_px + x)] =
          std::numeric_limits<float>::quiet_NaN();
    }
  }
  std::size_t filled = 0;
  input.disparity = FillHoles(input.disparity, input.image, &filled);
  EXPECT_GT(filled, truth.disparity.size() / 20);
  SceneSummary summary;
  const auto psnr = [&] {
    return MeanPsnr(SimulatedScene().truth, EstimateScene(input, {}, {}, &summary));
  };
  const double with_holes = psnr();
  input.disparity = truth;
  EXPECT_GT(with_holes, psnr() - 0.3);
}

// A machine on which tests run has an OpenCL device: none is a failure here.
kernels::Backend* OpenClBackend() {
  static const std::shared_ptr<kernels::Backend> backend = [] {
    kernels::DeviceRequest request;
    request.kind = kernels::DeviceRequest::Kind::kOpenCl;
    return kernels::OpenBackend(request, nullptr);
  }();
  return backend.get();
}

TEST(SceneSolver, ADeviceGivesTheSameLightField) {
  const Simulated& simulated = SimulatedScene();
  for (const bool double_precision : {false, true}) {
    for (const Prior prior : kPriors) {
      if (double_precision && prior != Prior::kTotalVariation) continue;  // costs time
      SceneOptions options;
      options.prior = prior;
      options.double_precision = double_precision;
      options.tolerance = 1e-5;
      SceneSummary cpu, device;
      const model::LightField expected = EstimateScene(simulated.input, options, {}, &cpu);
      const model::LightField found =
          EstimateScene(simulated.input, options, RunOn(OpenClBackend()), &device);
      double largest = 0, squares = 0;
      for (std::size_t i = 0; i < expected.values.size(); ++i) {
        const auto difference = static_cast<double>(std::abs(found.values[i] - expected.values[i]));
        largest = std::max(largest, difference);
        squares += difference * difference;
      }
      // The values are up to 1. A wave of a patch that is near the threshold may be kept or not.
      EXPECT_LE(largest, prior == Prior::kPatches ? 1e-2 : 1e-4) << PriorName(prior);
      EXPECT_LE(std::sqrt(squares / static_cast<double>(expected.values.size())),
                prior == Prior::kPatches ? 2e-4 : 5e-5)
          << PriorName(prior);
      EXPECT_TRUE(device.converged);
      EXPECT_EQ(device.device, OpenClBackend()->name());
      EXPECT_EQ(found.origin.device, OpenClBackend()->name());
      EXPECT_EQ(cpu.device, "cpu");
      EXPECT_EQ(expected.origin.device, "cpu");
    }
  }
}

TEST(SceneSolver, ADeviceFindsTheSameStrength) {
  const Simulated& simulated = SimulatedScene();
  SceneOptions options;
  options.prior = Prior::kGradient;
  options.strength_rule = StrengthRule::kGcv;
  SceneSummary cpu, device;
  EstimateScene(simulated.input, options, {}, &cpu);
  EstimateScene(simulated.input, options, RunOn(OpenClBackend()), &device);
  EXPECT_NEAR(device.strength, cpu.strength, 0.02 * cpu.strength);
}

// A device that can do nothing except report that.
class FloatOnly : public kernels::Backend {
 public:
  bool is_opencl() const override { return true; }
  bool has_double() const override { return false; }
  std::string name() const override { return "opencl:7:7"; }
  std::string description() const override { return "simulated"; }
  std::unique_ptr<kernels::Kernels<float>> NewFloat() override { return nullptr; }
  std::unique_ptr<kernels::Kernels<double>> NewDouble() override { return nullptr; }
  std::unique_ptr<kernels::RadianceSteps<float>> NewSteps(
      const kernels::DataTerm<float>& data) override {
    return kernels::NewCpuRadianceSteps(data);
  }
  std::unique_ptr<kernels::RadianceSteps<double>> NewSteps(
      const kernels::DataTerm<double>& data) override {
    return kernels::NewCpuRadianceSteps(data);
  }
  std::unique_ptr<kernels::ViewWarp> NewWarp(const kernels::SurfaceImage&) override {
    return nullptr;
  }
};

TEST(SceneSolver, ADeviceWithoutDoubleIsRefusedForDoublePrecision) {
  FloatOnly backend;
  SceneOptions options;
  options.double_precision = true;
  SceneSummary summary;
  EXPECT_THAT(ErrorOf([&] { EstimateScene(MadeUp(1.3F), options, RunOn(&backend), &summary); }),
              AllOf(HasSubstr("opencl:7:7"), HasSubstr("does not support double precision"),
                    HasSubstr("cpu")));
}

TEST(SceneSolver, CrossValidationFindsAStrengthAboutAsGood) {
  const Simulated& simulated = SimulatedScene();
  for (const Prior prior : {Prior::kRidge, Prior::kTotalVariation}) {
    SceneOptions options;
    options.prior = prior;
    SceneSummary with_auto, with_gcv;
    const double of_auto =
        MeanPsnr(simulated.truth, EstimateScene(simulated.input, options, {}, &with_auto));
    options.strength_rule = StrengthRule::kGcv;
    const double of_gcv =
        MeanPsnr(simulated.truth, EstimateScene(simulated.input, options, {}, &with_gcv));
    EXPECT_GT(of_gcv, of_auto - 0.7)
        << PriorName(prior) << " " << with_gcv.strength << " " << with_auto.strength;
    EXPECT_NE(with_gcv.strength, with_auto.strength);
    EXPECT_GT(with_gcv.iterations, 2 * with_auto.iterations);
  }
}

TEST(SceneSolver, FloatIsAsGoodAsDouble) {
  const Simulated& simulated = SimulatedScene();
  SceneOptions options;
  SceneSummary summary;
  const double single =
      MeanPsnr(simulated.truth, EstimateScene(simulated.input, options, {}, &summary));
  options.double_precision = true;
  EXPECT_NEAR(MeanPsnr(simulated.truth, EstimateScene(simulated.input, options, {}, &summary)),
              single, 0.02);
}

TEST(SceneSolver, AnImageWithoutBlurComesBack) {
  const EstimateInput input = MadeUp(0);
  for (const Prior prior : {Prior::kRidge, Prior::kTotalVariation}) {
    SceneOptions options;
    options.prior = prior;
    options.strength_rule = StrengthRule::kGiven;
    options.strength = 1e-6;
    SceneSummary summary;
    const model::LightField found = EstimateScene(input, options, {}, &summary);
    EXPECT_EQ(summary.strength, 1e-6);
    // The start of total variation is not taken for its answer, however close it is.
    EXPECT_EQ(summary.reweightings > 0, prior == Prior::kTotalVariation);
    const model::LinearImage view = model::ViewImage(found, 2, 0);
    for (std::size_t i = 0; i < view.values.size(); ++i) {
      ASSERT_NEAR(view.values[i], input.image.values[i], 2e-4);
    }
  }
}

TEST(SceneSolver, AConstantImageHasAConstantLightField) {
  EstimateInput input = MadeUp(1.3F, 1);
  for (float& value : input.image.values) value = 0.4F;
  for (const Prior prior : {Prior::kTotalVariation, Prior::kPatches}) {
    SceneOptions options;
    options.prior = prior;
    SceneSummary summary;
    const model::LightField found = EstimateScene(input, options, {}, &summary);
    for (const float value : found.values) ASSERT_NEAR(value, 0.4, 1e-3) << PriorName(prior);
  }
}

TEST(SceneSolver, AnyNumberOfThreadsGivesTheSameBits) {
  const Simulated& simulated = SimulatedScene();
  std::vector<float> first;
  for (const int threads : {1, 2, 3}) {
    SceneSummary summary;
    const model::LightField found =
        EstimateScene(simulated.input, {}, RunOnThreads(threads), &summary);
    EXPECT_EQ(summary.threads, threads);
    if (first.empty()) first = found.values;
    EXPECT_EQ(found.values, first) << threads;
  }
}

TEST(SceneSolver, SaysThatItDidNotConverge) {
  SceneOptions options;
  options.max_iterations = 7;
  options.tolerance = 1e-6;
  SceneSummary summary;
  const model::LightField found = EstimateScene(MadeUp(1.3F), options, {}, &summary);
  EXPECT_EQ(summary.iterations, 7);
  EXPECT_FALSE(summary.converged);
  EXPECT_GT(summary.relative_residual, 1e-6);
  EXPECT_THAT(summary.message, AllOf(HasSubstr("7 iterations"), HasSubstr("above the tolerance")));
  EXPECT_EQ(found.values.size(), 9 * 40 * 36 * 3u);
}

TEST(SceneSolver, SaysWhenItAssumesTheNoise) {
  EstimateInput input = MadeUp(0.4F, 1);
  for (float& value : input.image.values) value = 0.0005F;
  SceneSummary summary;
  EstimateScene(input, {}, {}, &summary);
  EXPECT_THAT(summary.message, HasSubstr("1/255 is assumed"));
  EXPECT_NEAR(summary.noise_sigma, 1.0 / 255, 1e-12);
}

TEST(SceneSolver, MapsShowBlurAndWhatIsOccluded) {
  const EstimateInput input = MadeUp(1.5F, 1);
  SceneSummary summary;
  SceneMaps maps;
  const model::LightField found = EstimateScene(input, {}, {}, &summary, &maps);
  // Three places a step of 1.5 px apart: variance 2/3 of its square.
  for (const float sigma : maps.blur_sigma_px) EXPECT_NEAR(sigma, 1.5 * std::sqrt(2.0 / 3), 1e-5);
  ASSERT_EQ(maps.residual.size(), 40 * 36u);
  ASSERT_EQ(maps.occluded_fraction.size(), 40 * 36u);
  EXPECT_EQ(maps.occluded_fraction[20 * 40 + 20], 0);
  EXPECT_EQ(maps.radiance.values, model::ViewImage(found, 1, 1).values);
  double squares = 0;
  for (const float value : maps.residual) squares += static_cast<double>(value) * value;
  EXPECT_NEAR(std::sqrt(squares / (40 * 36)), summary.residual_rms, 1e-6);
}

// The views are the warped radiance, whether or not H was made of the same views: those with a
// weight, of a photograph on its own grid.
TEST(SceneSolver, ViewsAreTheRadianceWarped) {
  EstimateInput simulated = SimulatedScene().input;
  simulated.weights(0, 0) = 0;  // has no part in H
  simulated.weights /= simulated.weights.sum();
  EstimateInput off_focus = simulated;
  off_focus.grid = model::GridOnPlanes(*simulated.camera, {0, 700}, 5, 5);
  off_focus.disparity = simulated.disparity;
  for (const EstimateInput& input : {simulated, off_focus}) {
    SceneSummary summary;
    SceneMaps maps;
    const model::LightField found = EstimateScene(input, {}, {}, &summary, &maps);
    for (const auto& [k, l] : {std::pair{0, 0}, {2, 2}, {4, 1}, {1, 3}}) {
      EXPECT_EQ(
          model::ViewImage(found, k, l).values,
          WarpImage(maps.radiance, input.disparity, RenderDisparity(input.disparity, k - 2, l - 2))
              .values)
          << k << ", " << l;
    }
  }
}

TEST(SceneSolver, GivesConfidenceToASinkThatWantsIt) {
  const EstimateInput input = MadeUp(1.5F, 1);
  for (const bool wanted : {true, false}) {
    SceneViewSink sink;
    sink.wants_confidence = wanted;
    std::mutex mutex;
    int views = 0;
    sink.take = [&](int, int, const model::LinearImage& view,
                    const std::vector<Confidence>& confidence) {
      const std::lock_guard<std::mutex> lock(mutex);
      EXPECT_EQ(view.values.size(), 40 * 36u);
      EXPECT_EQ(confidence.size(), wanted ? 40 * 36u : 0u);
      ++views;
    };
    SceneSummary summary;
    EstimateScene(input, {}, RunTo(sink), &summary);
    EXPECT_EQ(views, 9);
  }
}

TEST(SceneSolver, ProgressNeverGoesBackAndMayStop) {
  SolverRun run;
  int last = 0, all = 0;
  run.progress = [&](int done, int total) {
    EXPECT_GE(done, last);
    EXPECT_LE(done, total);
    last = done;
    all = total;
  };
  SceneSummary summary;
  EstimateScene(MadeUp(1.3F), {}, run, &summary);
  EXPECT_EQ(last, all);
  EXPECT_GT(all, 9);
  run.progress = [](int, int) { throw Interrupted(); };
  EXPECT_THROW(EstimateScene(MadeUp(1.3F), {}, run, &summary), Interrupted);
}

TEST(SceneSolver, RefusesWhatItCannotUse) {
  SceneSummary summary;
  SolverRun run;
  const auto message = [&](const EstimateInput& input, const SceneOptions& options) {
    return ErrorOf([&] { EstimateScene(input, options, run, &summary); });
  };
  const EstimateInput good = MadeUp(0.5F);
  EstimateInput input = good;
  input.image.values[3 * (5 * 40 + 7)] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(message(input, {}), AllOf(HasSubstr("image"), HasSubstr("nan at (7, 5)")));
  input = good;
  input.weights(1, 2) = std::numeric_limits<double>::infinity();
  EXPECT_THAT(message(input, {}), HasSubstr("the weight of the view (2, 1) is inf"));
  input = good;
  input.weights *= 2;
  EXPECT_THAT(message(input, {}), HasSubstr("have the sum 2"));
  input = good;
  input.disparity.disparity[3] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(message(input, {}), HasSubstr("holes"));
  input = good;
  input.disparity.width_px = 39;
  EXPECT_THAT(message(input, {}), AllOf(HasSubstr("39x36"), HasSubstr("40x36")));

  SceneOptions options;
  options.strength_rule = StrengthRule::kGiven;
  EXPECT_THAT(message(good, options), HasSubstr("strength is 0"));
  options = {};
  options.tolerance = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message(good, options), HasSubstr("tolerance is nan"));
  options = {};
  options.max_iterations = 0;
  EXPECT_THAT(message(good, options), HasSubstr("max_iterations is 0"));
  options = {};
  run.memory_limit_mib = 1;
  EXPECT_THAT(message(good, options),
              AllOf(HasSubstr("memory limit 1 MiB"), HasSubstr("must be at least")));
  run.memory_limit_mib = 1e5;
  EXPECT_EQ(message(good, options), "(no error)");
  EXPECT_GT(summary.predicted_memory_mib, 1);
}

TEST(SceneSolver, NamesOfPriors) {
  for (const Prior prior : kPriors) {
    EXPECT_EQ(PriorFromName(PriorName(prior)), prior);
  }
  EXPECT_THAT(ErrorOf([] { PriorFromName("smooth"); }),
              HasSubstr("ridge, gradient, tv or patches"));
}

}  // namespace
}  // namespace thicklens::estimator
