#include "thicklens/model/scene_ablation.h"

#include <optional>
#include <utility>
#include <vector>

#include "thicklens/base/stopwatch.h"
#include "thicklens/model/encoded_values.h"

namespace thicklens::model {
namespace {

// A step of the run, which long computations keep telling.
struct Step {
  const AblationRun& run;
  int done = 0, total = 1;

  void Tell() const {
    if (run.progress) run.progress(done, total);
  }
  SceneRun OfSimulator() const {
    return {run.threads, [this](int, int) { Tell(); }};
  }
};

// One simulation of the scene.
class SceneWorld {
 public:
  SceneWorld(const SceneSimulationOptions& options, const std::vector<LayerPixels>& pixels,
             const Step& step)
      : start_(Clock::now()),
        simulator_(options, pixels, step.run.threads),
        noiseless_(simulator_.RenderNoiseless(step.OfSimulator())),
        stored_(simulator_.Store(noiseless_)),
        seconds_(SecondsSince(start_)) {}

  const SceneSimulator& simulator() const { return simulator_; }
  const EncodedImage& stored() const { return stored_; }
  double seconds() const { return seconds_; }
  EncodedValues Values(bool with_noise) const {
    return with_noise ? EncodedValuesOf(stored_)
                      : EncodedValuesOf(noiseless_, simulator_.camera().sensor.transfer);
  }

 private:
  Clock::time_point start_;
  SceneSimulator simulator_;
  LinearImage noiseless_;
  EncodedImage stored_;
  double seconds_;
};

class SceneAblator {
 public:
  SceneAblator(const SceneSimulationOptions& scene, const std::vector<LayerPixels>& pixels,
               const EstimatedPsnrDb& estimate, const AblationRun& run)
      : scene_(scene), pixels_(pixels), estimate_(estimate), step_{run} {}

  SceneAblation Run() {
    SceneSimulationOptions by_auto = scene_;
    by_auto.effects.base = EffectSelectionOptions::Base::kAuto;
    const EffectSet kept = SceneSimulator(by_auto, pixels_, step_.run.threads).effects().on;

    scene_.effects = AllInsteadOfAuto(scene_.effects);
    base_.emplace(scene_, pixels_, step_);
    const SceneSimulator& simulator = base_->simulator();
    depth_ = simulator.RenderDepth();
    truth_ = TrueViews(simulator);
    result_.on = simulator.effects().on;
    step_.total = static_cast<int>(result_.on.Effects().size()) + 1;
    result_.u_count = scene_.u_count;
    result_.v_count = scene_.v_count;
    result_.image = base_->stored();
    result_.image_seconds = base_->seconds();
    result_.sampling_error_grey_levels = simulator.sampling_error_grey_levels();
    const auto start = Clock::now();
    result_.light_field_psnr_db = Estimate(base_->stored(), simulator.camera(), truth_, result_.on);
    result_.estimate_seconds = SecondsSince(start);
    for (const LargestEffectImpact& finding : simulator.effects().findings) {
      if (!result_.on.Has(finding.effect)) continue;
      ++step_.done;
      step_.Tell();
      AblatedSceneEffect row;
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
  LightField TrueViews(const SceneSimulator& simulator) const {
    LightField truth =
        simulator.RenderLightField(scene_.u_count, scene_.v_count, step_.OfSimulator());
    // All are judged as they would be stored with all effects.
    truth.transfer = base_->simulator().camera().sensor.transfer;
    return truth;
  }

  double Estimate(const EncodedImage& photograph, const Camera& camera, const LightField& truth,
                  const EffectSet& on) const {
    return estimate_({photograph, camera, depth_, truth, on, [this] { step_.Tell(); }});
  }

  void TakeAway(AblatedSceneEffect* row) const {
    SceneSimulationOptions options = scene_;
    options.effects.without.Add(row->effect);
    // A lens that has the other shape, whose views lie where an estimate with that shape has them.
    if (row->effect == Effect::kApertureShape) options.camera.psf = Psf::kGaussian;
    const SceneWorld world(options, pixels_, step_);
    row->image_seconds = world.seconds();
    Compare(world, row);
    row->absent = row->image.nothing();
    if (row->absent) return;

    const EffectSet fewer = result_.on.Without({row->effect});
    const bool same_views =
        row->effect != Effect::kApertureShape &&
        world.simulator().effects_of_views() == base_->simulator().effects_of_views();
    const LightField own = same_views ? LightField() : TrueViews(world.simulator());
    const LightField& truth = same_views ? truth_ : own;
    const auto start = Clock::now();
    row->light_field_db = Estimate(world.stored(), world.simulator().camera(), truth, fewer) -
                          result_.light_field_psnr_db;
    row->estimate_seconds = SecondsSince(start);

    const EffectSet ignorable = {Effect::kThickness, Effect::kDefocus, Effect::kApertureShape,
                                 Effect::kFalloff};
    if (!ignorable.Has(row->effect)) return;
    Camera camera = base_->simulator().camera();
    camera.psf = options.camera.psf;
    row->ignored_db = Estimate(base_->stored(), camera, truth, fewer) - result_.light_field_psnr_db;
  }

  void Compare(const SceneWorld& world, AblatedSceneEffect* row) const {
    const bool with_noise = IsOfStorage(row->effect);
    const EncodedValues with = base_->Values(with_noise);
    const EncodedValues without = world.Values(with_noise);
    ImageChangeAccumulator meter;
    meter.Add(with, without);
    row->image = meter.Result();
    row->difference = {with.width_px, with.height_px, GreyLevelDifference(with, without),
                       "the image"};
  }

  SceneSimulationOptions scene_;
  const std::vector<LayerPixels>& pixels_;
  const EstimatedPsnrDb& estimate_;
  Step step_;
  std::optional<SceneWorld> base_;
  RawDepthMap depth_;
  LightField truth_;
  SceneAblation result_;
};

}  // namespace

SceneAblation AblateScene(const SceneSimulationOptions& scene,
                          const std::vector<LayerPixels>& pixels, const EstimatedPsnrDb& estimate,
                          const AblationRun& run) {
  return SceneAblator(scene, pixels, estimate, run).Run();
}

}  // namespace thicklens::model
