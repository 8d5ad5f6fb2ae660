#include <algorithm>
#include <optional>
#include <utility>

#include "thicklens/base/memory_available.h"
#include "thicklens/base/stopwatch.h"
#include "thicklens/estimator/estimate_input.h"
#include "thicklens/estimator/scene_solver.h"
#include "thicklens/model/light_field_grid.h"
#include "tools/report/attribution.h"

namespace thicklens::tools {
namespace {

using model::Effect;
using model::EffectSet;

// A step of the run, which long computations keep telling.
struct Step {
  const AttributionRun& run;
  int done = 0, total = 1;

  void Tell() const {
    if (run.progress) run.progress(done, total);
  }
  model::SceneRun OfSimulator() const {
    return {run.threads, [this](int, int) { Tell(); }};
  }
};

// One simulation of the scene.
class SceneWorld {
 public:
  SceneWorld(const model::SceneSimulationOptions& options,
             const std::vector<model::LayerPixels>& pixels, const Step& step)
      : start_(Clock::now()),
        simulator_(options, pixels, step.run.threads),
        noiseless_(simulator_.RenderNoiseless(step.OfSimulator())),
        stored_(simulator_.Store(noiseless_)),
        seconds_(SecondsSince(start_)) {}

  const model::SceneSimulator& simulator() const { return simulator_; }
  const model::StoredPicture& stored() const { return stored_; }
  double seconds() const { return seconds_; }
  estimator::StoredValues Values(bool with_noise) const {
    return with_noise ? estimator::StoredValuesOf(stored_)
                      : estimator::StoredValuesOf(noiseless_, simulator_.camera().sensor.transfer);
  }

 private:
  Clock::time_point start_;
  model::SceneSimulator simulator_;
  model::LinearPicture noiseless_;
  model::StoredPicture stored_;
  double seconds_;
};

// What an estimate starts from, and the true views at its grid's places.
struct EstimateOf {
  const model::StoredPicture& photograph;
  model::Camera camera;
  const model::LightField& truth;
  EffectSet on;  // as the estimate models them
};

// Mean PSNR over the views.
double EstimatedPsnrDb(const EstimateOf& what, const model::RawDepthMap& depth, const Step& step) {
  estimator::EstimateInput input;
  const int u_count = what.truth.u_count, v_count = what.truth.v_count;
  input.camera = what.camera;
  input.transfer = what.camera.sensor.transfer;
  input.picture = model::ToLinear(what.photograph, input.transfer);
  input.grid = model::DefaultGrid(what.camera, u_count, v_count);
  input.weights = model::ApertureWeights(model::ApertureShapeOf(what.camera.psf), u_count, v_count);
  input.disparity =
      estimator::DisparityOnGrid(*input.grid, depth.values, depth.width_px, depth.height_px);
  if (!what.on.Has(Effect::kThickness)) input.falloff_camera = model::ThinTwin(what.camera);
  const bool falloff = what.on.Has(Effect::kFalloff);
  model::LightField estimate;
  if (what.on.Has(Effect::kDefocus)) {
    estimator::SceneOptions options;
    options.falloff = falloff;
    options.threads = step.run.threads;
    options.memory_limit_mib = UsualMemoryLimitMib();
    options.progress = [&step](int, int) { step.Tell(); };
    estimator::SceneSummary summary;
    estimate = estimator::EstimateScene(input, options, &summary, nullptr);
  } else {
    estimate = estimator::WarpedLightField(input, falloff, step.run.threads);
  }
  return estimator::CompareLightFields(what.truth, estimate, 0, std::nullopt, step.run.threads)
      .mean.psnr_db;
}

class SceneAttributor {
 public:
  SceneAttributor(const model::SceneSimulationOptions& scene,
                  const std::vector<model::LayerPixels>& pixels, const AttributionRun& run)
      : scene_(scene), pixels_(pixels), step_{run} {}

