// Images of scenes whose surface is a depth map.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "model/base/random_draws.h"
#include "model/simulate/scene/ray_set.h"
#include "support/error_message.h"
#include "support/macro_scene.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::model {
namespace {

using testing::ErrorOf;
using ::testing::HasSubstr;
using testing::MacroScene;

constexpr double kPi = 3.14159265358979323846;
constexpr int kWidth = 48, kHeight = 36;
const SceneRun kRun{1, {}};

// z of a plane where chief rays meet it.
double PlaneDepthMm(const Camera& camera, const PlaneOptions& plane, double x, double y) {
  const Eigen::Vector2d slope =
      (Eigen::Vector2d(x, y) - camera.sensor.principal_point_px) / camera.focal_scale_px();
  return plane.depth_mm / (1 - plane.slope.dot(slope));
}

RawDepthMap MapOf(const std::function<double(int x, int y)>& depth_mm) {
  RawDepthMap map{kWidth, kHeight, {}, false};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) map.values.push_back(static_cast<float>(depth_mm(x, y)));
  }
  return map;
}

LayerPixels PixelsOf(const std::function<double(int x, int y)>& depth_mm) {
  LayerPixels pixels;
  pixels.depth = MapOf(depth_mm);
  return pixels;
}

SceneLayer FieldOf(const SceneLayer& layer) {
  SceneLayer field = layer;
  field.plane = {};
  field.depth.emplace();
  field.depth->map_path = "map.pfm";
  return field;
}

LinearImage RandomImage(int width_px, int height_px) {
  RandomDraws draws(3, RandomDraws::Purpose::kTexture, 0);
  LinearImage image{width_px, height_px, 3, {}};
  for (int i = 0; i < 3 * width_px * height_px; ++i) {
    image.values.push_back(static_cast<float>(draws.Uniform()));
  }
  return image;
}

double LargestDifference(const LinearImage& a, const LinearImage& b) {
  EXPECT_EQ(a.values.size(), b.values.size());
  double largest = 0;
  for (std::size_t i = 0; i < std::min(a.values.size(), b.values.size()); ++i) {
    largest = std::max(largest, std::abs(static_cast<double>(a.values[i] - b.values[i])));
  }
  return largest;
}

const EffectSet kLens = {Effect::kDefocus,   Effect::kApertureShape, Effect::kPixelBox,
                         Effect::kOcclusion, Effect::kFalloff,       Effect::kThickness};

// A plane across the axis that is exactly as wide as the image shows it has the image's pixels
// where the map has them.
TEST(HeightFieldSceneTest, LevelMapWithAnImageIsThePlaneWithIt) {
  Camera camera = MacroScene::Camera(kWidth, kHeight, Psf::kDisc);
  camera.sensor.principal_point_px = {(kWidth - 1) / 2.0, (kHeight - 1) / 2.0};
  SceneLayer layer = MacroScene::Uniform(MacroScene::DepthOf(1.2), 0.5);
  layer.texture.kind = TextureKind::kImage;
  layer.texture.feature_size_px = kWidth;
  SceneLayer field = FieldOf(layer);
  field.texture.feature_size_px = 0;
  LayerPixels pixels;
  pixels.texture = RandomImage(kWidth, kHeight);
  const SceneSimulator plane(MacroScene::Options(camera, {layer}, kLens, 200), {pixels});
  pixels.depth = MapOf([&](int, int) { return layer.plane.depth_mm; });
  for (const bool occlusion : {true, false}) {
    const EffectSet on = occlusion ? kLens : kLens.Without({Effect::kOcclusion});
    const SceneSimulator sheet(MacroScene::Options(camera, {field}, on, 200), {pixels});
    EXPECT_LT(LargestDifference(plane.RenderNoiseless(kRun), sheet.RenderNoiseless(kRun)), 1e-4);
    EXPECT_LT(LargestDifference(plane.RenderView({3, -2}, kRun), sheet.RenderView({3, -2}, kRun)),
              1e-4);
  }
  // The image in focus equals the pixels of the image, except for the effect of its mirrored
  // sides.
  for (int i = 0; i < 3 * kWidth * kHeight; ++i) {
    const Eigen::Vector2d at(i / 3 % kWidth, i / 3 / kWidth);
    pixels.texture.values[static_cast<std::size_t>(i)] = static_cast<float>(
        0.5 + 0.4 * std::cos(2 * kPi / 16 * MacroScene::Direction(50 * (i % 3)).dot(at)));
  }
  const LinearImage seen = SceneSimulator(MacroScene::Options(camera, {field}, {}, 16), {pixels})
                               .RenderView({0, 0}, kRun);
  for (int y = 8; y < kHeight - 8; ++y) {
    for (int x = 8; x < kWidth - 8; ++x) {
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(seen.at(x, y, c), pixels.texture.at(x, y, c), 0.02);
      }
    }
  }
}

