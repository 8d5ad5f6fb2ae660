#ifndef THICKLENS_TESTS_ESTIMATOR_SOLVER_RUNS_H_
#define THICKLENS_TESTS_ESTIMATOR_SOLVER_RUNS_H_

#include "thicklens/estimator/solver_run.h"

namespace thicklens::estimator {

// Ways to run a solver that differ from the default in one member.

inline SolverRun RunOnThreads(int threads) {
  SolverRun run;
  run.threads = threads;
  return run;
}

inline SolverRun RunOn(kernels::Backend* backend) {
  SolverRun run;
  run.backend = backend;
  return run;
}

// Keeps the sink by reference.
inline SolverRun RunTo(const SceneViewSink& sink) {
  SolverRun run;
  run.sink = &sink;
  return run;
}

}  // namespace thicklens::estimator

#endif  // THICKLENS_TESTS_ESTIMATOR_SOLVER_RUNS_H_
