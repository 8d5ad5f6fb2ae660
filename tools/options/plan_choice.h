#ifndef THICKLENS_TOOLS_OPTIONS_PLAN_CHOICE_H_
#define THICKLENS_TOOLS_OPTIONS_PLAN_CHOICE_H_

#include <nlohmann/json.hpp>
#include <string>

#include "tools/options/estimate_profile.h"
#include "tools/options/plan_wish.h"
#include "tools/options/time_law.h"

namespace thicklens::tools {

struct PlanChoice {
  EstimatePlan plan;
  double expected_seconds = 0;  // of the whole run, including the time that has passed already
  double loss_db = 0;           // below the best plan of the profile
  double median_error = 0;      // relative error of the law's predictions
  double speed_ratio = 1;       // time on this machine over that of the profile
  std::string message;          // one line: the plan, its cost and its loss
};

// Chooses a plan. `speed_ratio` is the time here over the time in the profile.
// - draft: the fastest plan with at least half of the gain over warping that the best plan has
// - standard: the same with nine tenths
// - best: the best plan
// - within_s: the best plan that is expected to end by then
// - psnr_loss_db: the fastest plan that loses no more
// If both limits are given, the choice is the fastest plan that satisfies both. Throws Error if no
// plan does, and names the nearest. `spent_seconds` is the time that reading and finding the ratio
// took; it counts toward the limit.
PlanChoice ChoosePlan(const EstimateProfile& profile, const PlanWish& wish, const PictureLoad& load,
                      double speed_ratio, double spent_seconds = 0);

// Returns the summary of the choice, when the run took `seconds`.
nlohmann::json ChoiceJson(const PlanChoice& choice, const PlanWish& wish, double seconds);
std::string ChoiceText(const PlanChoice& choice, double seconds);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_PLAN_CHOICE_H_
