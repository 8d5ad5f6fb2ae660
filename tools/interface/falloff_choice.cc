#include "tools/interface/falloff_choice.h"

#include <fmt/format.h>

#include <cmath>
#include <string>
#include <utility>

#include "thicklens/estimator/falloff_evidence.h"

namespace thicklens {
namespace {

// A fall-off that brightens no corner by more is not tested: it is within what no one sees.
constexpr double kMinFactor = 1.1;
// An undecided fall-off that brightens no corner by more is taken as the camera states it.
constexpr double kHarmlessFactor = 1.25;

}  // namespace

void DecideFalloff(const std::string& photo, const EstimateOptions& options,
                   PreparedProblem* prepared, EstimateDiagnostics* diagnostics, RunScope* run) {
  using Verdict = estimator::FalloffEvidence::Verdict;
  const estimator::EstimateInput& input = *prepared->input;
  if (!input.grid || !prepared->effects.on.Has(Effect::kFalloff) ||
      options.effects.base != EffectSelection::Base::kAuto) {
    return;
  }
  estimator::FalloffEvidence evidence = estimator::TestFalloff(input, run->threads());
  const double factor = 1 / evidence.darkest;
  if (!(factor >= kMinFactor)) return;
  const std::string without = run->Option("effects.without") + " falloff";
  const std::string with = run->Option("effects.given") + " all";
  // Where the lens shades a corner completely, there is no factor.
  const bool is_black = !std::isfinite(factor);
  const std::string darker =
      is_black ? "black corners" : fmt::format("corners {:.2g}x darker", factor);
  const std::string brighter = is_black ? "all corners that are not predicted to be black"
                                        : fmt::format("the corners up to {:.2g}x", factor);
  const std::string keeps = fmt::format(
      "the fall-off, by which the camera predicts {}, is not divided out; if the photograph has "
      "it, {} divides it out",
      darker, with);
  const std::string divides =
      fmt::format("the fall-off is divided out, which brightens {}; {} keeps them as they are",
                  brighter, without);
  const bool is_raw = input.transfer == TransferCurve::Linear();
  switch (evidence.verdict) {
    case Verdict::kShown:
      run->Inform(fmt::format("{}: {}: {}", photo, evidence.message, divides));
      break;
    case Verdict::kNotShown:
      prepared->effects.on.Remove(Effect::kFalloff);
      run->Warn(fmt::format("{}: {}: {}", photo, evidence.message, keeps));
      break;
    case Verdict::kUndecided:
      if (is_raw || factor <= kHarmlessFactor) {
        run->Inform(fmt::format("{}: {}; {}{}", photo, evidence.message,
                                is_raw ? "values of linear light are as the sensor saw them: " : "",
                                divides));
        break;
      }
      prepared->effects.on.Remove(Effect::kFalloff);
      run->Warn(fmt::format("{}: {}; encoded photographs are often corrected for it: {}", photo,
                            evidence.message, keeps));
      break;
  }
  diagnostics->falloff = std::move(evidence);
}

}  // namespace thicklens
