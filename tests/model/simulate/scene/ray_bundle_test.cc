#include "model/simulate/scene/ray_bundle.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "model/base/random_draws.h"
#include "model/simulate/scene/scene_geometry.h"
#include "model/simulate/scene/scene_texture.h"
#include "support/test_cameras.h"

namespace thicklens::model {
namespace {

using thicklens::testing::TestCamera;
using thicklens::testing::TestSensor;
using thicklens::testing::ThickMacroLens;

// A macro lens focused at 300 mm, and three planes: a tilted one behind, a tilted rectangle whose
// outline is in px, and a disc whose outline is in mm; those two cross.
SceneSimulationOptions ThreePlanes() {
  SceneSimulationOptions options;
  options.camera = TestCamera("", ThickMacroLens(9), TestSensor(640, 480, 0.0045, {320.3, 239.1}),
                              {4 + 52 * 300.0 / 250, 0});
  options.layers.resize(3);
  options.layers[0].plane = {306, {0.3, -0.2}};
  options.layers[1].plane = {300, {-0.4, 0.1}};
  options.layers[1].outline.shape = OutlineOptions::Shape::kRectangle;
  options.layers[1].outline.centre = {300, 220};
  options.layers[1].outline.size = {200, 160};
  options.layers[2].plane = {299, {0, 0}};
  options.layers[2].outline.shape = OutlineOptions::Shape::kDisc;
  options.layers[2].outline.unit = OutlineOptions::Unit::kMm;
  options.layers[2].outline.centre = {1.1, -0.3};
  options.layers[2].outline.radius = 1.4;
  return options;
}

class RayBundleTest : public ::testing::Test {
 protected:
  static constexpr int kRays = kRaysAtOnce + 7;

  RayBundleTest() {
    RandomDraws draws(5, RandomDraws::Purpose::kTexture, 0);
    std::vector<SceneRay> from_chief;
    for (int i = 0; i < kRays; ++i) {
      apertures_mm_.emplace_back(4 * draws.Normal(), 4 * draws.Normal());
      offsets_px_.emplace_back(draws.Normal(), draws.Normal());
      from_chief.push_back(geometry_.RayAt(
          options_.camera.sensor.principal_point_px + offsets_px_.back(), apertures_mm_.back()));
    }
    bundle_.emplace_back(geometry_, from_chief);
    for (int i = 0; i < 400; ++i) {
      centres_px_.emplace_back(std::floor(640 * draws.Uniform()),
                               std::floor(480 * draws.Uniform()));
    }
  }

  // The ray of the bundle, computed without the bundle.
  SceneRay RayOf(const Eigen::Vector2d& centre_px, std::size_t ray) const {
    return geometry_.RayAt(centre_px + offsets_px_[ray], apertures_mm_[ray]);
  }
  std::vector<ChiefHit> ChiefsOf(const Eigen::Vector2d& centre_px) const {
    std::vector<ChiefHit> chiefs;
    for (const std::size_t layer : layers_) chiefs.push_back(bundle().ChiefAt(centre_px, layer));
    return chiefs;
  }
  const RayBundle& bundle() const { return bundle_.front(); }

