#include "tools/interface/effects_choice.h"

#include <fmt/format.h>

#include <utility>

#include "thicklens/run.h"

namespace thicklens {

model::EffectSelectionOptions ChoiceOf(const EffectSelection& selection) {
  using Base = EffectSelection::Base;
  model::EffectSelectionOptions choice;
  choice.base = selection.base == Base::kAuto  ? model::EffectSelectionOptions::Base::kAuto
                : selection.base == Base::kAll ? model::EffectSelectionOptions::Base::kAll
                                               : model::EffectSelectionOptions::Base::kGiven;
  choice.given = selection.given;
  choice.without = selection.without;
  if (selection.tolerance) choice.tolerance = *selection.tolerance;
  return choice;
}

void RequireEffectsOf(const EffectSelection& selection, const EffectSet& of_model) {
  for (const auto& [field, effects] : {std::pair("effects.given", selection.given),
                                       std::pair("effects.without", selection.without)}) {
    const EffectSet foreign = effects.Without(of_model);
    if (foreign.empty()) continue;
    throw OptionError(field,
                      fmt::format("{}: effect {} is not available here, the effects are: {}", field,
                                  model::JoinedNames(foreign), model::JoinedNames(of_model)));
  }
}

model::EffectSelection DecideWithoutCamera(const EffectSelection& selection,
                                           const EffectSet& of_model) {
  if (selection.tolerance) {
    throw OptionError("effects.tolerance",
                      "effects.tolerance: without a camera, which effects are relevant is unknown");
  }
  const EffectSet base =
      selection.base == EffectSelection::Base::kGiven ? selection.given : of_model;
  return {base.Without(selection.without), {}};
}

}  // namespace thicklens
