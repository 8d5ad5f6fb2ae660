#ifndef THICKLENS_ESTIMATOR_BASE_RUN_COST_H_
#define THICKLENS_ESTIMATOR_BASE_RUN_COST_H_

#include <chrono>
#include <optional>

namespace thicklens::estimator {

// What a run has cost so far, for its summary and its limit.
constexpr double kBytesPerMib = 1024.0 * 1024.0;
using Clock = std::chrono::steady_clock;
double SecondsSince(Clock::time_point start);
double ResidentBytes();  // of the whole process, now
// What was freed, but kept for later use, goes back to the system where that is possible and the
// process holds so much of what it may that it could be missed: to get it back takes time.
void ReturnFreedMemory(const std::optional<double>& limit_mib);
// So much stays with the process in any case; infinite without a limit.
double StayingBytes(const std::optional<double>& limit_mib);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_BASE_RUN_COST_H_
