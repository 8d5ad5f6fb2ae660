// The shading of a scene's relief: its parts are compared with closed forms, and its effect is
// tested on a scene that is simulated ray by ray.
#include "estimator/scene/guided_shading.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <optional>
#include <random>
#include <vector>

#include "support/test_cameras.h"
#include "thicklens/estimator/compare.h"
#include "thicklens/estimator/depth_noise.h"
#include "thicklens/estimator/scene_solver.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::estimator {
namespace {

using thicklens::testing::CentredSensor;
using thicklens::testing::TestCameraFocusedAt;
using thicklens::testing::WideLens;
using thicklens::testing::WithMethod;

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

DisparityMap MapOf(int width_px, int height_px, const std::function<double(int, int)>& disparity) {
  DisparityMap map{width_px, height_px, {}, {1, 1}};
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) {
      map.disparity.push_back(static_cast<float>(disparity(x, y)));
    }
  }
  return map;
}

TEST(ShadingGuide, HasTheSlopesOfARoofAndNoneOfAPlaneOrItsEdges) {
  // Two planes of slope 0.05 in opposite directions, of 20 and 21 pixels. Without their mean this
  // is 0.05 (1 - 1/41^2)^0.5.
  DisparityMap roof = MapOf(41, 30, [](int x, int) { return 0.05 * std::abs(x - 20); });
  EXPECT_NEAR(ShadingGuideSlope(roof), 0.05 * std::sqrt(1 - 1 / (41.0 * 41)), 1e-6);
  // The unit of the slopes is px of a view step.
  roof.step = {0.5, 0.5};
  EXPECT_NEAR(ShadingGuideSlope(roof), 0.025 * std::sqrt(1 - 1 / (41.0 * 41)), 1e-6);
  const auto plane = [](int x, int y) { return 0.03 * x - 0.04 * y + (x >= 20 ? 5 : 0); };
  EXPECT_NEAR(ShadingGuideSlope(MapOf(40, 30, plane)), 0, 1e-4);
  const ShadingGuide<double> guide = ShadingGuideOf<double>(MapOf(40, 30, plane), 0.05);
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 40; ++x) {
      const std::size_t i = Index(y) * 40 + Index(x);
      ASSERT_EQ(guide.is_smooth[i], x == 19 || x == 20 ? 0.0F : 1.0F) << x << ", " << y;
      // One way everywhere: less the mean nothing is left.
      for (std::size_t k = 0; k < 3; ++k) ASSERT_NEAR(guide.normals[k * 1200 + i], 0, 1e-5);
    }
  }
  EXPECT_EQ(ShadingGuideSlope(MapOf(1, 1, plane)), 0);
  EXPECT_NEAR(ShadingGuideSlope(MapOf(9, 1, [](int x, int) { return 0.03 * (x % 2); })), 0.03,
              1e-3);
}

// Two planes that meet in a ridge: away from it the normals differ as those of (g, 0, c) do.
TEST(ShadingGuide, FacesWhereItsPlanesFace) {
  const DisparityMap map = MapOf(40, 12, [](int x, int) { return 0.06 * std::min(x, 40 - x); });
  for (const double slope : {0.08, 0.001}) {
    const double c = std::max(slope, 0.02), length = std::hypot(0.06, c);
    const ShadingGuide<float> guide = ShadingGuideOf<float>(map, slope);
    const auto normal = [&](std::size_t k, int x) {
      return static_cast<double>(guide.normals[k * 480 + 6 * 40 + Index(x)]);
    };
    EXPECT_NEAR(normal(0, 8) - normal(0, 32), 2 * 0.06 / length, 1e-5);
    EXPECT_NEAR(normal(1, 8), 0, 1e-6);
    EXPECT_NEAR(normal(2, 8) - normal(2, 32), 0, 1e-5);
    // The ridge between them is not turned farther than they are.
    for (int x = 17; x < 24; ++x) {
      EXPECT_GE(normal(0, x), normal(0, 32) - 1e-5);
      EXPECT_LE(normal(0, x), normal(0, 8) + 1e-5);
    }
  }
}

