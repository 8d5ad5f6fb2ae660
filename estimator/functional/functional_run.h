#ifndef THICKLENS_ESTIMATOR_FUNCTIONAL_FUNCTIONAL_RUN_H_
#define THICKLENS_ESTIMATOR_FUNCTIONAL_FUNCTIONAL_RUN_H_

#include <string>

#include "thicklens/estimator/functional_solver.h"

namespace thicklens::estimator {

// Steps that the solvers of the functional for a whole image have in common.

// Throws Error for options and a run (naming the solver) and inputs that do not fit. Sets the
// fields of the summary that are known at the start.
void StartRun(const std::string& solver, const EstimateInput& input,
              const WholeImageOptions& options, const SolverRun& run, FunctionalSummary* summary);
// Throws Error if the run allows fewer bytes.
void RequireMemory(const SolverRun& run, double bytes);
void FillOrigin(const std::string& method, const FunctionalSummary& summary, bool falloff,
                model::LightFieldOrigin* origin);
// Writes the message of the summary; its iterations and residual are known. Throws Error if the
// iterations diverged.
void EndRun(const std::string& solver, const WholeImageOptions& options,
            FunctionalSummary* summary);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_FUNCTIONAL_FUNCTIONAL_RUN_H_
