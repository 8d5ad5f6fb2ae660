// The ablation of a scene, with an estimate that only records what it is given.
#include "thicklens/model/scene_ablation.h"

#include <gtest/gtest.h>

#include <vector>

#include "support/macro_scene.h"
#include "thicklens/model/encoded_values.h"

namespace thicklens::model {
namespace {

using thicklens::testing::MacroScene;

SceneSimulationOptions SineOutOfFocus() {
  const Camera camera = MacroScene::Camera(24, 20, Psf::kGaussian);
  SceneSimulationOptions options =
      MacroScene::Options(camera, {MacroScene::Sine(MacroScene::DepthOf(2), 9, 30)},
                          {Effect::kDefocus, Effect::kFalloff, Effect::kPixelBox}, 64);
  options.u_count = options.v_count = 3;
  return options;
}

TEST(AblateScene, SimulatesWithAndWithoutEachEffect) {
  const SceneSimulationOptions options = SineOutOfFocus();
  std::vector<EffectSet> modelled;
  std::vector<EncodedImage> photographs;
  const auto estimate = [&](const SceneToEstimate& scene) {
    EXPECT_EQ(scene.truth.u_count, 3);
    EXPECT_EQ(scene.truth.s_count, 24);
    EXPECT_EQ(scene.depth.width_px, 24);
    scene.tell();
    modelled.push_back(scene.on);
    photographs.push_back(scene.photograph);
    return 30.0 + static_cast<double>(modelled.size());
  };
  int told = 0, most = 0;
  const AblationRun run{1, [&](int done, int total) {
                          EXPECT_LE(done, total);
                          most = total;
                          ++told;
                        }};
  const SceneAblation ablation = AblateScene(options, {{}}, estimate, run);
  EXPECT_GT(told, 0);
  EXPECT_EQ(most, static_cast<int>(ablation.on.Effects().size()) + 1);
  EXPECT_EQ(ablation.light_field_psnr_db, 31);
  ASSERT_EQ(ablation.effects.size(), ablation.on.Effects().size());
  ASSERT_FALSE(modelled.empty());
  EXPECT_EQ(modelled[0], ablation.on);
  EXPECT_EQ(photographs[0].values, ablation.image.values);

  // The change is that between two simulations.
  const SceneSimulator with(options, {{}}, 1);
  for (const AblatedSceneEffect& row : ablation.effects) {
    SCOPED_TRACE(EffectName(row.effect));
    SceneSimulationOptions fewer = options;
    fewer.effects.without.Add(row.effect);
    const SceneSimulator without(fewer, {{}}, 1);
    ImageChangeAccumulator meter;
    meter.Add(EncodedValuesOf(with.RenderNoiseless({1, {}}), with.camera().sensor.transfer),
              EncodedValuesOf(without.RenderNoiseless({1, {}}), without.camera().sensor.transfer));
    EXPECT_EQ(row.image.rms_grey_levels, meter.Result().rms_grey_levels);
    EXPECT_EQ(row.absent, meter.Result().nothing());
    if (row.effect == Effect::kDefocus) {
      EXPECT_GT(row.image.rms_grey_levels, 1);
      EXPECT_TRUE(row.ignored_db);
    }
  }
}

TEST(AblateScene, StopsWhereTheEstimateThrows) {
  struct Stopped {};
  const auto estimate = [](const SceneToEstimate&) -> double { throw Stopped(); };
  EXPECT_THROW(AblateScene(SineOutOfFocus(), {{}}, estimate, {1, {}}), Stopped);
}

}  // namespace
}  // namespace thicklens::model
