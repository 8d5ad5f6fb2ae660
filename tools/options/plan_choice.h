#ifndef THICKLENS_TOOLS_OPTIONS_PLAN_CHOICE_H_
#define THICKLENS_TOOLS_OPTIONS_PLAN_CHOICE_H_

#include <nlohmann/json.hpp>
#include <string>

#include "thicklens/estimator/plan_choice.h"

namespace thicklens::tools {

// Returns the summary of the choice, when the run took `seconds`.
nlohmann::json ChoiceJson(const estimator::PlanChoice& choice,
                          const estimator::QualityTarget& target, double seconds);
std::string ChoiceText(const estimator::PlanChoice& choice, double seconds);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_PLAN_CHOICE_H_
