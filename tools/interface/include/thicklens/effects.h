#ifndef THICKLENS_EFFECTS_H_
#define THICKLENS_EFFECTS_H_

#include <optional>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/model/effect_selection.h"

namespace thicklens {

using Effect = model::Effect;        // One effect of image formation, such as kDefocus.
using EffectSet = model::EffectSet;  // A set of such effects.

// Which effects of image formation are taken into account.
struct EffectSelection {
  // The set of effects from which the choice starts.
  enum class Base {
    kAuto,   // those that matter for this camera and scene, within the tolerance
    kAll,    // all that the forward model has
    kGiven,  // only those of `given`
  };
  Base base = Base::kAuto;  // the set from which the choice starts
  EffectSet given;          // only for kGiven
  EffectSet without;        // left out on every base
  // Largest change that the left-out effects may cause together; absent: 0.5 grey levels. Needs a
  // camera, and the base kAuto.
  std::optional<model::EffectTolerance> tolerance;

  // Returns whether the members do not contradict each other. Otherwise `why`, if not null, gets
  // the field, the value and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
  // Whether the effect is left out for every scene.
  THICKLENS_EXPORT bool LeavesOut(Effect effect) const;
};

}  // namespace thicklens

#endif  // THICKLENS_EFFECTS_H_
