#ifndef THICKLENS_KERNELS_OPENCL_ISOLATED_SUBPROCESS_H_
#define THICKLENS_KERNELS_OPENCL_ISOLATED_SUBPROCESS_H_

#include <functional>
#include <string>

namespace thicklens::kernels {

// Sends text to the parent at once, so that it arrives even if the child crashes afterwards.
using SubprocessReport = std::function<void(const std::string&)>;

// Called several times a second while the parent waits for a child. An exception that it throws
// ends the child and propagates.
using StopCheck = std::function<void()>;

struct SubprocessOutcome {
  std::string reported;  // all text that the child sent
  std::string failure;   // description of a failure, with the last line that the child printed;
                         // empty after a normal end
};

// Runs `work` in a copy of this process (fork), which may abort, crash, hang or exit without
// affecting this one. After `limit_s` seconds the copy is killed with all processes that it has
// started. Its printed output is captured. An exception counts as a failure.
//
// Only this process decides about a cancellation, by its CancelToken and by `stop` (may be empty).
// The copy does not receive the terminal's Ctrl-C and ignores SIGINT, SIGTERM and SIGHUP. If one of
// them ends it nevertheless, Interrupted is thrown. The copy is killed when this process ends for
// any reason.
//
// The copy contains only the calling thread. Locks that other threads hold remain locked in it
// (except those of malloc), and threads of libraries are missing. `work` must therefore not use a
// library that this process has already started, in particular OpenCL.
SubprocessOutcome RunInSubprocess(const std::function<void(const SubprocessReport&)>& work,
                                  double limit_s, const StopCheck& stop = {});

// Converts text to one line: each run of control characters and spaces becomes one space, and none
// is left at the ends.
std::string OneLine(const std::string& text);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_OPENCL_ISOLATED_SUBPROCESS_H_
