#ifndef THICKLENS_KERNELS_SRC_GUARDED_CHILD_H_
#define THICKLENS_KERNELS_SRC_GUARDED_CHILD_H_

#include <functional>
#include <string>

namespace thicklens::kernels {

// Hands text to the parent at once, so that it arrives even if the child crashes afterwards.
using Tell = std::function<void(const std::string&)>;

struct ChildOutcome {
  std::string told;     // all that the child told
  std::string failure;  // how it ended, if not well; with the last line it printed
};

// Runs `work` in a copy of this process (fork), which may abort, crash, hang or exit without harm
// to this one; it is killed after `limit_s` seconds. What it prints is caught. An exception counts
// as a failure.
//
// The copy has the calling thread alone: locks that other threads hold stay locked in it (not those
// of malloc), and threads of libraries are missing. So `work` must not use a library that this
// process has started already, OpenCL above all.
ChildOutcome RunInChild(const std::function<void(const Tell&)>& work, double limit_s);

// One line: control characters become spaces, runs of them one, none at the ends.
std::string OneLine(const std::string& text);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_SRC_GUARDED_CHILD_H_
