#ifndef THICKLENS_BASE_RUN_COST_H_
#define THICKLENS_BASE_RUN_COST_H_

#include <optional>

#include "thicklens/base/export.h"
#include "thicklens/base/stopwatch.h"

namespace thicklens {

// Time and memory that a run has used so far, for its summary and its limit.
constexpr double kBytesPerMib = 1024.0 * 1024.0;
THICKLENS_EXPORT double ResidentBytes();  // resident memory of the whole process, now
// Returns freed memory that is kept for later use to the system, where the system supports it and
// the process holds more than StayingBytes. Getting it back takes time.
THICKLENS_EXPORT void ReturnFreedMemory(const std::optional<double>& limit_mib);
// Memory that stays with the process in any case; infinite without a limit.
THICKLENS_EXPORT double StayingBytes(const std::optional<double>& limit_mib);

}  // namespace thicklens

#endif  // THICKLENS_BASE_RUN_COST_H_
