#ifndef THICKLENS_TOOLS_SYSTEM_WAIT_FOR_LINE_H_
#define THICKLENS_TOOLS_SYSTEM_WAIT_FOR_LINE_H_

namespace thicklens::tools {

// Waits for a line on standard input.
class LineWaiter {
 public:
  // Waits for at most so many seconds, or until a signal arrives. Returns true once a line (also an
  // empty one) has been read. An input that is closed, at its end or cannot be read never gives
  // one, and a terminal gives none while this program runs in its background.
  bool WaitFor(double seconds);

 private:
  bool is_closed_ = false;
};

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_SYSTEM_WAIT_FOR_LINE_H_