// Numbers without a plan, and the same through a mean of 3 x 3.
constexpr int kWidth = 90, kHeight = 150;
constexpr std::size_t kPixels = kWidth * kHeight;
std::vector<double> Random(std::size_t count, unsigned seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> normal(0, 0.5);
  std::vector<double> numbers(count);
  for (double& number : numbers) number = normal(engine);
  return numbers;
}
std::vector<double> Blurred(const std::vector<double>& planes) {
  std::vector<double> blurred(planes.size());
  for (std::size_t i = 0; i < planes.size(); ++i) {
    const int x = static_cast<int>(i % kWidth), y = static_cast<int>(i % kPixels / kWidth);
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const int at_x = std::clamp(x + dx, 0, kWidth - 1);
        const int at_y = std::clamp(y + dy, 0, kHeight - 1);
        blurred[i] += planes[i / kPixels * kPixels + Index(at_y) * kWidth + Index(at_x)] / 9;
      }
    }
  }
  return blurred;
}
struct Shaded {
  ShadingGuide<double> guide{Random(3 * kPixels, 1), std::vector<float>(kPixels, 1.0F)};
  std::vector<double> estimated = Blurred(guide.normals);
};
double Rms(const std::vector<double>& numbers) {
  double sum = 0;
  for (const double number : numbers) sum += number * number;
  return std::sqrt(sum / static_cast<double>(numbers.size()));
}

// Two colours are lit from different sides, and the detail that was lost to blur is restored.
TEST(FitShading, FindsTheLight) {
  const Shaded shaded;
  const double light[2][3] = {{0.2, -0.1, 0.15}, {-0.05, 0.1, 0.2}};
  std::vector<double> truth(2 * kPixels), radiance(2 * kPixels);
  for (std::size_t c = 0; c < 2; ++c) {
    for (std::size_t i = 0; i < kPixels; ++i) {
      truth[c * kPixels + i] = radiance[c * kPixels + i] = 0.5;
      for (std::size_t k = 0; k < 3; ++k) {
        truth[c * kPixels + i] += light[c][k] * shaded.guide.normals[k * kPixels + i];
        radiance[c * kPixels + i] += light[c][k] * shaded.estimated[k * kPixels + i];
      }
    }
  }
  const GuidedShading<double> shading =
      FitShading(shaded.guide, shaded.estimated, radiance, kWidth, kHeight, 2);
  std::vector<double> found = radiance, before = radiance;
  for (std::size_t i = 0; i < found.size(); ++i) {
    found[i] += shading.sharp[i] - shading.already[i] - truth[i];
    before[i] -= truth[i];
  }
  EXPECT_LT(Rms(found), 0.1 * Rms(before));
}

// An image that has nothing to do with the relief, and one without anything.
TEST(FitShading, LeavesPaintAlone) {
  const Shaded shaded;
  const std::vector<double> paint = Blurred(Random(kPixels, 2));
  const GuidedShading<double> shading =
      FitShading(shaded.guide, shaded.estimated, paint, kWidth, kHeight, 2);
  EXPECT_LT(Rms(shading.sharp), 0.02 * Rms(paint));
  EXPECT_LT(Rms(shading.already), 0.02 * Rms(paint));
  const GuidedShading<double> of_none = FitShading(
      shaded.guide, shaded.estimated, std::vector<double>(kPixels, 0.5), kWidth, kHeight, 2);
  EXPECT_LT(Rms(of_none.sharp), 1e-9);
}

