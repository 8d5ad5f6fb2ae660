#include "thicklens/model/effect_selection.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <utility>

#include "model/effects/effect_bounds.h"
#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/validity.h"

namespace thicklens::model {
namespace {

// The part of the tolerance that the omitted effects have used.
class Spent {
 public:
  explicit Spent(const EffectTolerance& tolerance) : tolerance_(tolerance) {}

  bool Allows(const LargestEffectImpact& finding) const {
    if (finding.impact.grey_levels == 0) return true;
    const EffectFacts& facts = FactsOf(finding.effect);
    if (facts.random) {
      return std::hypot(noise_, finding.impact.grey_levels) <= tolerance_.grey_levels;
    }
    if (tolerance_.px && facts.unit == EffectUnit::kPx) {
      return finding.impact.amount <= *tolerance_.px &&
             bounds_ + finding.impact.aside_grey_levels <= tolerance_.grey_levels;
    }
    return bounds_ + finding.impact.grey_levels <= tolerance_.grey_levels;
  }

  void Add(const LargestEffectImpact& finding) {
    const EffectFacts& facts = FactsOf(finding.effect);
    if (facts.random) {
      noise_ = std::hypot(noise_, finding.impact.grey_levels);
    } else if (tolerance_.px && facts.unit == EffectUnit::kPx) {
      bounds_ += finding.impact.aside_grey_levels;
    } else {
      bounds_ += finding.impact.grey_levels;
    }
  }

