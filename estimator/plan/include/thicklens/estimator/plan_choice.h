#ifndef THICKLENS_ESTIMATOR_PLAN_CHOICE_H_
#define THICKLENS_ESTIMATOR_PLAN_CHOICE_H_

#include <optional>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/estimator/estimate_profile.h"
#include "thicklens/estimator/time_model.h"

namespace thicklens::estimator {

// The target that a user sets for an estimate in place of a solver.
struct QualityTarget {
  std::string quality;                 // "draft", "standard", "best"; empty: not given
  std::optional<double> within_s;      // limit for the whole program
  std::optional<double> psnr_loss_db;  // relative to the best plan of the profile

  // Returns whether any target is given.
  bool has_value() const { return !quality.empty() || within_s || psnr_loss_db; }
};

// The chosen plan, and what it is expected to cost.
struct PlanChoice {
  EstimatePlan plan;            // the chosen plan
  double expected_seconds = 0;  // of the whole run, including the time that has passed already
  double loss_db = 0;           // below the best plan of the profile
  double median_error = 0;      // relative error of the predicted times
  double speed_ratio = 1;       // time on this machine over that of the profile
  std::string message;          // one line: the plan, its cost and its loss
};

// Chooses a plan for a target, which has a value. `speed_ratio` is the time here over the time in
// the profile; messages call the target `target_text`.
// - draft: the fastest plan with at least half of the gain over warping that the best plan has
// - standard: the same with nine tenths
// - best: the best plan
// - within_s: the best plan that is expected to end by then
// - psnr_loss_db: the fastest plan that loses no more
// If both limits are given, the choice is the fastest plan that satisfies both. Throws Error if no
// plan does, and names the nearest. `spent_seconds` is the time that reading and finding the ratio
// took; it counts toward the limit.
THICKLENS_EXPORT PlanChoice ChoosePlan(const EstimateProfile& profile, const QualityTarget& target,
                                       const std::string& target_text, const Workload& load,
                                       double speed_ratio, double spent_seconds = 0);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_PLAN_CHOICE_H_
