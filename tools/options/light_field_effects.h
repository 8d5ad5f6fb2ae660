#ifndef THICKLENS_TOOLS_OPTIONS_LIGHT_FIELD_EFFECTS_H_
#define THICKLENS_TOOLS_OPTIONS_LIGHT_FIELD_EFFECTS_H_

#include <optional>

#include "thicklens/model/camera.h"
#include "thicklens/model/effect_selection.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/scene.h"
#include "tools/options/effect_options.h"
#include "tools/options/estimate_options.h"

namespace thicklens::tools {

// Returns whether the options leave an effect out for every scene.
bool IsLeftOut(const EffectOptions& options, model::Effect effect);

// Decides which effects of the photograph an estimate takes into account. Fall-off and thickness
// are decided by their impact with the camera; the others are on unless they are left out. Without
// a camera the effects are defocus, aperture-shape and occlusion, and their impact is unknown. The
// functional solver has no occlusion. `depth` is the range of the map, if there is a camera. Throws
// UsageError if defocus or occlusion is left out, because an estimate is about them, and for
// effects that it does not have.
model::EffectSelection DecideEstimateEffects(const EstimateOptions& options,
                                             const std::optional<model::Camera>& camera,
                                             const std::optional<model::DepthStatistics>& depth);

// Decides the same for a photograph that is rendered from a light field. Without defocus the
// photograph is that of the views in the middle. Occlusion is contained in the views.
model::EffectSelection DecidePhotographEffects(const EffectOptions& options,
                                               const model::LightField& light_field);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_LIGHT_FIELD_EFFECTS_H_
