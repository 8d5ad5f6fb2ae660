#include "tools/bench/bench_loop.h"

#include "thicklens/base/cancel.h"

namespace thicklens::tools {

void MeasureInRounds(int rounds, std::size_t count, ProgressLine* progress,
                     const std::function<void(int round, std::size_t item)>& measure) {
  int done = 0;
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t item = 0; item < count; ++item) {
      ThrowIfCancelled();
      measure(round, item);
      progress->Show(++done, rounds * static_cast<int>(count));
    }
  }
}

}  // namespace thicklens::tools
