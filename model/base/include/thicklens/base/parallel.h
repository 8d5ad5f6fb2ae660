#ifndef THICKLENS_BASE_PARALLEL_H_
#define THICKLENS_BASE_PARALLEL_H_

#include <functional>

#include "thicklens/base/export.h"

namespace thicklens {

// Calls work(i) once for each i in [0, count) on up to `threads` threads (0: one per core). A free
// thread takes the next index. If calls throw, no new ones are started, and the exception of the
// smallest index is rethrown after the running calls have ended: errors do not depend on timing if
// the calls are independent. The threads check the caller's CancelToken, also before each call
// (thicklens/base/cancel.h).
THICKLENS_EXPORT void ParallelFor(int count, int threads, const std::function<void(int)>& work);

// The number of threads of the setting `threads`: the number of cores for 0, otherwise itself.
THICKLENS_EXPORT int ResolveThreads(int threads);

}  // namespace thicklens

#endif  // THICKLENS_BASE_PARALLEL_H_