// 1/z of a plane is linear in the image, bilinear interpolation of it exact. Each ray meets the
// plane in closed form; its light is that of a sine painted on the image.
TEST(HeightFieldSceneTest, SlantedMapShowsTheSineWhereItsPlaneIsMet) {
  const Camera camera = MacroScene::Camera(kWidth, kHeight, Psf::kGaussian);
  const PlaneOptions plane = {MacroScene::DepthOf(0.8), {3, -2}};
  SceneLayer field = FieldOf(MacroScene::Sine(1, 9, 30));
  const LayerPixels pixels =
      PixelsOf([&](int x, int y) { return PlaneDepthMm(camera, plane, x, y); });
  const double scale_px = camera.focal_scale_px(), focus_mm = camera.focus_depth_mm();
  const Eigen::Vector2d wave = 2 * kPi / 9 * MacroScene::Direction(30);
  const auto light = [&](const Eigen::Vector2d& position_px, const Eigen::Vector2d& aperture_mm) {
    // z of the ray A + z t on z0 + g . X, and where its chief ray shows that.
    const Eigen::Vector2d slope =
        (position_px - camera.sensor.principal_point_px) / scale_px - aperture_mm / focus_mm;
    const double z = (plane.depth_mm + plane.slope.dot(aperture_mm)) / (1 - plane.slope.dot(slope));
    const Eigen::Vector2d chief_px =
        camera.sensor.principal_point_px + scale_px / z * (aperture_mm + z * slope);
    return 0.5 + 0.4 * std::cos(wave.dot(chief_px));
  };
  // Away from where rays leave the map, beyond which it is level.
  const auto inside = [](int x, int y) {
    return x >= 9 && x < kWidth - 9 && y >= 9 && y < kHeight - 9;
  };
  const SceneSimulator rays(MacroScene::Options(camera, {field}, {}, 100), {pixels});
  for (const Eigen::Vector2d& aperture_mm : {Eigen::Vector2d(0, 0), Eigen::Vector2d(6, -4)}) {
    const LinearImage view = rays.RenderView(aperture_mm, kRun);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        if (!inside(x, y)) continue;
        EXPECT_NEAR(static_cast<double>(view.at(x, y, 0)),
                    light(Eigen::Vector2d(x, y), aperture_mm), 2e-5);
      }
    }
  }
  // The comparison is repeated with all rays of the photograph, with and without occlusion.
  EffectSet on = {Effect::kDefocus, Effect::kPixelBox, Effect::kOcclusion};
  for (int i = 0; i < 2; ++i, on = on.Without({Effect::kOcclusion})) {
    const LinearImage image =
        SceneSimulator(MacroScene::Options(camera, {field}, on, 300), {pixels})
            .RenderNoiseless(kRun);
    const std::vector<PixelRay> bundle = PhotographRays({Psf::kGaussian, true, 0, 0}, 300);
    for (int y = 0; y < kHeight; y += 3) {
      for (int x = 0; x < kWidth; x += 3) {
        if (!inside(x, y)) continue;
        double sum = 0;
        for (const PixelRay& ray : bundle) {
          sum += light(Eigen::Vector2d(x, y) + ray.offset_px,
                       MacroScene::kRatio * MacroScene::kRadiusMm * ray.aperture);
        }
        EXPECT_NEAR(static_cast<double>(image.at(x, y, 0)), sum / 300, 2e-5) << x << " " << y;
      }
    }
  }
}

