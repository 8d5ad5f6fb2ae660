#ifndef THICKLENS_TESTS_BENCHMARKS_ACCURACY_SUMMARY_H_
#define THICKLENS_TESTS_BENCHMARKS_ACCURACY_SUMMARY_H_

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "benchmarks/accuracy/trial.h"

namespace thicklens::accuracy {

// How one result's errors compare with what the calibration says of them.
struct Coverage {
  int inside = 0;            // |error| <= 1.96 sigma
  int trials = 0;            // that gave the result
  double binomial_p = 1;     // two-sided, of a coverage of 95 %
  double sigma_ratio = 0;    // median sigma over the scatter, 1.4826 median |error|
  double sigma_ratio_z = 0;  // 1 over 1.4826 median |error/sigma|
  double rms_z = 0;
  // Whether errors lean to one side: their mean, in sigmas, and how many of its own standard errors
  // that is (about a standard normal number where there is no bias).
  double mean_z = 0, mean_over_error = 0;
  double fraction() const { return trials > 0 ? static_cast<double>(inside) / trials : 0; }
};

// Some trials of one kind together: a cell of the table, or a case.
struct Summary {
  int trials = 0;
  int done = 0;
  int partial = 0;
  std::map<std::string, int> refusals;  // by reason
  // Errors' magnitudes: median and 90 %.
  double focus_median_mm = 0, focus_90_mm = 0;
  double focus_median_steps = 0, focus_90_steps = 0;  // over the sweep's step
  double blur_ratio_median = 0, blur_ratio_90 = 0;    // relative
  double image_distance_median_um = 0, image_distance_90_um = 0;
  std::optional<double> floor_90_px;        // where the floor was measured
  std::optional<double> recipe_median_mm;   // |zf| error of the source's recipe, where it ran
  std::optional<double> recipe_over_focus;  // that over the median error of zf in the same trials
  double mean_seconds = 0;
  Coverage focus_depth, image_distance, blur_ratio;
};

Summary Summarise(const std::vector<const Trial*>& trials);

// Of several groups' coverages together: inside, trials, p; the ratios are left at 0.
Coverage Pooled(const std::vector<Coverage>& coverages);

}  // namespace thicklens::accuracy

#endif  // THICKLENS_TESTS_BENCHMARKS_ACCURACY_SUMMARY_H_
