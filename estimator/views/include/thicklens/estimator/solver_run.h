#ifndef THICKLENS_ESTIMATOR_SOLVER_RUN_H_
#define THICKLENS_ESTIMATOR_SOLVER_RUN_H_

#include <optional>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/base/progress.h"

namespace thicklens::kernels {
class Backend;
}  // namespace thicklens::kernels

namespace thicklens::estimator {

class BlockStore;
struct SceneViewSink;

// The way in which a solver is run; what it solves is in its options. Every solver is called with
// the problem, its options, the run and the summary, in this order. It is cancelled by the
// CancelScope of the calling thread (thicklens/base/cancel.h). Backend, store and sink are not
// owned and must outlive the call.
struct SolverRun {
  int threads = 0;  // >= 0; 0: one per core
  // Limit for the whole process, finite, > 0. The scene solver then solves in as many bands as it
  // needs, and the block solver chooses the size of its blocks. A solver that needs more refuses.
  std::optional<double> memory_limit_mib;
  // The device that computes; null: the processor. The solvers of the functional for a whole image
  // always compute on the processor.
  kernels::Backend* backend = nullptr;
  ProgressFunction progress;    // gets the steps that are done; empty: none
  BlockStore* store = nullptr;  // keeps finished blocks and finds them again; block solver only
  // Gets the views one by one as they are made, so that they are never held all together. The light
  // field that is returned has no views. Scene solver only.
  const SceneViewSink* sink = nullptr;

  // Returns false, and the reason in `why` (may be null), if a member is not in its range.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// The part of the summary that all solvers have.
struct SolverResult {
  std::string message = "not run";  // how it ended, one line
  // Whether the iterations reached their tolerance; direct solvers: true.
  bool converged = false;
  // |A x - b|/|b| of the solved system, recomputed from the solution; the maximum over the parts in
  // which it was solved (channels, blocks, bands).
  double relative_residual = 0;
  double setup_seconds = 0;  // geometry, priors, and the choice of the parts
  double solve_seconds = 0;  // time of the solution
  double views_seconds = 0;  // making the views from the solution; 0 where they are the solution
  // Maximum memory that the whole process is expected to hold, including what it held before.
  double predicted_memory_mib = 0;
  int threads = 0;     // number of threads that computed
  std::string device;  // "cpu", "opencl:0:0"
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SOLVER_RUN_H_