// A depth whose noise is as large as its relief explains half of the variance: least squares halve
// the coefficients, and the correction for doubt leaves 0.5/(0.5 + 4 (1 - 0.5)) of that.
TEST(FitShading, DoubtsANoisyRelief) {
  Shaded shaded;
  const std::vector<double> truth = shaded.guide.normals, in_image = shaded.estimated;
  const std::vector<double> noise = Random(3 * kPixels, 4), estimated_noise = Blurred(noise);
  for (std::size_t i = 0; i < truth.size(); ++i) {
    shaded.guide.normals[i] += noise[i];
    shaded.estimated[i] += estimated_noise[i];
  }
  const std::vector<double> radiance(in_image.begin(), in_image.begin() + kPixels);
  const GuidedShading<double> shading =
      FitShading(shaded.guide, shaded.estimated, radiance, kWidth, kHeight, 2);
  double along = 0, squares = 0;
  for (std::size_t i = 0; i < kPixels; ++i) {
    along += shading.already[i] * shaded.estimated[i];
    squares += shaded.estimated[i] * shaded.estimated[i];
  }
  EXPECT_NEAR(along / squares, 0.5 * 0.2, 0.02);
}

TEST(FitShading, IsNothingBesideJumpsAndTheSameBitsOnAnyNumberOfThreads) {
  Shaded shaded;
  for (std::size_t i = 0; i < kPixels; i += 7) shaded.guide.is_smooth[i] = 0;
  const std::vector<double> image = Blurred(Random(3 * kPixels, 3));
  const GuidedShading<double> one =
      FitShading(shaded.guide, shaded.estimated, image, kWidth, kHeight, 1);
  for (std::size_t i = 0; i < image.size(); ++i) {
    if (i % kPixels % 7 == 0) {
      ASSERT_EQ(one.sharp[i], 0);
    }
  }
  const GuidedShading<double> three =
      FitShading(shaded.guide, shaded.estimated, image, kWidth, kHeight, 3);
  EXPECT_EQ(three.sharp, one.sharp);
  EXPECT_EQ(three.already, one.already);
}

// A coloured surface with bumps of 2 to 4 px, lit from one side, out of focus.
constexpr int kSceneWidth = 128, kSceneHeight = 112;
struct Scene {
  EstimateInput input;
  model::LightField truth;
};
struct Bumps {
  explicit Bumps(unsigned seed) {
    std::mt19937 engine(seed);
    std::uniform_real_distribution<double> uniform(0, 1);
    for (int n = 0; n < 260; ++n) {
      const double x0 = kSceneWidth * uniform(engine), y0 = kSceneHeight * uniform(engine);
      const double sigma = 2 + 2 * uniform(engine), up = uniform(engine) < 0.5 ? -1 : 1;
      for (int y = 0; y < kSceneHeight; ++y) {
        for (int x = 0; x < kSceneWidth; ++x) {
          heights[Index(y * kSceneWidth + x)] +=
              up * sigma *
              std::exp(-(std::pow(x - x0, 2) + std::pow(y - y0, 2)) / (2 * sigma * sigma));
        }
      }
    }
  }
  double At(int x, int y) const {
    return heights[Index(std::clamp(y, 0, kSceneHeight - 1) * kSceneWidth +
                         std::clamp(x, 0, kSceneWidth - 1))];
  }
  std::vector<double> heights = std::vector<double>(Index(kSceneWidth * kSceneHeight));
};

