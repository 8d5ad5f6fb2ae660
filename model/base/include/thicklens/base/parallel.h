#ifndef THICKLENS_BASE_PARALLEL_H_
#define THICKLENS_BASE_PARALLEL_H_

#include <functional>

namespace thicklens {

// Calls work(i) once for each i in [0, count) on up to `threads` threads (0: one per core), taking
// the next index when one is free. If calls throw, the exception of the smallest index is rethrown
// after the running calls have ended, and no new ones are started: errors do not depend on timing
// where every call is independent. The threads look at the caller's CancelToken, before each call
// as well (thicklens/base/cancel.h).
void ParallelFor(int count, int threads, const std::function<void(int)>& work);

// The number of threads that a setting of `threads` stands for.
int ResolveThreads(int threads);

}  // namespace thicklens

#endif  // THICKLENS_BASE_PARALLEL_H_
