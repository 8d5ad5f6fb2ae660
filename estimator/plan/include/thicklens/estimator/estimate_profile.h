#ifndef THICKLENS_ESTIMATOR_ESTIMATE_PROFILE_H_
#define THICKLENS_ESTIMATOR_ESTIMATE_PROFILE_H_

#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/estimator/estimate_plan.h"
#include "thicklens/estimator/time_model.h"

namespace thicklens::estimator {

// Measurements of one plan.
struct PlanProfile {
  EstimatePlan plan;     // the plan that was measured
  TimeModel time_model;  // predicts its time
  // Relative errors of the times that the model predicts, including the reading time, for images of
  // sizes that the model was not made from: the median and the maximum.
  double median_error = 0, largest_error = 0;
  double psnr_db = 0;  // of the true views, mean over scenes and views
};

// The plans to choose from and their costs, measured once on one machine. File format:
// docs/file-formats.md.
struct EstimateProfile {
  std::string processor, build, date;  // build: version and compiler of the program
  int threads = 1;                     // number of threads of the measurement
  int runs = 1;                        // runs of each plan and image; the models use the median
  double probe_seconds = 0;            // of a small estimate on that machine
  double warping_psnr_db = 0;          // PSNR of views warped by the depth alone
  // Maximum of each quantity over the measured images.
  Workload largest;
  std::vector<PlanProfile> plans;  // the plans to choose from
  std::string from;                // the file it was read from, or "the profile that ships"
  bool is_own = false;             // measured by the user, not the default profile

  // The largest PSNR of the plans, dB.
  THICKLENS_EXPORT double best_psnr_db() const;
  // Returns whether the user measured it with that build, on such a processor and with as many
  // threads.
  THICKLENS_EXPORT bool WasMeasuredBy(const std::string& build_here,
                                      const std::string& processor_here, int threads_here) const;
  // How far the PSNR of a plan is below that of the best one, dB.
  double LossDb(const PlanProfile& plan) const { return best_psnr_db() - plan.psnr_db; }
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_ESTIMATE_PROFILE_H_
