#ifndef THICKLENS_ESTIMATOR_ESTIMATE_PLAN_H_
#define THICKLENS_ESTIMATOR_ESTIMATE_PLAN_H_

#include <optional>
#include <string>

#include "thicklens/base/export.h"

namespace thicklens::estimator {

// One way to a light field: what determines how it is computed, but not what is
// computed.
struct EstimatePlan {
  std::string solver = "scene";     // "scene", "blocks", "functional" or "grid"
  std::string prior;                // solver scene only; otherwise empty
  std::string block_solver;         // solver blocks only; otherwise empty
  std::optional<double> tolerance;  // absent: the solver's default
  bool double_precision = false;    // compute in double
  std::optional<int> block_px;      // edge of a block, px; solver blocks only
  bool on_opencl = false;           // on the best OpenCL device instead of the processor
};

// Returns a unique name, as a user would type it: "scene tv", "scene tv, tolerance 0.01", "blocks
// umfpack 16 px".
THICKLENS_EXPORT std::string PlanName(const EstimatePlan& plan);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_ESTIMATE_PLAN_H_
