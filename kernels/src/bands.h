#ifndef THICKLENS_KERNELS_SRC_BANDS_H_
#define THICKLENS_KERNELS_SRC_BANDS_H_

#include <algorithm>
#include <cstdint>

namespace thicklens::kernels {

// So many that none has fewer than `least` (as far as there are so many at all): a short one is
// done before another thread has woken up.
inline int BandCount(int count, int threads, int least) {
  return std::max(1, std::min(threads, count / std::max(1, least)));
}

// Calls work(band, first, last) for each band of [0, count), side by side, one thread each. `work`
// must not throw.
template <typename Work>
void ForBands(int count, int bands, const Work& work) {
  const auto edge = [&](int i) { return static_cast<int>(std::int64_t{count} * i / bands); };
#pragma omp parallel for num_threads(bands) schedule(static, 1)
  for (int band = 0; band < bands; ++band) work(band, edge(band), edge(band + 1));
}

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_SRC_BANDS_H_
