// Seconds on a steady clock, which is never adjusted.
#ifndef THICKLENS_TOOLS_STOPWATCH_H_
#define THICKLENS_TOOLS_STOPWATCH_H_

#include <chrono>

namespace thicklens::tools {

using Clock = std::chrono::steady_clock;

inline double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_STOPWATCH_H_
