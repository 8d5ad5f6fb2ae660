#ifndef THICKLENS_TOOLS_OPTIONS_LIGHT_FIELD_EFFECTS_H_
#define THICKLENS_TOOLS_OPTIONS_LIGHT_FIELD_EFFECTS_H_

#include "thicklens/model/effect_selection.h"
#include "thicklens/model/light_field.h"
#include "tools/options/effect_options.h"

namespace thicklens::tools {

// Decides which effects of a photograph that is rendered from a light field are taken into account.
// Without defocus the photograph is that of the views in the middle. Occlusion is contained in the
// views. Throws UsageError for effects that it does not have.
model::EffectSelection DecidePhotographEffects(const EffectOptions& options,
                                               const model::LightField& light_field);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_LIGHT_FIELD_EFFECTS_H_
