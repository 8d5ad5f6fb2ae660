#ifndef THICKLENS_TOOLS_LIGHT_FIELD_EFFECTS_H_
#define THICKLENS_TOOLS_LIGHT_FIELD_EFFECTS_H_

#include <optional>

#include "effect_options.h"
#include "estimate_options.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/effect_choice.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/scene.h"

namespace thicklens::tools {

// Whether the options leave an effect out in any case, whatever the scene is.
bool IsLeftOut(const EffectOptions& options, model::Effect effect);

// Which effects of the photograph an estimate takes into account: of the camera's, fall-off and
// thickness by what they matter, the others unless they are left out. Without a camera there are
// defocus, aperture-shape and occlusion, and nothing is known of their impact; the functional
// solver has no occlusion. `depth`: the range of the map, where there is a camera. Throws
// UsageError for defocus and occlusion, which are what an estimate is about, and for effects that
// it does not know.
model::EffectDecision DecideEstimateEffects(const EstimateOptions& options,
                                            const std::optional<model::Camera>& camera,
                                            const std::optional<model::DepthStatistics>& depth);

// Likewise of a photograph that is rendered from a light field: without defocus it is that of the
// views in the middle. Occlusion is in the views.
model::EffectDecision DecidePhotographEffects(const EffectOptions& options,
                                              const model::LightField& light_field);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_LIGHT_FIELD_EFFECTS_H_