// `shading`: the bumps that its light shows. `relief`: those that it has.
Scene ShadedScene(const Bumps& shading, const Bumps& guide) {
  model::SceneSimulationOptions options;
  options.camera = WithMethod(TestCameraFocusedAt(800, "simulated", WideLens(6),
                                                  CentredSensor(kSceneWidth, kSceneHeight, 0.008)));
  options.effects.base = model::EffectSelectionOptions::Base::kAll;
  options.effects.without = {model::Effect::kDiffraction};
  options.effects.without.Add(model::Effect::kFalloff);
  options.noise_sigma_grey_levels = 1;
  options.rays_per_pixel = 200;
  options.u_count = options.v_count = 5;
  model::SceneLayer surface;
  surface.depth.emplace();
  surface.texture.kind = model::TextureKind::kImage;
  options.layers = {surface};
  std::vector<model::LayerPixels> pixels(1);
  pixels[0].depth = {kSceneWidth, kSceneHeight, {}, {}};
  pixels[0].texture = {kSceneWidth, kSceneHeight, 3, {}};
  for (int y = 0; y < kSceneHeight; ++y) {
    for (int x = 0; x < kSceneWidth; ++x) {
      pixels[0].depth.values.push_back(static_cast<float>(1 / (1.0 / 650 + 2e-6 * guide.At(x, y))));
      const double across = (shading.At(x + 1, y) - shading.At(x - 1, y)) / 2;
      const double down = (shading.At(x, y + 1) - shading.At(x, y - 1)) / 2;
      // Lambert: n . light, n the unit normal.
      const double light =
          (0.5 * across + 0.3 * down + 0.8) / std::sqrt(across * across + down * down + 1);
      for (const double paint : {0.5, 0.4, 0.3}) {
        pixels[0].texture.values.push_back(
            static_cast<float>(paint * std::max(light, 0.05) * (1 + 0.2 * std::sin(0.05 * x))));
      }
    }
  }
  const model::SceneSimulator simulator(options, pixels);
  Scene scene;
  scene.truth = simulator.RenderLightField(5, 5, {});
  const model::RawDepthMap depth = simulator.RenderDepth();
  scene.input.transfer = options.camera.sensor.transfer;
  scene.input.image =
      model::ToLinear(simulator.Store(simulator.RenderNoiseless({})), scene.input.transfer);
  scene.input.weights = scene.truth.weights;
  scene.input.grid = scene.truth.grid;
  scene.input.camera = options.camera;
  scene.input.disparity =
      DisparityOnGrid(*scene.input.grid, depth.values, depth.width_px, depth.height_px);
  return scene;
}

double PsnrOf(const Scene& scene, Prior prior, const SceneOptions& usual = {}) {
  SceneOptions options = usual;
  options.prior = prior;
  options.falloff = false;
  SceneSummary summary;
  const model::LightField found = EstimateScene(scene.input, options, {}, &summary);
  EXPECT_TRUE(summary.converged) << summary.message;
  return CompareLightFields(scene.truth, found, 8, std::nullopt, 2).mean.psnr_db;
}

void AddDepthNoise(double sigma_px, EstimateInput* input) {
  const double step = input->disparity.step.cwiseAbs().maxCoeff();
  std::mt19937 engine(5);
  std::normal_distribution<double> normal(0, sigma_px / step);
  for (float& disparity : input->disparity.disparity)
    disparity += static_cast<float>(normal(engine));
}

// Shading that was lost to blur is restored from the depth. A relief that differs from that of the
// image does no harm, compared with no relief in the depth.
TEST(GuidedShading, OfASceneComesBack) {
  const Bumps bumps(1), others(2);
  const Scene shaded = ShadedScene(bumps, bumps);
  const double variation_db = PsnrOf(shaded, Prior::kTotalVariation);
  const double shaded_db = PsnrOf(shaded, Prior::kPatches);
  const double painted_db = PsnrOf(ShadedScene(bumps, others), Prior::kPatches);
  Bumps none = bumps;
  std::fill(none.heights.begin(), none.heights.end(), 0);
  const double flat_db = PsnrOf(ShadedScene(bumps, none), Prior::kPatches);
  EXPECT_GT(painted_db, flat_db - 0.1);
  EXPECT_GT(flat_db, variation_db + 3);
  EXPECT_GT(shaded_db, painted_db + 2.5);
  // Noise that is ten times as steep as the relief: as if there was none.
  Scene noisy = shaded;
  AddDepthNoise(0.05, &noisy.input);
  EXPECT_GT(PsnrOf(noisy, Prior::kPatches), painted_db - 0.4);
  noisy.input.disparity = SmoothDepth(noisy.input.disparity, 0.05, 2).map;
  EXPECT_GT(PsnrOf(noisy, Prior::kPatches), painted_db);
}

}  // namespace
}  // namespace thicklens::estimator
