#ifndef THICKLENS_BASE_ITERATION_PROGRESS_H_
#define THICKLENS_BASE_ITERATION_PROGRESS_H_

#include <algorithm>
#include <mutex>

#include "thicklens/base/cancel.h"
#include "thicklens/base/progress.h"

namespace thicklens {

// Progress over views and iterations, counted together from any thread. There may be fewer or more
// iterations than expected. Each count is a safe point: it throws Interrupted if the token of its
// thread was cancelled.
class IterationProgress {
 public:
  // `report` may be empty, may throw, and must outlive this.
  IterationProgress(const ProgressFunction& report, int total) : report_(report), total_(total) {}

  // Reports the present count again. Throws Interrupted as every count does.
  void Report() { Advance(0); }
  // Counts one step.
  void Count() { Advance(1); }
  void CountUpTo(int limit) { Advance(done_ < limit ? 1 : 0); }  // for a single counting thread
  // Counts the steps up to `done`, if fewer are done.
  void SkipTo(int done) { Advance(std::max(0, done - done_)); }

 private:
  void Advance(int steps) {
    const std::lock_guard<std::mutex> lock(mutex_);
    done_ = std::min(total_, done_ + steps);
    if (report_) report_(done_, total_);
    ThrowIfCancelled();
  }

  const ProgressFunction& report_;
  const int total_;
  std::mutex mutex_;
  int done_ = 0;
};

}  // namespace thicklens

#endif  // THICKLENS_BASE_ITERATION_PROGRESS_H_