// If two surfaces cross, the nearer one is visible, whether they are planes or maps.
TEST(HeightFieldSceneTest, MixesWithPlanes) {
  const Camera camera = MacroScene::Camera(kWidth, kHeight, Psf::kGaussian);
  SceneLayer slanted = MacroScene::Uniform(MacroScene::DepthOf(-1), 0.2);
  slanted.plane.slope = {6, 0};
  const SceneLayer level = MacroScene::Uniform(MacroScene::DepthOf(-1.3), 0.9);
  SceneLayer card = MacroScene::Uniform(MacroScene::DepthOf(1), 0.6);
  card.outline.shape = OutlineOptions::Shape::kDisc;
  card.outline.centre = {20, 17};
  card.outline.radius = 7;
  card.gloss.push_back({320, {20, 17}, 3, 0.3});
  slanted.gloss.push_back({320, {30, 10}, 3, 0.2});
  const LayerPixels map =
      PixelsOf([&](int x, int y) { return PlaneDepthMm(camera, slanted.plane, x, y); });
  for (const bool occlusion : {true, false}) {
    const EffectSet on = occlusion ? kLens : kLens.Without({Effect::kOcclusion});
    const SceneSimulator planes(MacroScene::Options(camera, {slanted, level, card}, on, 400), {});
    const SceneSimulator mixed(
        MacroScene::Options(camera, {FieldOf(slanted), level, card}, on, 400), {map});
    const LinearImage expected = planes.RenderNoiseless(kRun), found = mixed.RenderNoiseless(kRun);
    const LinearImage expected_view = planes.RenderView({5, 4}, kRun);
    const LinearImage found_view = mixed.RenderView({5, 4}, kRun);
    double dark = 1, bright = 0;
    for (int y = 9; y < kHeight - 9; ++y) {
      for (int x = 9; x < kWidth - 9; ++x) {
        // Three rays of 400 on a border, at most.
        EXPECT_NEAR(found.at(x, y, 0), expected.at(x, y, 0), 0.006) << x << ", " << y;
        EXPECT_NEAR(found_view.at(x, y, 0), expected_view.at(x, y, 0), 0.01) << x << ", " << y;
        dark = std::min(dark, static_cast<double>(found.at(x, y, 0)));
        bright = std::max(bright, static_cast<double>(found.at(x, y, 0)));
      }
    }
    EXPECT_LT(dark, 0.25);
    EXPECT_GT(bright, 0.75);
  }
}

// A step of depth whose two sides are painted differently.
LayerPixels StepOf(double left_mm, double right_mm) {
  LayerPixels pixels;
  pixels.depth = MapOf([&](int x, int) { return x < kWidth / 2 ? left_mm : right_mm; });
  pixels.texture = {kWidth, kHeight, 1, {}};
  for (int i = 0; i < kWidth * kHeight; ++i) {
    pixels.texture.values.push_back(i % kWidth < kWidth / 2 ? 0.1F : 0.9F);
  }
  return pixels;
}

// The left side is far and the right side near. Near the middle of the image, rays from the left
// of the aperture meet more of the near side, as for a plane in front, except for the surface that
// is stretched between two pixels.
TEST(HeightFieldSceneTest, NearSideOfAStepHidesTheFarOne) {
  const Camera camera = MacroScene::Camera(kWidth, kHeight, Psf::kGaussian);
  const double near_mm = MacroScene::DepthOf(2), far_mm = MacroScene::DepthOf(-2);
  SceneLayer layer = FieldOf(MacroScene::Uniform(1, 0.5));
  layer.texture.kind = TextureKind::kImage;
  const SceneSimulator sheet(MacroScene::Options(camera, {layer}, kLens, 100),
                             {StepOf(far_mm, near_mm)});
  // One sigma of the aperture moves the near side by 2 px, the far side by -2.
  const double sigma_mm = MacroScene::kRatio * MacroScene::kRadiusMm;
  const LinearImage left = sheet.RenderView({-2 * sigma_mm, 0}, kRun);
  const LinearImage right = sheet.RenderView({2 * sigma_mm, 0}, kRun);
  const double edge = (kWidth - 1) / 2.0;
  for (int x = 8; x < kWidth - 8; ++x) {
    // x = x' - A V: the near side begins at edge + 4 as seen from the left, and at edge - 4 from
    // the right, where it hides the far one, which would end at edge + 4.
    if (x > edge + 4.6) {
      EXPECT_GT(left.at(x, 18, 0), 0.8F) << x;
    }
    if (x < edge - 4.6) {
      EXPECT_LT(left.at(x, 18, 0), 0.2F) << x;
    }
    if (x > edge - 3.4) {
      EXPECT_GT(right.at(x, 18, 0), 0.8F) << x;
    }
    if (x < edge - 4.6) {
      EXPECT_LT(right.at(x, 18, 0), 0.2F) << x;
    }
  }
}

