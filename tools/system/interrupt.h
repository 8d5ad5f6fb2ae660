#ifndef THICKLENS_TOOLS_SYSTEM_INTERRUPT_H_
#define THICKLENS_TOOLS_SYSTEM_INTERRUPT_H_

#include <functional>
#include <string>
#include <vector>

#include "thicklens/base/cancel.h"

// SIGINT, SIGTERM and SIGHUP end the program as follows:
// - The first signal cancels ProgramToken(). Loops check it and end by Interrupted, so that
//   half-written outputs are removed on the way.
// - A library call that computes for long cannot be ended in this way. If main has not ended the
//   process within kGraceSeconds, a thread removes unfinished outputs and ends the process with the
//   same exit code and the same message. A second signal makes it do so at once.
// - A third signal, or a second one if the system could not start this thread, ends the process
//   without removing anything.
namespace thicklens::tools {

constexpr double kGraceSeconds = 0.5;

// Handles these signals, except SIGHUP if it is ignored at the start, as with nohup. SIGPIPE and
// SIGXFSZ are ignored: a failed write is then reported like any other failed write.
void CatchSignals();

// Starts the thread. Call this once, after CatchSignals.
void WatchSignals();

// The token that the signals cancel. A command runs in a CancelScope of it.
const CancelToken* ProgramToken();

// Returns one line on the outputs that an interrupted run has written.
std::string InterruptedText(const std::vector<std::string>& outputs_in_place);

// Announces that main ends the process with that exit code and reports why. Does not return if the
// thread has already started to end the process.
void BeginEnd(int exit_code);

// While an object of this class exists, the first SIGINT does not end the program: it asks the
// command to finish with what it has. The next one ends the program as usual. Only one object may
// exist at a time.
class FinishOnInterrupt {
 public:
  FinishOnInterrupt();
  ~FinishOnInterrupt();
  FinishOnInterrupt(const FinishOnInterrupt&) = delete;
  FinishOnInterrupt& operator=(const FinishOnInterrupt&) = delete;

  // Whether SIGINT has arrived.
  bool IsAsked() const;
};

// While an object of this class exists, the thread prints the returned words (one line; empty:
// none) as a warning when it ends the process. Only one object may exist at a time. The function is
// called from that thread.
class LastWords {
 public:
  explicit LastWords(std::function<std::string()> words);
  ~LastWords();
  LastWords(const LastWords&) = delete;
  LastWords& operator=(const LastWords&) = delete;
};

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_SYSTEM_INTERRUPT_H_
