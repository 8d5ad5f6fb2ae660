#ifndef THICKLENS_TOOLS_PLAN_CHOICE_H_
#define THICKLENS_TOOLS_PLAN_CHOICE_H_

#include <nlohmann/json.hpp>
#include <string>

#include "estimate_profile.h"
#include "plan_wish.h"
#include "time_law.h"

namespace thicklens::tools {

struct PlanChoice {
  EstimatePlan plan;
  double expected_seconds = 0;  // of all of the run, with what is over already
  double loss_db = 0;           // below the best of the profile
  double median_error = 0;      // of the law's predictions, relative
  double speed_ratio = 1;       // of this machine's times over the profile's
  std::string message;          // one line: what, for how much, and what it gives up
};

// `speed_ratio`: how much longer than the profile says all takes here.
//   draft     the fastest plan that gains over warping at least half of what the best one does
//   standard  the same for nine tenths
//   best      the best
// within_s: the best that is expected to be done by then; psnr_loss_db: the fastest that loses no
// more; both: the fastest that does both. Throws Error where no plan does, and names the nearest.
// `spent_seconds`: what reading, and finding the ratio, took: they count.
PlanChoice ChoosePlan(const EstimateProfile& profile, const PlanWish& wish, const PictureLoad& load,
                      double speed_ratio, double spent_seconds = 0);

// Its summary once the run took so long.
nlohmann::json ChoiceJson(const PlanChoice& choice, const PlanWish& wish, double seconds);
std::string ChoiceText(const PlanChoice& choice, double seconds);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_PLAN_CHOICE_H_
