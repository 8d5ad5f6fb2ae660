#ifndef THICKLENS_MODEL_EFFECT_CHOICE_H_
#define THICKLENS_MODEL_EFFECT_CHOICE_H_

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/model/effect_impact.h"
#include "thicklens/model/effects.h"

namespace thicklens::model {

// What the effects that are left out may change, all together.
struct EffectTolerance {
  double grey_levels =
      0.5;  // > 0; the sum of their bounds, and apart from it the sd of their noise
  // For effects that are measured in px: instead of grey levels, each on its own. > 0.
  std::optional<double> px;

  bool IsValid(std::string* why) const;
};
// "0.5gl" or "0.1px". Throws Error.
EffectTolerance EffectToleranceFromText(const std::string& text);

// Those of `effects` that the scene calls for: one after the other the least is left out, while the
// tolerance allows it. Bounds add up along the way: each is that of taking the effect from a
// picture that lacks those before it.
EffectSet ChooseEffects(const EffectConditions& conditions, const std::vector<EffectPlace>& places,
                        const EffectSet& effects, const EffectTolerance& tolerance,
                        int threads = 1);

// What the user wants of a forward model.
struct EffectChoice {
  enum class Base {
    kAuto,   // those that the scene calls for, within the tolerance
    kAll,    // all that the forward model has
    kGiven,  // `given` alone
  };
  Base base = Base::kAuto;
  EffectSet given;
  EffectSet without;  // of any base, never
  EffectSet kept;     // what kAuto keeps, whatever it matters
  EffectTolerance tolerance;
};
// `effects`: "auto", "all", "none", or names between commas; `without`: names, or nothing;
// `tolerance`: as above, or nothing for the default. Throws Error.
EffectChoice EffectChoiceFromText(const std::string& effects, const std::string& without,
                                  const std::string& tolerance);

// What became of it.
struct EffectDecision {
  EffectSet on;
  // Of each effect of the forward model: what it alone would change at most in a picture with all
  // the others that the user does not exclude.
  std::vector<EffectFinding> findings;
};
// `of_model`: what the forward model has. Throws Error for effects that are named and that it does
// not have, and as FindImpacts does.
EffectDecision DecideEffects(const EffectChoice& choice, const EffectConditions& conditions,
                             const std::vector<EffectPlace>& places, const EffectSet& of_model,
                             int threads = 1);

// What is written down of it.
struct EffectRecord {
  std::vector<std::string> on;
  std::vector<std::pair<std::string, double>> left_out_grey_levels;  // the bounds
};
EffectRecord RecordOf(const EffectDecision& decision);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_EFFECT_CHOICE_H_