TEST(HeightFieldSceneTest, DepthIsTheMap) {
  const Camera camera = MacroScene::Camera(kWidth, kHeight, Psf::kGaussian);
  RandomDraws draws(4, RandomDraws::Purpose::kTexture, 0);
  LayerPixels pixels =
      PixelsOf([&](int, int) { return MacroScene::DepthOf(4 * draws.Uniform() - 2); });
  SceneLayer layer = FieldOf(MacroScene::Uniform(1, 0.5));
  EXPECT_EQ(SceneSimulator(MacroScene::Options(camera, {layer}, kLens, 16), {pixels})
                .RenderDepth()
                .values,
            pixels.depth.values);
  // The depth is in cm along the chief ray.
  RawDepthMap range = pixels.depth;
  for (int i = 0; i < kWidth * kHeight; ++i) {
    const Eigen::Vector2d slope =
        (Eigen::Vector2d(i % kWidth, i / kWidth) - camera.sensor.principal_point_px) /
        camera.focal_scale_px();
    auto& value = range.values[static_cast<std::size_t>(i)];
    value =
        static_cast<float>(0.1 * static_cast<double>(value) * std::sqrt(1 + slope.squaredNorm()));
  }
  std::swap(range, pixels.depth);
  layer.depth->convention.kind = DepthKind::kRange;
  layer.depth->convention.unit_mm = 10;
  const RawDepthMap found =
      SceneSimulator(MacroScene::Options(camera, {layer}, kLens, 16), {pixels}).RenderDepth();
  for (std::size_t i = 0; i < found.values.size(); ++i) {
    EXPECT_NEAR(found.values[i], range.values[i], 3e-7F * range.values[i]);
  }
}

// Smooth and rough maps, with steps and without.
SceneSimulationOptions RandomField(unsigned seed, LayerPixels* pixels) {
  RandomDraws draws(seed, RandomDraws::Purpose::kTexture, 9);
  Camera camera = MacroScene::Camera(24, 20, seed % 2 == 0 ? Psf::kGaussian : Psf::kDisc);
  camera.calibration->blur_floor_px->value = 0.4 * draws.Uniform();
  const double waves = 0.3 * draws.Uniform(), height = 2 * std::pow(draws.Uniform(), 3);
  const double step = seed % 3 == 0 ? 2 * draws.Uniform() : 0;
  const double noise = seed % 4 == 0 ? 0.3 * draws.Uniform() : 0;
  const double level = 2 * draws.Uniform() - 1;
  pixels->depth = {24, 20, {}, false};
  for (int i = 0; i < 24 * 20; ++i) {
    const double defocus_px = level + height * std::sin(waves * (i % 24)) +
                              (i % 24 < 12 ? 0 : step) + noise * draws.Uniform();
    pixels->depth.values.push_back(static_cast<float>(MacroScene::DepthOf(defocus_px)));
  }
  SceneLayer layer = FieldOf(MacroScene::Uniform(1, 0.5));
  const TextureKind kinds[] = {TextureKind::kSine, TextureKind::kDeadLeaves, TextureKind::kNoise,
                               TextureKind::kImage};
  layer.texture.kind = kinds[seed % 4];
  layer.texture.contrast = draws.Uniform();
  if (layer.texture.kind == TextureKind::kImage) pixels->texture = RandomImage(12, 10);
  std::vector<SceneLayer> layers = {layer};
  if (seed % 2 == 1) {
    // Before the map, or through it.
    SceneLayer card = MacroScene::Uniform(MacroScene::DepthOf(3 * draws.Uniform() - 1), 0.7);
    card.outline.shape = OutlineOptions::Shape::kDisc;
    card.outline.centre = {24 * draws.Uniform(), 20 * draws.Uniform()};
    card.outline.radius = 2 + 4 * draws.Uniform();
    card.plane.slope = {4 * draws.Uniform() - 2, 0};
    layers.push_back(card);
  }
  SceneSimulationOptions options = MacroScene::Options(camera, layers, {}, 600);
  options.seed = seed;
  return options;
}

