#include "thicklens/estimator/estimate_profile.h"

#include <algorithm>

namespace thicklens::estimator {

double EstimateProfile::best_psnr_db() const {
  return std::max_element(
             plans.begin(), plans.end(),
             [](const PlanProfile& a, const PlanProfile& b) { return a.psnr_db < b.psnr_db; })
      ->psnr_db;
}

bool EstimateProfile::WasMeasuredBy(const std::string& build_here,
                                    const std::string& processor_here, int threads_here) const {
  return is_own && processor == processor_here && build == build_here && threads == threads_here;
}

}  // namespace thicklens::estimator
