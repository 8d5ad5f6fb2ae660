#ifndef THICKLENS_MODEL_EFFECT_SELECTION_H_
#define THICKLENS_MODEL_EFFECT_SELECTION_H_

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/effect_impact.h"
#include "thicklens/model/effects.h"

namespace thicklens::model {

// Largest change of the image that all effects which are left out may cause together.
struct EffectTolerance {
  // Grey levels of encoded values, 255 at full scale, > 0. It limits the sum of the bounds and,
  // separately, the standard deviation of the omitted noise.
  double grey_levels = 0.5;
  // Limit in px, > 0. If present, it replaces the grey levels for each effect that is measured in
  // px, individually.
  std::optional<double> px;

  // Returns true if the limits are finite and > 0. Otherwise `why`, if not null, gets the reason.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};
// The tolerance of a text such as "0.5gl" (grey levels) or "0.1px". Throws Error for other texts.
THICKLENS_EXPORT EffectTolerance EffectToleranceFromText(const std::string& text);

// The subset of `effects` that the scene requires. The effects with the least impact are left out
// one after the other while the tolerance allows it. Their bounds add up: each is the bound of
// removing the effect from an image that already lacks the earlier ones. `threads`: 0 means one per
// core. Throws Error if the tolerance or the conditions are not valid or there is no place.
THICKLENS_EXPORT EffectSet RequiredEffects(const EffectConditions& conditions,
                                           const std::vector<EffectSite>& places,
                                           const EffectSet& effects,
                                           const EffectTolerance& tolerance, int threads = 1);

// The user's choice of the effects of a forward model.
struct EffectSelectionOptions {
  // The set of effects from which the choice starts.
  enum class Base {
    kAuto,   // the effects that the scene requires, within the tolerance
    kAll,    // all effects of the forward model
    kGiven,  // only the effects in `given`
  };
  Base base = Base::kAuto;    // the set from which the choice starts
  EffectSet given;            // the effects of kGiven; not used on other bases
  EffectSet without;          // effects that are always excluded, on every base
  EffectSet kept;             // effects that kAuto keeps regardless of their impact
  EffectTolerance tolerance;  // the change that kAuto accepts
};
// Parses a choice. `effects` is "auto", "all", "none" or a list of names separated by commas.
// `without` is a list of names, which may be empty. `tolerance` is a text for
// EffectToleranceFromText; an empty text gives the default. Throws Error for other texts.
THICKLENS_EXPORT EffectSelectionOptions EffectSelectionOptionsFromText(
    const std::string& effects, const std::string& without, const std::string& tolerance);

// Result of a choice.
struct EffectSelection {
  EffectSet on;  // the effects that are simulated
  // One finding for each effect of the forward model: the largest change by this effect alone in an
  // image with all other effects that the user does not exclude.
  std::vector<LargestEffectImpact> findings;
};
// Applies a choice to the effects `of_model` of the forward model. `threads`: 0 means one per core.
// Throws Error if the choice names an effect that the model lacks, if the conditions or (for kAuto)
// the tolerance are not valid, or if there is no place.
THICKLENS_EXPORT EffectSelection SelectEffects(const EffectSelectionOptions& choice,
                                               const EffectConditions& conditions,
                                               const std::vector<EffectSite>& places,
                                               const EffectSet& of_model, int threads = 1);

// Record of a decision for files.
struct EffectSelectionRecord {
  std::vector<std::string> on;  // names of the effects that are simulated
  // Name and bound, grey levels, of each effect that is left out.
  std::vector<std::pair<std::string, double>> left_out_grey_levels;
};
// Returns the names of the effects of a decision and the bounds of those that are left out.
THICKLENS_EXPORT EffectSelectionRecord RecordOf(const EffectSelection& decision);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_EFFECT_SELECTION_H_
