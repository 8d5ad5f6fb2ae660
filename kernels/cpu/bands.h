#ifndef THICKLENS_KERNELS_CPU_BANDS_H_
#define THICKLENS_KERNELS_CPU_BANDS_H_

#include <algorithm>
#include <cstdint>

#include "thicklens/base/cancel.h"

namespace thicklens::kernels {

// So many that none has fewer than `least` (as far as there are so many at all): a short one is
// done before another thread has woken up.
inline int BandCount(int count, int threads, int least) {
  return std::max(1, std::min(threads, count / std::max(1, least)));
}

// Calls work(band, first, last) for all of each band of [0, count), one piece after the other, the
// bands side by side, one thread each. `work` must not throw. Throws Interrupted if that is asked
// for, when the pieces that have begun are done; one that takes long may look at IsCancelled().
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