 private:
  const EffectTolerance& tolerance_;
  double bounds_ = 0, noise_ = 0;
};

// Whether the bounds of other effects change when this effect is removed.
bool HidesOthers(Effect effect) {
  return EffectSet{Effect::kThickness, Effect::kDefocus,   Effect::kApertureShape, Effect::kFalloff,
                   Effect::kPixelBox,  Effect::kLensFloor, Effect::kTransferCurve}
      .Has(effect);
}

}  // namespace

bool EffectTolerance::IsValid(std::string* why) const {
  const std::array<std::pair<const char*, double>, 2> limits = {
      {{"grey_levels", grey_levels}, {"px", px.value_or(1)}}};
  for (const auto& [unit, limit] : limits) {
    if (limit > 0 && std::isfinite(limit)) continue;
    return Fail(why, fmt::format("tolerance in {} is {}: it must be finite and > 0", unit, limit));
  }
  return true;
}

EffectTolerance EffectToleranceFromText(const std::string& text) {
  const auto fail = [&text] {
    return Error(fmt::format(
        "tolerance \"{}\": a number > 0 with its unit is expected, such as 0.5gl or 0.1px", text));
  };
  std::size_t end = 0;
  double number = 0;
  try {
    number = std::stod(text, &end);
  } catch (const std::exception&) {
    throw fail();
  }
  EffectTolerance tolerance;
  const std::string unit = text.substr(end);
  if (unit == "gl") {
    tolerance.grey_levels = number;
  } else if (unit == "px") {
    tolerance.px = number;
  } else {
    throw fail();
  }
  if (!tolerance.IsValid(nullptr)) throw fail();
  return tolerance;
}

namespace {

// RequiredEffects for an image that also has the effects `kept`, which are never left out.
EffectSet ChooseBeside(const EffectSet& kept, const EffectConditions& conditions,
                       const std::vector<EffectSite>& places, const EffectSet& effects,
                       const EffectTolerance& tolerance, int threads) {
  std::string why;
  if (!tolerance.IsValid(&why)) throw Error("effects: " + why);
  CheckEffects(conditions, places);
  Spent spent(tolerance);
  EffectSet chosen = effects.With(kept);
  std::vector<LargestEffectImpact> findings = FindImpacts(conditions, places, chosen, threads);
  findings.erase(
      std::remove_if(findings.begin(), findings.end(),
                     [&](const LargestEffectImpact& finding) { return kept.Has(finding.effect); }),
      findings.end());
  while (!findings.empty()) {
    auto least = findings.end();
    for (auto finding = findings.begin(); finding != findings.end(); ++finding) {
      if (!spent.Allows(*finding)) continue;
      if (least == findings.end() || MattersMore(least->impact, finding->impact)) least = finding;
    }
    if (least == findings.end()) break;
    const Effect left_out = least->effect;
    spent.Add(*least);
    chosen.Remove(left_out);
    findings.erase(least);
    if (!HidesOthers(left_out)) continue;
    ParallelFor(static_cast<int>(findings.size()), threads, [&](int i) {
      LargestEffectImpact& finding = findings[static_cast<std::size_t>(i)];
      finding = FindImpact(finding.effect, conditions, places, chosen.Without({finding.effect}));
    });
  }
  return chosen;
}

}  // namespace

EffectSet RequiredEffects(const EffectConditions& conditions, const std::vector<EffectSite>& places,
                          const EffectSet& effects, const EffectTolerance& tolerance, int threads) {
  return ChooseBeside({}, conditions, places, effects, tolerance, threads);
}

EffectSelectionOptions EffectSelectionOptionsFromText(const std::string& effects,
                                                      const std::string& without,
                                                      const std::string& tolerance) {
  EffectSelectionOptions choice;
  if (effects == "all") {
    choice.base = EffectSelectionOptions::Base::kAll;
  } else if (effects != "auto") {
    choice.base = EffectSelectionOptions::Base::kGiven;
    if (effects != "none") choice.given = EffectSetFromNames(effects);
  }
  choice.without = EffectSetFromNames(without);
  if (!tolerance.empty()) choice.tolerance = EffectToleranceFromText(tolerance);
  return choice;
}

EffectSelection SelectEffects(const EffectSelectionOptions& choice,
                              const EffectConditions& conditions,
                              const std::vector<EffectSite>& places, const EffectSet& of_model,
                              int threads) {
  CheckEffects(conditions, places);
  const EffectSet foreign = choice.given.With(choice.without).Without(of_model);
  if (!foreign.empty()) {
    throw Error(fmt::format("effect {} does not apply to this image: its effects are {}",
                            JoinedNames(foreign), JoinedNames(of_model)));
  }
  EffectSelection decision;
  // The effects that the user excludes are not part of the image in which the rest is assessed.
  EffectSet base = of_model.Without(choice.without);
  if (choice.base == EffectSelectionOptions::Base::kGiven) base = base.Both(choice.given);
  const std::vector<Effect> each = of_model.Effects();
  decision.findings.resize(each.size());
  ParallelFor(static_cast<int>(each.size()), threads, [&](int i) {
    const Effect effect = each[static_cast<std::size_t>(i)];
    decision.findings[static_cast<std::size_t>(i)] =
        FindImpact(effect, conditions, places, base.Without({effect}));
  });
  switch (choice.base) {
    case EffectSelectionOptions::Base::kAll:
      decision.on = of_model.Without(choice.without);
      break;
    case EffectSelectionOptions::Base::kGiven:
      decision.on = choice.given.Without(choice.without);
      break;
    case EffectSelectionOptions::Base::kAuto:
      decision.on = ChooseBeside(choice.kept.Both(of_model).Without(choice.without), conditions,
                                 places, of_model.Without(choice.without).Without(choice.kept),
                                 choice.tolerance, threads);
      break;
  }
  return decision;
}

EffectSelectionRecord RecordOf(const EffectSelection& decision) {
  EffectSelectionRecord record;
  for (const LargestEffectImpact& finding : decision.findings) {
    const std::string name = EffectName(finding.effect);
    if (decision.on.Has(finding.effect)) {
      record.on.push_back(name);
    } else {
      record.left_out_grey_levels.emplace_back(name, finding.impact.grey_levels);
    }
  }
  return record;
}

}  // namespace thicklens::model
