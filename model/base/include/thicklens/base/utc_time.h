#ifndef THICKLENS_BASE_UTC_TIME_H_
#define THICKLENS_BASE_UTC_TIME_H_

#include <string>

#include "thicklens/base/export.h"

namespace thicklens {

// Returns the current time, UTC, as in 2026-01-31T12:00:00Z.
THICKLENS_EXPORT std::string NowIso8601();

}  // namespace thicklens

#endif  // THICKLENS_BASE_UTC_TIME_H_
