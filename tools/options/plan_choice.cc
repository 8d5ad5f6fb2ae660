#include "tools/options/plan_choice.h"

#include <fmt/format.h>

#include "tools/options/estimate_plan.h"
#include "tools/options/quality_target_options.h"

namespace thicklens::tools {

nlohmann::json ChoiceJson(const estimator::PlanChoice& choice,
                          const estimator::QualityTarget& target, double seconds) {
  return {{"asked", QualityTargetText(target)},      {"plan", PlanJson(choice.plan)},
          {"arguments", PlanArguments(choice.plan)}, {"expected_seconds", choice.expected_seconds},
          {"expected_error", choice.median_error},   {"seconds", seconds},
          {"expected_loss_db", choice.loss_db},      {"speed_ratio", choice.speed_ratio}};
}

std::string ChoiceText(const estimator::PlanChoice& choice, double seconds) {
  return fmt::format("plan         {}: {:.2g} s expected, {:.2g} s taken ({:+.0f} %)\n",
                     PlanArguments(choice.plan), choice.expected_seconds, seconds,
                     100 * (seconds / choice.expected_seconds - 1));
}

}  // namespace thicklens::tools
