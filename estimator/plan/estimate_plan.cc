#include "thicklens/estimator/estimate_plan.h"

#include <fmt/format.h>

namespace thicklens::estimator {

std::string PlanName(const EstimatePlan& plan) {
  std::string name = plan.solver;
  if (!plan.prior.empty()) name += " " + plan.prior;
  if (!plan.block_solver.empty()) name += " " + plan.block_solver;
  if (plan.block_px) name += fmt::format(" {} px", *plan.block_px);
  if (plan.tolerance) name += fmt::format(", tolerance {:g}", *plan.tolerance);
  if (plan.double_precision) name += ", double";
  if (plan.on_opencl) name += ", opencl";
  return name;
}

}  // namespace thicklens::estimator
