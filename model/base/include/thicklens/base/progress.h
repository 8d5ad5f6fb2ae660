#ifndef THICKLENS_BASE_PROGRESS_H_
#define THICKLENS_BASE_PROGRESS_H_

#include <functional>

namespace thicklens {

// How a long call reports that `done` of `total` steps are done. It is called from any thread, but
// never by two threads at once. An exception that it throws ends the call, which throws it in turn.
// A report is no way to cancel a call: each call that reports steps is also stopped by the token of
// its thread's CancelScope (thicklens/base/cancel.h), with and without a report.
using ProgressFunction = std::function<void(int done, int total)>;

}  // namespace thicklens

#endif  // THICKLENS_BASE_PROGRESS_H_
