// Seconds on a steady clock, which is never adjusted.
#ifndef THICKLENS_BASE_STOPWATCH_H_
#define THICKLENS_BASE_STOPWATCH_H_

#include <chrono>

namespace thicklens {

using Clock = std::chrono::steady_clock;  // A clock that is never adjusted.

// Returns the seconds between `start` and now.
inline double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

}  // namespace thicklens

#endif  // THICKLENS_BASE_STOPWATCH_H_
