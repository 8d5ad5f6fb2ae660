#ifndef THICKLENS_TOOLS_INTERRUPT_H_
#define THICKLENS_TOOLS_INTERRUPT_H_

#include <functional>
#include <string>
#include <vector>

#include "thicklens/base/cancel.h"

// How SIGINT, SIGTERM and SIGHUP end the program:
// - The first one cancels ProgramToken(). Loops look at it and end by Interrupted, so that
//   half-written outputs are removed on the way.
// - A library that computes in one call cannot be ended so. Where main has not ended the process
//   within kGraceSeconds, a thread removes what is unfinished and ends it, with the same exit code
//   and the same message. A second signal makes it do that at once.
// - A third one, or a second one where the system gave no such thread, ends the process without
//   removing anything.
namespace thicklens::tools {

constexpr double kGraceSeconds = 0.5;

// Handles these signals; not SIGHUP where it is ignored at the start, as nohup asks for. SIGPIPE
// and SIGXFSZ are ignored: a write that fails is told like any other failed write.
void CatchSignals();

// Starts the thread. Once, after CatchSignals.
void WatchSignals();

// The signals cancel this token. A command runs in a CancelScope of it.
const CancelToken* ProgramToken();

bool InterruptRequested();
void ThrowIfInterrupted();  // throws Interrupted

// One line: what an interrupted run has written.
std::string InterruptedText(const std::vector<std::string>& outputs_in_place);

// Main ends the process with that exit code, and says why. Does not return where the thread has
// begun to do so.
void BeginEnd(int exit_code);

// As long as it lives, the thread says these words (one line; empty: none) as a warning when it
// ends the process. One at a time; called from that thread.
class LastWords {
 public:
  explicit LastWords(std::function<std::string()> words);
  ~LastWords();
  LastWords(const LastWords&) = delete;
  LastWords& operator=(const LastWords&) = delete;
};

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_INTERRUPT_H_
