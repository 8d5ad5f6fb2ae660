#include "tools/interface/effects_choice.h"

#include <fmt/format.h>

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
  const EffectSet unknown = selection.given.With(selection.without).Without(of_model);
  if (unknown.empty()) return;
  throw OptionError("effects",
                    fmt::format("effects: the forward model does not have {}; it has {}",
                                model::JoinedNames(unknown), model::JoinedNames(of_model)));
}

model::EffectSelection DecideWithoutCamera(const EffectSelection& selection,
                                           const EffectSet& of_model) {
  if (selection.tolerance) {
    throw OptionError("effects.tolerance",
                      "effects.tolerance: needs a camera, without which no impact is known");
  }
  const EffectSet base =
      selection.base == EffectSelection::Base::kGiven ? selection.given : of_model;
  return {base.Without(selection.without), {}};
}

}  // namespace thicklens
