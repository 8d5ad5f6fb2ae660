#ifndef THICKLENS_TOOLS_PRICE_PLANS_H_
#define THICKLENS_TOOLS_PRICE_PLANS_H_

#include <vector>

#include "estimate_plan.h"

namespace thicklens::tools {

// What the price list is made of.
struct PlanGrid {
  bool full = false;       // each choice with each other, not one after the other
  bool opencl = false;     // a device is there
  bool base_only = false;  // each solver and prior as it is by itself
};
// No plan twice.
std::vector<EstimatePlan> PlansOf(const PlanGrid& grid);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_PRICE_PLANS_H_
