#ifndef THICKLENS_CALIB_REGISTRATION_CANCEL_CALLBACK_H_
#define THICKLENS_CALIB_REGISTRATION_CANCEL_CALLBACK_H_

#include <ceres/ceres.h>

#include "thicklens/base/cancel.h"

namespace thicklens::calib {

class CancelCallback : public ceres::IterationCallback {
 public:
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& /*summary*/) override {
    return IsCancelled() ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
  }
};

// Calls ceres::Solve. After a request to stop, it ends after the current iteration and throws
// Interrupted.
inline void SolveOrStop(ceres::Solver::Options options, ceres::Problem* problem,
                        ceres::Solver::Summary* summary) {
  ThrowIfCancelled();
  CancelCallback callback;
  options.callbacks.push_back(&callback);
  ceres::Solve(options, problem, summary);
  ThrowIfCancelled();
}

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_CANCEL_CALLBACK_H_
