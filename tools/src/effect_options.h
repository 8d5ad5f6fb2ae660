#ifndef THICKLENS_TOOLS_EFFECT_OPTIONS_H_
#define THICKLENS_TOOLS_EFFECT_OPTIONS_H_

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/model/effect_choice.h"

namespace thicklens::tools {

// --effects, --without, --tolerance of commands with a forward model. What is absent was not given.
struct EffectOptions {
  std::optional<std::string> effects, without, tolerance;
  std::string tolerance_option = "--tolerance";  // where it has another name; empty: there is none
};
void AddEffectOptions(CLI::App* command, EffectOptions* options);
// Throws UsageError for effects that are named and that the forward model does not have.
void CheckEffectNames(const EffectOptions& options, const model::EffectSet& of_model);
// Puts what was given in the place of what `choice` says. Throws UsageError.
void ApplyEffectOptions(const EffectOptions& options, model::EffectChoice* choice);

// "250 mm, at (0, 479)".
std::string EffectPlaceText(const model::EffectPlace& place);
// One entry an effect: name, impact with its unit, bound in grey levels, on, where.
nlohmann::json EffectsJson(const model::EffectDecision& decision);
// One line on what was on and what was left out.
std::string EffectsText(const model::EffectDecision& decision);
// A line an effect. `cost_seconds`: null, or of some effects what they cost, in a column of its
// own.
std::string EffectsTable(
    const model::EffectDecision& decision,
    const std::vector<std::pair<model::Effect, double>>* cost_seconds = nullptr);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_EFFECT_OPTIONS_H_
