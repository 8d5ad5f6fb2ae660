#ifndef THICKLENS_KERNELS_CPU_BANDS_H_
#define THICKLENS_KERNELS_CPU_BANDS_H_

#include <algorithm>
#include <cstdint>

#include "thicklens/base/cancel.h"

namespace thicklens::kernels {

// Returns the number of bands. It is chosen so that no band has fewer than `least` items (unless
// `count` is smaller), because a short band is finished before another thread has woken up.
inline int BandCount(int count, int threads, int least) {
  return std::max(1, std::min(threads, count / std::max(1, least)));
}

// Calls work(band, first, last) for all items of each band of [0, count). The pieces of a band run
// one after the other; the bands run in parallel, one thread each. `work` must not throw. After a
// cancellation ForBands throws Interrupted when the pieces that have begun are done; a long piece
// may test IsCancelled().
template <typename Work>
void ForBands(int count, int bands, const Work& work) {
  constexpr int kPieces = 32;
  ThrowIfCancelled();
  const CancelToken* const token = CurrentCancelToken();
  const auto edge = [&](int i) { return static_cast<int>(std::int64_t{count} * i / bands); };
#pragma omp parallel for num_threads(bands) schedule(static, 1)
  for (int band = 0; band < bands; ++band) {
    const CancelScope scope(token);
    const int end = edge(band + 1);
    const int size = std::max(1, (end - edge(band)) / kPieces);
    for (int first = edge(band); first < end; first += size) {
      if (IsCancelled()) break;
      work(band, first, std::min(first + size, end));
    }
  }
  ThrowIfCancelled();
}

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_CPU_BANDS_H_
