#ifndef THICKLENS_TOOLS_BENCH_COST_PLANS_H_
#define THICKLENS_TOOLS_BENCH_COST_PLANS_H_

#include <vector>

#include "tools/options/estimate_plan.h"

namespace thicklens::tools {

// The choices that `bench accuracy` combines.
struct PlanGrid {
  bool full = false;       // combines each choice with each other, not one after the other
  bool opencl = false;     // a device is present
  bool base_only = false;  // each solver and prior with its defaults only
};
// Returns the plans without duplicates.
std::vector<estimator::EstimatePlan> PlansOf(const PlanGrid& grid);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_COST_PLANS_H_
