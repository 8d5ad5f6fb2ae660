#include "thicklens/model/effect_costs.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <ctime>

#include "thicklens/model/light_field.h"

namespace thicklens::model {
namespace {

constexpr int kPatchWidthPx = 96, kPatchHeightPx = 64;
constexpr int kRounds = 5;
constexpr double kFarthestMm = 1e6;
// A share of the image's time; smaller costs are lost in the differences between runs.
constexpr double kMeasurable = 0.05;

SceneLayer Leaves(double depth_mm) {
  SceneLayer layer;
  layer.plane.depth_mm = depth_mm;
  layer.texture.kind = TextureKind::kDeadLeaves;
  return layer;
}

SceneSimulationOptions PatchOf(const Camera& camera, const DepthRange& range,
                               const SceneSimulationOptions& sensor) {
  SceneSimulationOptions patch = sensor;
  const Sensor& whole = camera.sensor;
  const int width_px = std::min(kPatchWidthPx, whole.width_px);
  const int height_px = std::min(kPatchHeightPx, whole.height_px);
  patch.camera = CropCamera(camera, {(whole.width_px - width_px) / 2,
                                     (whole.height_px - height_px) / 2, width_px, height_px});
  SceneLayer card = Leaves(range.near_mm);
  card.outline.shape = OutlineOptions::Shape::kRectangle;
  card.outline.centre = {0, height_px / 2.0};
  card.outline.size = {static_cast<double>(width_px), 4.0 * height_px};
  patch.layers = {Leaves(std::min(range.far_mm, kFarthestMm)), card};
  patch.effects = {};
  patch.effects.base = EffectSelectionOptions::Base::kGiven;
  return patch;
}

// Processor time, which is more reliable than wall time if other programs run.
double SecondsOf(const SceneSimulationOptions& patch) {
  const std::clock_t start = std::clock();
  const SceneSimulator simulator(patch, {}, 1);
  simulator.Store(simulator.RenderNoiseless({1, {}}));
  return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
}

double Median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

}  // namespace

EffectCosts MeasureEffectCosts(const Camera& camera, const DepthRange& range,
                               const SceneSimulationOptions& sensor,
                               const EffectSelection& decision,
                               const std::function<void(int done, int total)>& tell) {
  SceneSimulationOptions patch = PatchOf(camera, range, sensor);
  const EffectSet known = decision.on.Both(ImageEffects());
  EffectCosts costs;
  std::vector<Effect> effects;
  for (const LargestEffectImpact& finding : decision.findings) {
    if (!ImageEffects().Has(finding.effect)) continue;
    if (finding.impact.amount == 0 && finding.impact.grey_levels == 0) {
      costs.of_effect.emplace_back(finding.effect, 0);
    } else {
      effects.push_back(finding.effect);
    }
  }
  // First the run with the effects that are on, then a run with each effect switched.
  std::vector<std::vector<double>> seconds(effects.size() + 1);
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t i = 0; i <= effects.size(); ++i) {
      tell(round * static_cast<int>(seconds.size()) + static_cast<int>(i),
           kRounds * static_cast<int>(seconds.size()));
      patch.effects.given = known;
      if (i > 0 && known.Has(effects[i - 1])) patch.effects.given.Remove(effects[i - 1]);
      if (i > 0 && !known.Has(effects[i - 1])) patch.effects.given.Add(effects[i - 1]);
      seconds[i].push_back(SecondsOf(patch));
    }
  }
  const Sensor& part = patch.camera.sensor;
  const double patches = static_cast<double>(camera.sensor.width_px) * camera.sensor.height_px /
                         (static_cast<double>(part.width_px) * part.height_px);
  const double as_is = Median(seconds[0]);
  costs.seconds = patches * as_is;
  for (std::size_t i = 0; i < effects.size(); ++i) {
    const double longer = Median(seconds[i + 1]) - as_is;
    const double cost = known.Has(effects[i]) ? -longer : longer;
    costs.of_effect.emplace_back(effects[i],
                                 std::abs(cost) > kMeasurable * as_is ? patches * cost : 0);
  }
  return costs;
}

}  // namespace thicklens::model