  const SceneSimulationOptions options_ = ThreePlanes();
  const SceneGeometry geometry_{options_};
  const std::vector<std::size_t> layers_ = {2, 0, 1};
  const std::vector<RayPart> parts_ = {{0, kRaysAtOnce}, {kRaysAtOnce, kRays - kRaysAtOnce}};
  std::vector<Eigen::Vector2d> apertures_mm_, offsets_px_, centres_px_;
  std::vector<RayBundle> bundle_;
};

TEST_F(RayBundleTest, MeetsPlanesWhereEachRayDoes) {
  for (const Eigen::Vector2d& centre_px : centres_px_) {
    const std::vector<ChiefHit> chiefs = ChiefsOf(centre_px);
    for (const RayPart& part : parts_) {
      for (std::size_t k = 0; k < layers_.size(); ++k) {
        const RayBundle::Meeting meeting = bundle().Meet(layers_[k], chiefs[k], part);
        for (Eigen::Index i = 0; i < part.count; ++i) {
          const SceneRay ray = RayOf(centre_px, static_cast<std::size_t>(part.first + i));
          const double depth_mm = HitDepthMm(options_.layers[layers_[k]].plane, ray);
          const Eigen::Vector2d at_mm = ray.PositionMm(depth_mm);
          // A px is 0.02 mm there.
          EXPECT_NEAR(chiefs[k].depth_mm + static_cast<double>(meeting.beyond_mm(i)), depth_mm,
                      2e-6);
          EXPECT_NEAR(chiefs[k].on_texture.x() + static_cast<double>(meeting.x(i)), at_mm.x(),
                      2e-6);
          EXPECT_NEAR(chiefs[k].on_texture.y() + static_cast<double>(meeting.y(i)), at_mm.y(),
                      2e-6);
        }
      }
    }
  }
}

TEST_F(RayBundleTest, ShowsWhatEachRayAndTheMiddleOfTheApertureShow) {
  int rays = 0, unlike = 0, others = 0;
  std::vector<int> seen(3, 0);
  for (const Eigen::Vector2d& centre_px : centres_px_) {
    const std::vector<ChiefHit> chiefs = ChiefsOf(centre_px);
    for (const RayPart& part : parts_) {
      const RayBundle::Shown along = bundle().NearestAlong(centre_px, layers_, chiefs, part);
      const std::size_t surface = 1;  // layer 0
      const RayBundle::Shown from_middle =
          bundle().NearestFromMiddle(centre_px, layers_, chiefs, surface, part);
      for (Eigen::Index i = 0; i < part.count; ++i) {
        const auto index = static_cast<std::size_t>(i);
        const SceneRay ray = RayOf(centre_px, static_cast<std::size_t>(part.first + i));
        const std::size_t expected = geometry_.Trace(ray).layer;
        const double depth_mm = HitDepthMm(options_.layers[0].plane, ray);
        const Eigen::Vector2d point_px =
            geometry_.ChiefPositionPx(ray.PositionMm(depth_mm), depth_mm);
        const std::size_t by_middle = geometry_.Trace(geometry_.RayAt(point_px, {0, 0})).layer;
        ++rays;
        ++seen[expected];
        unlike += layers_[along[index]] != expected;
        unlike += layers_[from_middle[index]] != by_middle;
        others += expected != by_middle;
      }
    }
  }
  // A ray within 1e-4 px of an edge may be on either side.
  EXPECT_LE(unlike, rays / 5000);
  EXPECT_GT(others, rays / 200);
  EXPECT_GT(*std::min_element(seen.begin(), seen.end()), rays / 50);
}

TEST(SceneTextureSum, IsThatOfItsPlaces) {
  TextureRequest request;
  request.pixel_mm = request.coarsest_pixel_mm = 0.02;
  request.low_mm = {-0.8, -0.5};
  request.high_mm = {0.8, 0.5};
  const LinearImage none;
  for (const TextureKind kind :
       {TextureKind::kUniform, TextureKind::kSine, TextureKind::kDeadLeaves}) {
    TextureOptions options;
    options.kind = kind;
    RandomDraws draws(3, RandomDraws::Purpose::kTexture, 0);
    const SceneTexture texture(options, request, none, &draws);
    // Inside the tile, over its borders, and periods away from it.
    for (const Eigen::Vector2d& centre_mm :
         {Eigen::Vector2d(0.1, -0.1), Eigen::Vector2d(-0.8, -0.1), Eigen::Vector2d(0.8, 0.5),
          Eigen::Vector2d(0, -0.5), Eigen::Vector2d(-7.3, 11.2)}) {
      constexpr int kCount = SceneTexture::kMaxAtOnce;
      std::vector<float> x, y, weight;
      Eigen::Array4d expected(0, 0, 0, 0);
      for (int i = 0; i < kCount; ++i) {
        x.push_back(static_cast<float>(0.05 * draws.Normal()));
        y.push_back(static_cast<float>(0.05 * draws.Normal()));
        weight.push_back(static_cast<float>(draws.Uniform()));
        expected += static_cast<double>(weight.back()) *
                    texture
                        .At(centre_mm.x() + static_cast<double>(x.back()),
                            centre_mm.y() + static_cast<double>(y.back()))
                        .cast<double>();
      }
      const Eigen::Array4f sum =
          texture.SumAround(centre_mm, x.data(), y.data(), weight.data(), kCount);
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(static_cast<double>(sum(c)), expected(c), 1e-5 * expected(c));
      }
    }
  }
}

}  // namespace
}  // namespace thicklens::model
