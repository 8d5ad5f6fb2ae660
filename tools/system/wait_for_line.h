#ifndef THICKLENS_TOOLS_SYSTEM_WAIT_FOR_LINE_H_
#define THICKLENS_TOOLS_SYSTEM_WAIT_FOR_LINE_H_

namespace thicklens::tools {

// Waits for a line on standard input.
class LineWaiter {
 public:
  // Waits for at most so many seconds, or until a signal arrives. Returns true once a line (also an
  // empty one) has been read. An input that is closed or at its end never gives one.
  bool WaitFor(double seconds);

 private:
  bool is_closed_ = false;
};

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_SYSTEM_WAIT_FOR_LINE_H_
