#ifndef THICKLENS_TOOLS_OPTIONS_EFFECT_OPTIONS_H_
#define THICKLENS_TOOLS_OPTIONS_EFFECT_OPTIONS_H_

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/effects.h"
#include "thicklens/model/effect_selection.h"
#include "tools/options/command_frame.h"

namespace thicklens::tools {

// The options --effects, --without and --effect-tolerance of commands with a forward model. An
// absent value was not given.
struct EffectOptions {
  std::optional<std::string> effects, without, tolerance;
  bool has_tolerance = true;  // false: there is no --effect-tolerance
};
void AddEffectOptions(CLI::App* command, EffectOptions* options);
// Also accepts the former name of --effect-tolerance, which is another option in `estimate`.
void AddFormerEffectTolerance(CLI::App* command, EffectOptions* options, CommonOptions* common);
// Throws UsageError for named effects that the forward model does not have.
void CheckEffectNames(const EffectOptions& options, const model::EffectSet& of_model);
// Overrides `choice` with the given options. Throws UsageError.
void ApplyEffectOptions(const EffectOptions& options, model::EffectSelectionOptions* choice);

// The given options as the interface takes them. A tolerance has no effect unless the base is auto.
// Throws UsageError.
EffectSelection EffectSelectionOf(const EffectOptions& options);

// "250 mm, at (0, 479)".
std::string EffectSiteText(const model::EffectSite& place);
// One entry for each effect: name, impact with its unit, bound in grey levels, on, where.
nlohmann::json EffectsJson(const model::EffectSelection& decision);
// A line on the effects that were on, and one on those that were ignored, if there are any.
std::string EffectsText(const model::EffectSelection& decision);
// One line for each effect that has an impact, and one that names the others. `cost_seconds` may be
// null; otherwise it holds the costs of some effects, shown in a column of their own, and each
// effect has its line.
std::string EffectsTable(
    const model::EffectSelection& decision,
    const std::vector<std::pair<model::Effect, double>>* cost_seconds = nullptr);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_EFFECT_OPTIONS_H_
