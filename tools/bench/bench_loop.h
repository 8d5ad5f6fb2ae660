#ifndef THICKLENS_TOOLS_BENCH_BENCH_LOOP_H_
#define THICKLENS_TOOLS_BENCH_BENCH_LOOP_H_

#include <cstddef>
#include <functional>

#include "tools/system/progress_line.h"

namespace thicklens::tools {

// Measures each of `count` items once per round, so that other load of the machine affects all
// items alike. Shows the progress after each measurement, and throws Interrupted if the program is
// cancelled.
void MeasureInRounds(int rounds, std::size_t count, ProgressLine* progress,
                     const std::function<void(int round, std::size_t item)>& measure);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_BENCH_LOOP_H_
