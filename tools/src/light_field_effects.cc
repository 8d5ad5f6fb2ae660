#include "light_field_effects.h"

#include <string>

#include "option_values.h"
#include "thicklens/error.h"
#include "thicklens/model/effect_impact.h"

namespace thicklens::tools {
namespace {

using model::Effect;
using model::EffectSet;

EffectSet EffectsOf(const std::string& solver, bool camera) {
  EffectSet effects = {Effect::kDefocus, Effect::kApertureShape};
  if (solver != "functional") effects.Add(Effect::kOcclusion);
  return camera ? effects.With({Effect::kThickness, Effect::kFalloff}) : effects;
}

model::EffectChoice ChoiceOf(const EffectOptions& options) {
  model::EffectChoice choice;
  ApplyEffectOptions(options, &choice);
  return choice;
}

model::EffectDecision DecisionWithoutCamera(const model::EffectChoice& choice,
                                            const EffectSet& of_model) {
  const EffectSet foreign = choice.given.With(choice.without).Without(of_model);
  if (!foreign.empty()) {
    throw UsageError("--effects, --without: effect " + model::JoinedNames(foreign) +
                     " is not one of a light field without a camera: it has " +
                     model::JoinedNames(of_model));
  }
  const EffectSet base = choice.base == model::EffectChoice::Base::kGiven ? choice.given : of_model;
  return {base.Without(choice.without), {}};
}

model::EffectDecision DecisionWith(const model::EffectChoice& choice, const EffectSet& of_model,
                                   const model::Camera& camera, double near_mm, double far_mm) {
  model::EffectConditions conditions;
  conditions.camera = camera;
  try {
    return model::DecideEffects(choice, conditions,
                                model::PlacesBetween(camera, near_mm, far_mm, true), of_model);
  } catch (const Error& error) {
    throw UsageError(std::string("--effects, --without: ") + error.what());
  }
}

}  // namespace

bool IsLeftOut(const EffectOptions& options, Effect effect) {
  const model::EffectChoice choice = ChoiceOf(options);
  return choice.without.Has(effect) ||
         (choice.base == model::EffectChoice::Base::kGiven && !choice.given.Has(effect));
}

model::EffectDecision DecideEstimateEffects(const EstimateOptions& options,
                                            const std::optional<model::Camera>& camera,
                                            const std::optional<model::DepthStatistics>& depth) {
  model::EffectChoice choice = ChoiceOf(options.effects);
  const EffectSet of_model = EffectsOf(options.solver, camera.has_value());
  // The solution's own, which cost what they bring.
  choice.kept = EffectsOf(options.solver, false);
  const bool is_gaussian = options.aperture_shape.empty() && options.aperture_of.empty() &&
                           camera && camera->psf == model::Psf::kGaussian;
  if (is_gaussian) choice.kept.Remove(Effect::kApertureShape);
  if (IsLeftOut(options.effects, Effect::kDefocus)) {
    throw UsageError(
        "--effects, --without: defocus is what an estimate undoes and cannot be left out; "
        "thicklens compare --dibr measures the picture that is only warped by its depth");
  }
  if (of_model.Has(Effect::kOcclusion) && IsLeftOut(options.effects, Effect::kOcclusion)) {
    throw UsageError(
        "--effects, --without: occlusion cannot be left out of an estimate, whose views show the "
        "depth map as each of them sees it; where nothing is hidden it costs nothing");
  }
  if (!camera) return DecisionWithoutCamera(choice, of_model);
  const double focus_depth_mm = camera->focus_depth_mm();
  return DecisionWith(choice, of_model, *camera, depth ? depth->min_mm : focus_depth_mm,
                      depth ? depth->max_mm : focus_depth_mm);
}

model::EffectDecision DecidePhotographEffects(const EffectOptions& options,
                                              const model::LightField& light_field) {
  model::EffectChoice choice = ChoiceOf(options);
  choice.kept = {Effect::kDefocus, Effect::kApertureShape};
  if (!light_field.camera) return DecisionWithoutCamera(choice, choice.kept);
  // The fall-off of a ray knows no depth.
  const double focus_depth_mm = light_field.camera->focus_depth_mm();
  return DecisionWith(choice, choice.kept.With({Effect::kThickness, Effect::kFalloff}),
                      *light_field.camera, focus_depth_mm, focus_depth_mm);
}

}  // namespace thicklens::tools
