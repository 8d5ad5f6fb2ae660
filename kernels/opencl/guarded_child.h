#ifndef THICKLENS_KERNELS_OPENCL_GUARDED_CHILD_H_
#define THICKLENS_KERNELS_OPENCL_GUARDED_CHILD_H_

#include <functional>
#include <string>

namespace thicklens::kernels {

// Hands text to the parent at once, so that it arrives even if the child crashes afterwards.
using Tell = std::function<void(const std::string&)>;

// Called several times a second while a child is waited for; what it throws ends the child and
// passes on.
using StopCheck = std::function<void()>;

struct ChildOutcome {
  std::string told;     // all that the child told
  std::string failure;  // how it ended, if not well; with the last line it printed
};

// Runs `work` in a copy of this process (fork), which may abort, crash, hang or exit without harm
// to this one; it is killed after `limit_s` seconds, with whatever it has started. What it prints
// is caught. An exception counts as a failure.
//
// Whether to stop is for this process to say, by its CancelToken and by `stop` (may be empty): the
// copy is out of reach of the terminal's Ctrl-C and ignores SIGINT, SIGTERM and SIGHUP. Should one
// of them end it all the same, Interrupted is thrown. It is killed when this process ends, however
// that ends.
//
// The copy has the calling thread alone: locks that other threads hold stay locked in it (not those
// of malloc), and threads of libraries are missing. So `work` must not use a library that this
// process has started already, OpenCL above all.
ChildOutcome RunInChild(const std::function<void(const Tell&)>& work, double limit_s,
                        const StopCheck& stop = {});

// One line: control characters become spaces, runs of them one, none at the ends.
std::string OneLine(const std::string& text);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_OPENCL_GUARDED_CHILD_H_
