#ifndef THICKLENS_TOOLS_INTERFACE_EFFECTS_CHOICE_H_
#define THICKLENS_TOOLS_INTERFACE_EFFECTS_CHOICE_H_

#include "thicklens/effects.h"

namespace thicklens {

// The model's form of a selection.
model::EffectSelectionOptions ChoiceOf(const EffectSelection& selection);
// Throws OptionError if the selection names an effect that the forward model lacks.
void RequireEffectsOf(const EffectSelection& selection, const EffectSet& of_model);
// The decision without a camera, without which no impact is known. Throws OptionError for a
// tolerance.
model::EffectSelection DecideWithoutCamera(const EffectSelection& selection,
                                           const EffectSet& of_model);

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_EFFECTS_CHOICE_H_
