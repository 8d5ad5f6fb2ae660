#include "tools/options/light_field_effects.h"

#include <algorithm>
#include <limits>
#include <string>

#include "thicklens/estimator/aperture_weights.h"
#include "thicklens/model/effect_impact.h"
#include "tools/options/option_values.h"

namespace thicklens::tools {
namespace {

using model::Effect;
using model::EffectSet;

model::EffectSelectionOptions ChoiceOf(const EffectOptions& options) {
  model::EffectSelectionOptions choice;
  ApplyEffectOptions(options, &choice);
  return choice;
}

model::EffectSelection DecisionWithoutCamera(const EffectOptions& options,
                                             const EffectSet& of_model) {
  if (options.tolerance) {
    throw UsageError(options.tolerance_option +
                     ": without a camera, which effects are relevant is unknown");
  }
  const model::EffectSelectionOptions choice = ChoiceOf(options);
  const EffectSet base =
      choice.base == model::EffectSelectionOptions::Base::kGiven ? choice.given : of_model;
  return {base.Without(choice.without), {}};
}

}  // namespace

model::EffectSelection DecidePhotographEffects(const EffectOptions& options,
                                               const model::LightField& light_field) {
  const EffectSet of_views = {Effect::kDefocus, Effect::kApertureShape};
  EffectSet of_model =
      light_field.camera ? of_views.With({Effect::kThickness, Effect::kFalloff}) : of_views;
  if (estimator::IsOffAperture(light_field)) of_model.Add(Effect::kVignetting);
  CheckEffectNames(options, of_model);
  if (!light_field.camera) return DecisionWithoutCamera(options, of_model);
  model::EffectSelectionOptions choice = ChoiceOf(options);
  choice.kept = of_views;
  model::EffectConditions conditions;
  conditions.camera = *light_field.camera;
  if (light_field.grid) conditions.planes = light_field.grid->planes;
  // Views do not state their depths: every depth from half of the in-focus distance on is possible.
  // The impact of defocus and aperture shape is therefore not reported.
  constexpr double kFarMm = 1e6;
  const double near_mm = std::min(light_field.camera->focus_depth_mm(), kFarMm) / 2;
  model::EffectSelection decision =
      model::SelectEffects(choice, conditions,
                           model::PlacesBetween(*light_field.camera, near_mm,
                                                std::numeric_limits<double>::infinity(), false),
                           of_model);
  // Without defocus each pixel has one ray.
  if (!decision.on.Has(Effect::kDefocus)) decision.on.Remove(Effect::kVignetting);
  decision.findings.erase(std::remove_if(decision.findings.begin(), decision.findings.end(),
                                         [&](const model::LargestEffectImpact& finding) {
                                           return of_views.Has(finding.effect);
                                         }),
                          decision.findings.end());
  return decision;
}

}  // namespace thicklens::tools