  SceneAttribution Run() {
    model::SceneSimulationOptions by_auto = scene_;
    by_auto.effects.base = model::EffectChoice::Base::kAuto;
    const EffectSet kept = model::SceneSimulator(by_auto, pixels_, step_.run.threads).effects().on;

    scene_.effects = AllInsteadOfAuto(scene_.effects);
    base_.emplace(scene_, pixels_, step_);
    const model::SceneSimulator& simulator = base_->simulator();
    depth_ = simulator.RenderDepth();
    truth_ = TrueViews(simulator);
    result_.on = simulator.effects().on;
    step_.total = static_cast<int>(result_.on.Effects().size()) + 1;
    result_.u_count = scene_.u_count;
    result_.v_count = scene_.v_count;
    result_.picture = base_->stored();
    result_.picture_seconds = base_->seconds();
    result_.sampling_error_grey_levels = simulator.sampling_error_grey_levels();
    const auto start = Clock::now();
    result_.light_field_psnr_db =
        EstimatedPsnrDb({base_->stored(), simulator.camera(), truth_, result_.on}, depth_, step_);
    result_.estimate_seconds = SecondsSince(start);
    for (const model::EffectFinding& finding : simulator.effects().findings) {
      if (!result_.on.Has(finding.effect)) continue;
      ++step_.done;
      step_.Tell();
      SceneEffect row;
      row.effect = finding.effect;
      row.bound_grey_levels = finding.impact.grey_levels;
      row.absent = finding.impact.amount == 0 && finding.impact.grey_levels == 0;
      row.kept_by_auto = kept.Has(finding.effect);
      if (!row.absent) TakeAway(&row);
      result_.effects.push_back(std::move(row));
    }
    return std::move(result_);
  }

 private:
  model::LightField TrueViews(const model::SceneSimulator& simulator) const {
    model::LightField truth =
        simulator.RenderLightField(scene_.u_count, scene_.v_count, step_.OfSimulator());
    // All are judged as they would be stored with all effects.
    truth.transfer = base_->simulator().camera().sensor.transfer;
    return truth;
  }

  void TakeAway(SceneEffect* row) const {
    model::SceneSimulationOptions options = scene_;
    options.effects.without.Add(row->effect);
    // A lens that has the other shape, whose views lie where an estimate with that shape has them.
    if (row->effect == Effect::kApertureShape) options.camera.psf = model::Psf::kGaussian;
    const SceneWorld world(options, pixels_, step_);
    row->picture_seconds = world.seconds();
    Compare(world, row);
    row->absent = row->picture.nothing();
    if (row->absent) return;

    const EffectSet fewer = result_.on.Without({row->effect});
    const bool same_views =
        row->effect != Effect::kApertureShape &&
        world.simulator().effects_of_views() == base_->simulator().effects_of_views();
    const model::LightField own = same_views ? model::LightField() : TrueViews(world.simulator());
    const model::LightField& truth = same_views ? truth_ : own;
    const auto start = Clock::now();
    row->light_field_db =
        EstimatedPsnrDb({world.stored(), world.simulator().camera(), truth, fewer}, depth_, step_) -
        result_.light_field_psnr_db;
    row->estimate_seconds = SecondsSince(start);

    const EffectSet ignorable = {Effect::kThickness, Effect::kDefocus, Effect::kApertureShape,
                                 Effect::kFalloff};
    if (!ignorable.Has(row->effect)) return;
    model::Camera camera = base_->simulator().camera();
    camera.psf = options.camera.psf;
    row->ignored_db = EstimatedPsnrDb({base_->stored(), camera, truth, fewer}, depth_, step_) -
                      result_.light_field_psnr_db;
  }

  void Compare(const SceneWorld& world, SceneEffect* row) const {
    const bool with_noise = IsOfStorage(row->effect);
    const estimator::StoredValues with = base_->Values(with_noise);
    const estimator::StoredValues without = world.Values(with_noise);
    PictureChangeMeter meter;
    meter.Add(with, without);
    row->picture = meter.Result();
    row->difference = {with.width_px, with.height_px, GreyLevelDifference(with, without),
                       "the picture"};
  }

  model::SceneSimulationOptions scene_;
  const std::vector<model::LayerPixels>& pixels_;
  Step step_;
  std::optional<SceneWorld> base_;
  model::RawDepthMap depth_;
  model::LightField truth_;
  SceneAttribution result_;
};

}  // namespace

SceneAttribution AttributeScene(const model::SceneSimulationOptions& scene,
                                const std::vector<model::LayerPixels>& pixels,
                                const AttributionRun& run) {
  return SceneAttributor(scene, pixels, run).Run();
}

}  // namespace thicklens::tools
