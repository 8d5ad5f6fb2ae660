#ifndef THICKLENS_ESTIMATOR_FUNCTIONAL_FUNCTIONAL_RUN_H_
#define THICKLENS_ESTIMATOR_FUNCTIONAL_FUNCTIONAL_RUN_H_

#include <string>

#include "thicklens/estimator/functional_solver.h"

namespace thicklens::estimator {

// What the solvers of the functional for a whole picture have in common.

// Throws Error for options (naming the solver) and inputs that do not fit; sets what the summary
// knows from the start.
void StartRun(const std::string& solver, const EstimateInput& input,
              const FunctionalOptions& options, FunctionalSummary* summary);
// Throws Error if the options allow less.
void RequireMemory(const FunctionalOptions& options, double bytes);
void FillOrigin(const std::string& method, const FunctionalSummary& summary, bool falloff,
                model::LightFieldOrigin* origin);
// Says how it went; iterations and residual are known. Throws Error if they led nowhere.
void EndRun(const std::string& solver, const FunctionalOptions& options,
            FunctionalSummary* summary);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_FUNCTIONAL_FUNCTIONAL_RUN_H_
