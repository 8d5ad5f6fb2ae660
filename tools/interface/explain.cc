#include "thicklens/explain.h"

#include <fmt/format.h>

#include <string>
#include <utility>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/model/depth_places.h"
#include "tools/interface/depth_causes.h"
#include "tools/interface/depth_reports.h"
#include "tools/interface/effects_choice.h"
#include "tools/interface/run_scope.h"
#include "tools/interface/validation.h"

namespace thicklens {
namespace {

// The known part of what is photographed.
struct ExplainedScene {
  DepthRange range;
  std::vector<model::EffectSite> places;
};

ExplainedScene SceneOfMap(const DepthMap& depth, const Camera& camera, RunScope* run) {
  const std::string name = depth.source.empty() ? "depth" : depth.source;
  const model::Sensor& sensor = camera.sensor;
  if (depth.width_px != sensor.width_px || depth.height_px != sensor.height_px) {
    throw Error(fmt::format(
        "{}: it is {}x{} px, but the camera's sensor has {}x{} px: the sizes must be equal", name,
        depth.width_px, depth.height_px, sensor.width_px, sensor.height_px));
  }
  model::DepthConvention convention;
  convention.kind = depth.meaning.kind;
  if (depth.meaning.unit != LengthUnit::kNone)
    convention.unit_mm = model::DepthUnitMm(LengthUnitName(depth.meaning.unit));
  convention.inverse_scale_dpt = depth.meaning.inverse_scale_dpt;
  convention.inverse_offset_dpt = depth.meaning.inverse_offset_dpt;
  ReportReading(depth, run);
  const model::RawDepthMap map = MarkedMap(depth, run);
  model::LinearImage empty{map.width_px, map.height_px, 1, {}};
  empty.values.assign(map.values.size(), 0.0F);
  const model::Scene scene = NamingCauseInMap(depth, *run, [&] {
    return model::MakeScene(camera, std::move(empty), map, convention, name);
  });
  return {{scene.depth.min_mm, scene.depth.max_mm}, model::PlacesOfDepth(camera, scene)};
}

ExplainedScene SceneOf(const ExplainOptions& options, const Camera& camera, RunScope* run) {
  if (options.depth) return SceneOfMap(*options.depth, camera, run);
  const DepthRange range = *options.depth_range;
  return {range,
          model::PlacesBetween(camera, range.near_mm, range.far_mm, !options.bench.has_value())};
}

model::EffectSelection EffectsOf(const ExplainOptions& options, const Camera& camera,
                                 const std::vector<model::EffectSite>& places) {
  model::EffectConditions conditions;
  conditions.camera = camera;
  conditions.bits = options.bits;
  conditions.full_well_electrons = options.full_well_electrons;
  conditions.read_noise_electrons = options.read_noise_electrons;
  conditions.bench = options.bench;
  if (options.uv_depth_mm) {
    conditions.planes = {*options.uv_depth_mm, camera.focus_depth_mm() - *options.uv_depth_mm};
  }
  model::EffectSelectionOptions choice = ChoiceOf(options.effects);
  // A simulated image always has these effects.
  choice.kept = {Effect::kQuantisation, Effect::kTransferCurve};
  return model::SelectEffects(choice, conditions, places, EffectSet::All());
}

model::EffectCosts CostsOf(const ExplainOptions& options, const Camera& camera,
                           const DepthRange& range, const model::EffectSelection& effects,
                           const RunScope& run) {
  model::SceneSimulationOptions sensor;
  sensor.full_well_electrons = options.full_well_electrons;
  sensor.read_noise_electrons = options.read_noise_electrons;
  sensor.bits = options.bits <= 8 ? 8 : 16;  // what simulations store; the time is the same
  try {
    return model::MeasureEffectCosts(camera, range, sensor, effects,
                                     run.ProgressOf("measuring costs"));
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {
    throw Error(fmt::format("{}: an image of depths from {:g} to {:g} mm cannot be simulated: {}",
                            run.Option("measure_costs"), range.near_mm, range.far_mm,
                            error.what()));
  }
}

}  // namespace

CameraExplanation ExplainCamera(const Camera& camera, ExplainOptions options,
                                const RunControl& control) {
  checks::RequireValid(control);
  checks::RequireValid(options);
  checks::RequireValidCamera(camera);
  RunScope run(control);
  for (const std::string& notice : NoticesOf(camera)) run.Warn(notice);
  const ExplainedScene scene = SceneOf(options, camera, &run);
  CameraExplanation explanation;
  explanation.depth_range = scene.range;
  explanation.camera = model::ExplainCamera(camera, scene.range, options.depth_count);
  explanation.effects = EffectsOf(options, camera, scene.places);
  if (options.measure_costs) {
    explanation.costs = CostsOf(options, camera, scene.range, explanation.effects, run);
  }
  return explanation;
}

}  // namespace thicklens
