#ifndef THICKLENS_TESTS_BENCHMARKS_ACCURACY_SUMMARY_H_
#define THICKLENS_TESTS_BENCHMARKS_ACCURACY_SUMMARY_H_

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "benchmarks/accuracy/trial.h"

namespace thicklens::accuracy {

// Comparison of one result's errors with the sigmas that the calibration states.
struct Coverage {
  int inside = 0;            // trials with |error| <= 1.96 sigma
  int trials = 0;            // trials that gave the result
  double binomial_p = 1;     // two-sided, for an expected coverage of 95 %
  double sigma_ratio = 0;    // median sigma divided by the scatter, 1.4826 median |error|
  double sigma_ratio_z = 0;  // 1 divided by 1.4826 median |error/sigma|
  double rms_z = 0;
  // Bias of the errors: their mean in sigmas, and that mean divided by its own standard error
  // (about a standard normal number if there is no bias).
  double mean_z = 0, mean_over_error = 0;
  double fraction() const { return trials > 0 ? static_cast<double>(inside) / trials : 0; }
};

// Results of several trials of one kind: a cell of the table, or a case.
struct Summary {
  int trials = 0;
  int done = 0;
  int partial = 0;
  std::map<std::string, int> refusals;  // number of trials for each reason
  // Median and 90 % quantile of the errors' magnitudes.
  double focus_median_mm = 0, focus_90_mm = 0;
  double focus_median_steps = 0, focus_90_steps = 0;  // divided by the step of the sweep
  double blur_ratio_median = 0, blur_ratio_90 = 0;    // relative
  double image_distance_median_um = 0, image_distance_90_um = 0;
  std::optional<double> floor_90_px;       // present if the floor was measured
  std::optional<double> recipe_median_mm;  // |zf| error of the paper's recipe, if it ran
  // recipe_median_mm over the median error of zf in the same trials
  std::optional<double> recipe_over_focus;
  double mean_seconds = 0;
  Coverage focus_depth, image_distance, blur_ratio;
};

Summary Summarise(const std::vector<const Trial*>& trials);

// Coverage of several groups together: inside, trials, p. The ratios stay 0.
Coverage Pooled(const std::vector<Coverage>& coverages);

}  // namespace thicklens::accuracy

#endif  // THICKLENS_TESTS_BENCHMARKS_ACCURACY_SUMMARY_H_
