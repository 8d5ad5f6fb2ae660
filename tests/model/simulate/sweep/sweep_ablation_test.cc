// The ablation of a sweep, with a calibration that only records what it is given.
#include "thicklens/model/sweep_ablation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>
#include <vector>

#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;

SweepSimulationOptions SmallSweep() {
  SweepSimulationOptions options =
      ReadSweepSimulation(THICKLENS_SOURCE_DIR "/configs/sweeps/case-iii.yaml");
  options.camera.sensor.width_px = options.camera.sensor.height_px = 64;
  options.camera.sensor.principal_point_px.setConstant(31.5);
  options.frame_count = 3;
  options.effects.base = EffectSelectionOptions::Base::kGiven;
  options.effects.given = {Effect::kDefocus, Effect::kFalloff, Effect::kLensFloor};
  return options;
}

TEST(AblateSweep, SimulatesWithAndWithoutEachEffect) {
  const SweepSimulationOptions options = SmallSweep();
  std::vector<EffectSet> simulated;
  const auto calibrate = [&](const SweepToCalibrate& sweep) -> SweepCalibration {
    sweep.tell();
    simulated.push_back(sweep.simulator.effects().on);
    EXPECT_EQ(sweep.stored_frame(2).values, sweep.simulator.RenderFrame(2).values);
    if (!simulated.back().Has(Effect::kDefocus)) return {std::nullopt, "no defocus"};
    return {CalibratedValues{60, 0.1, 0.5, 0.01}, ""};
  };
  const SweepAblation ablation = AblateSweep(options, {}, calibrate, {1, {}});
  EXPECT_EQ(ablation.frames, 3);
  EXPECT_EQ(ablation.calibration.image_distance_mm, 60);
  ASSERT_EQ(ablation.effects.size(), 3U);
  ASSERT_FALSE(simulated.empty());
  EXPECT_EQ(simulated[0], ablation.on);
  for (const AblatedSweepEffect& row : ablation.effects) {
    SCOPED_TRACE(EffectName(row.effect));
    EXPECT_EQ(row.calibration.has_value(), row.effect != Effect::kDefocus);
    EXPECT_EQ(row.refusal, row.effect == Effect::kDefocus ? "no defocus" : "");
  }
}

TEST(AblateSweep, NeedsACalibrationOfAllEffects) {
  const auto refuse = [](const SweepToCalibrate&) -> SweepCalibration {
    return {std::nullopt, "too dark"};
  };
  try {
    AblateSweep(SmallSweep(), {}, refuse, {1, {}});
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("no calibration to compare with: too dark"));
  }
}

}  // namespace
}  // namespace thicklens::model
