#include "tools/options/effect_options.h"

#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "thicklens/base/error.h"
#include "tools/options/deprecated_names.h"
#include "tools/options/option_values.h"

namespace thicklens::tools {
namespace {

constexpr char kEffectTolerance[] = "--effect-tolerance";

// Runs `parse`, and turns its error into a UsageError that begins with the option's name.
template <typename Parse>
auto Parsed(const std::string& option, const Parse& parse) {
  try {
    return parse();
  } catch (const Error& error) {
    throw UsageError(fmt::format("{}: {}", option, error.what()));
  }
}

std::string BoundText(const model::LargestEffectImpact& finding) {
  const double grey_levels = finding.impact.grey_levels;
  if (grey_levels == 0) return "0";
  if (grey_levels < 0.001) return "< 0.001";
  return fmt::format("{:.3g}", grey_levels);
}

std::string CostText(model::Effect effect,
                     const std::vector<std::pair<model::Effect, double>>& costs) {
  for (const auto& [of, seconds] : costs) {
    if (of == effect) return seconds == 0 ? "~0" : fmt::format("{:+.2g}", seconds);
  }
  return "-";
}

}  // namespace

void AddEffectOptions(CLI::App* command, EffectOptions* options) {
  command
      ->add_option("--effects", options->effects,
                   "Effects of image formation to simulate: auto (the relevant ones), all, none, "
                   "or names separated by commas (thicklens explain lists them)")
      ->type_name("NAMES");
  command
      ->add_option("--without", options->without,
                   "Effects to leave out always, names separated by commas")
      ->type_name("NAMES");
  if (!options->has_tolerance) return;
  command
      ->add_option(
          kEffectTolerance, options->tolerance,
          "Largest total effect that auto may leave out: 0.5gl (grey levels of 255) or 0.1px")
      ->type_name("AMOUNT");
}

void AddFormerEffectTolerance(CLI::App* command, EffectOptions* options, CommonOptions* common) {
  AddDeprecatedOptions(
      command, kEffectTolerance, [options](const std::string& text) { options->tolerance = text; },
      common);
}

void CheckEffectNames(const EffectOptions& options, const model::EffectSet& of_model) {
  model::EffectSelectionOptions named;
  ApplyEffectOptions(options, &named);
  for (const auto& [option, effects] :
       {std::pair("--effects", named.given), std::pair("--without", named.without)}) {
    const model::EffectSet foreign = effects.Without(of_model);
    if (foreign.empty()) continue;
    throw UsageError(fmt::format("{}: effect {} is not available here, the effects are: {}", option,
                                 model::JoinedNames(foreign), model::JoinedNames(of_model)));
  }
}

void ApplyEffectOptions(const EffectOptions& options, model::EffectSelectionOptions* choice) {
  if (options.effects && options.effects->empty()) {
    throw UsageError(
        "--effects: auto, all, none or names separated by commas are expected, found ''");
  }
  if (options.effects) {
    const model::EffectSelectionOptions given = Parsed("--effects", [&] {
      return model::EffectSelectionOptionsFromText(*options.effects, "", "");
    });
    choice->base = given.base;
    choice->given = given.given;
  }
  if (options.without) {
    choice->without =
        Parsed("--without", [&] { return model::EffectSetFromNames(*options.without); });
  }
  if (options.tolerance) {
    choice->tolerance = Parsed(kEffectTolerance,
                               [&] { return model::EffectToleranceFromText(*options.tolerance); });
  }
}

EffectSelection EffectSelectionOf(const EffectOptions& options) {
  model::EffectSelectionOptions choice;
  ApplyEffectOptions(options, &choice);
  using Base = model::EffectSelectionOptions::Base;
  EffectSelection selection;
  selection.base = choice.base == Base::kAuto  ? EffectSelection::Base::kAuto
                   : choice.base == Base::kAll ? EffectSelection::Base::kAll
                                               : EffectSelection::Base::kGiven;
  selection.given = choice.given;
  selection.without = choice.without;
  if (options.tolerance) selection.tolerance = choice.tolerance;
  return selection;
}

std::string EffectSiteText(const model::EffectSite& place) {
  const std::string depth =
      std::isfinite(place.depth_mm) ? fmt::format("{:.5g} mm", place.depth_mm) : "infinity";
  return fmt::format("{}, at ({:.0f}, {:.0f})", depth, place.position_px.x(),
                     place.position_px.y());
}

nlohmann::json EffectsJson(const model::EffectSelection& decision) {
  nlohmann::json json = nlohmann::json::array();
  for (const model::LargestEffectImpact& finding : decision.findings) {
    const model::EffectFacts& facts = model::FactsOf(finding.effect);
    const double depth_mm = finding.place.depth_mm;
    json.push_back(
        {{"name", facts.name},
         {"impact", finding.impact.amount},
         {"unit", model::EffectUnitName(facts.unit)},
         {"bound_grey_levels", finding.impact.grey_levels},
         {"random", facts.random},
         {"on", decision.on.Has(finding.effect)},
         {"where",
          {{"depth_mm", std::isfinite(depth_mm) ? nlohmann::json(depth_mm) : nlohmann::json()},
           {"position_px", {finding.place.position_px.x(), finding.place.position_px.y()}}}}});
  }
  return json;
}

std::string EffectsText(const model::EffectSelection& decision) {
  std::string ignored;
  for (const model::LargestEffectImpact& finding : decision.findings) {
    if (decision.on.Has(finding.effect)) continue;
    ignored += fmt::format("{}{} {}", ignored.empty() ? "" : ", ",
                           model::EffectName(finding.effect), BoundText(finding));
  }
  return fmt::format("effects: {}\n", model::JoinedNames(decision.on)) +
         (ignored.empty() ? ""
                          : fmt::format("effects ignored, with the largest change that each could "
                                        "cause in grey levels of 255: {}\n",
                                        ignored));
}

std::string EffectsTable(const model::EffectSelection& decision,
                         const std::vector<std::pair<model::Effect, double>>* cost_seconds) {
  std::string text =
      fmt::format("{:<15} {:>22} {:>13}{}  {:<4} {}\n", "effect", "largest impact", "grey levels",
                  cost_seconds != nullptr ? fmt::format("{:>10}", "cost s") : "", "used", "where");
  std::string without_impact;
  for (const model::LargestEffectImpact& finding : decision.findings) {
    const model::EffectFacts& facts = model::FactsOf(finding.effect);
    const std::string unit =
        facts.unit == model::EffectUnit::kGreyLevels ? "levels" : model::EffectUnitName(facts.unit);
    if (finding.impact.amount == 0 && finding.impact.grey_levels == 0 && cost_seconds == nullptr) {
      without_impact +=
          fmt::format("{}{}", without_impact.empty() ? "" : ", ", std::string(facts.name));
      continue;
    }
    const std::string used = decision.on.Has(finding.effect) ? "yes" : "no";
    const std::string cost = cost_seconds != nullptr
                                 ? fmt::format("{:>10}", CostText(finding.effect, *cost_seconds))
                                 : "";
    if (finding.impact.amount == 0 && finding.impact.grey_levels == 0) {
      text += fmt::format("{:<15} {:>22} {:>13}{}  {}\n", facts.name, "none here", "0", cost, used);
      continue;
    }
    text += fmt::format(
        "{:<15} {:>22} {:>13}{}  {:<4} {}\n", facts.name,
        fmt::format("{}{:.4g} {}", facts.random ? "sd " : "", finding.impact.amount, unit),
        BoundText(finding), cost, used, EffectSiteText(finding.place));
  }
  if (!without_impact.empty()) text += fmt::format("no impact here: {}\n", without_impact);
  return text;
}

}  // namespace thicklens::tools