TEST(HeightFieldSceneTest, WhatAutoLeavesOutIsWithinTheTolerance) {
  int left_out = 0, without_occlusion = 0;
  for (unsigned seed = 1; seed <= 12; ++seed) {
    SCOPED_TRACE(seed);
    LayerPixels pixels;
    SceneSimulationOptions options = RandomField(seed, &pixels);
    options.effects.base = EffectSelectionOptions::Base::kAll;
    const SceneSimulator all(options, {pixels});
    options.effects.base = EffectSelectionOptions::Base::kAuto;
    const SceneSimulator some(options, {pixels});
    const EffectSet left = ImageEffects().Without(some.effects().on);
    left_out += static_cast<int>(left.Effects().size());
    without_occlusion += left.Has(Effect::kOcclusion);
    EXPECT_LT(255 * LargestDifference(all.RenderNoiseless(kRun), some.RenderNoiseless(kRun)),
              0.5 + 0.15)
        << JoinedNames(left);
    // Each effect alone changes no more than its bound, except for the sampling error of 600 rays.
    if (seed > 6) continue;
    for (const LargestEffectImpact& finding : all.effects().findings) {
      if (FactsOf(finding.effect).random || finding.effect == Effect::kQuantisation) continue;
      SceneSimulationOptions fewer = options;
      fewer.effects.base = EffectSelectionOptions::Base::kAll;
      fewer.effects.without = {finding.effect};
      const double change =
          255 * LargestDifference(all.RenderNoiseless(kRun),
                                  SceneSimulator(fewer, {pixels}).RenderNoiseless(kRun));
      EXPECT_LE(change, finding.impact.grey_levels + 0.5) << FactsOf(finding.effect).name;
    }
  }
  EXPECT_GT(left_out, 12);
  EXPECT_GT(without_occlusion, 0);
  EXPECT_LT(without_occlusion, 9);
}

// The error of the set of rays that blocks request is not larger than stated.
TEST(HeightFieldSceneTest, SamplingErrorIsAsStated) {
  for (const unsigned seed : {3U, 4U, 5U, 9U}) {
    LayerPixels pixels;
    SceneSimulationOptions options = RandomField(seed, &pixels);
    options.effects.base = EffectSelectionOptions::Base::kAll;
    options.sampling_error_grey_levels = 0.2;
    options.rays_per_pixel = 600;
    const SceneSimulator simulator(options, {pixels});
    SceneSimulationOptions many = options;
    many.sampling_error_grey_levels = 0;
    many.rays_per_pixel = 6000;
    const LinearImage few = simulator.RenderNoiseless(kRun);
    const LinearImage truth = SceneSimulator(many, {pixels}).RenderNoiseless(kRun);
    double square = 0;
    for (std::size_t i = 0; i < few.values.size(); ++i) {
      square += std::pow(255 * static_cast<double>(few.values[i] - truth.values[i]), 2);
    }
    EXPECT_LT(std::sqrt(square / static_cast<double>(few.values.size())),
              1.5 * simulator.sampling_error_grey_levels());
  }
}

TEST(HeightFieldSceneTest, WrongInputIsReported) {
  const Camera camera = MacroScene::Camera(kWidth, kHeight, Psf::kGaussian);
  const LayerPixels good = PixelsOf([](int, int) { return 301.0; });
  const auto message = [&](const std::function<void(SceneLayer*, LayerPixels*)>& change) {
    SceneLayer layer = FieldOf(MacroScene::Uniform(1, 0.5));
    layer.name = "hill";
    LayerPixels pixels = good;
    change(&layer, &pixels);
    return ErrorOf(
        [&] { SceneSimulator(MacroScene::Options(camera, {layer}, kLens, 16), {pixels}); });
  };
  using Layer = SceneLayer;
  using Pixels = LayerPixels;
  EXPECT_EQ(message([](Layer*, Pixels*) {}), "(no error)");
  EXPECT_EQ(message([](Layer*, Pixels* p) { p->depth = {}; }),
            "layers[0] 'hill': depth.map 'map.pfm' is empty");
  EXPECT_THAT(
      message([](Layer*, Pixels* p) { p->depth.width_px = kHeight, p->depth.height_px = kWidth; }),
      HasSubstr("layers[0] 'hill': depth.map 'map.pfm': it has 36x48 px, but the image has 48x36"));
  EXPECT_EQ(
      message([](Layer*, Pixels* p) { p->depth.values[7] = p->depth.values[70] = NAN; }),
      "layers[0] 'hill': depth.map 'map.pfm': 2 of its 1728 values are holes: a surface needs "
      "a depth everywhere");
  EXPECT_THAT(message([](Layer*, Pixels* p) { p->depth.values[7] = 49; }),
              HasSubstr("beyond the camera's front focal point"));
  EXPECT_THAT(message([](Layer*, Pixels* p) { p->depth.values[7] = -3; }),
              HasSubstr("(7, 0) is -3"));
  EXPECT_THAT(message([](Layer* l, Pixels*) { l->depth->convention.kind = DepthKind::kDisparity; }),
              HasSubstr("depth.kind is disparity: it must be z or range"));
  EXPECT_THAT(message([](Layer* l, Pixels*) {
                l->outline.shape = OutlineOptions::Shape::kDisc;
                l->outline.radius = 3;
              }),
              HasSubstr("outline: it is given for a layer with a depth map"));
}

}  // namespace
}  // namespace thicklens::model
