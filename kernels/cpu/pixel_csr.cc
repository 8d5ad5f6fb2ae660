#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "kernels/cpu/bands.h"
#include "kernels/cpu/filter_loops.h"
#include "thicklens/base/index.h"
#include "thicklens/kernels/image_filter.h"

namespace thicklens::kernels {
namespace {

constexpr std::size_t kDotChunk = 4096;
constexpr int kMinDotChunks = 8;  // minimum number of a band

}  // namespace

template <typename Real>
PixelCsr<Real> Transposed(const PixelCsr<Real>& rows) {
  PixelCsr<Real> transposed;
  transposed.pixels = rows.pixels;
  // The position of the next entry of each pixel.
  std::vector<std::int64_t> next(Index(rows.pixels) + 1, 0);
  for (const std::int32_t index : rows.index) ++next[Index(index)];
  std::int64_t entries = 0;
  for (int pixel = 0; pixel < rows.pixels; ++pixel) {
    const std::int64_t count = next[Index(pixel)];
    next[Index(pixel)] = entries;
    if (count == 0) continue;
    transposed.pixel.push_back(pixel);
    transposed.start.push_back(entries);
    entries += count;
  }
  transposed.start.push_back(entries);
  transposed.index.resize(rows.index.size());
  transposed.weight.resize(rows.weight.size());
  for (std::size_t r = 0; r < rows.pixel.size(); ++r) {
    for (std::size_t e = Index(rows.start[r]); e < Index(rows.start[r + 1]); ++e) {
      const std::size_t to = Index(next[Index(rows.index[e])]++);
      transposed.index[to] = rows.pixel[r];
      transposed.weight[to] = rows.weight[e];
    }
  }
  return transposed;
}

template <typename Real>
double Dot(const Real* x, const Real* y, const Real* w, std::size_t count, int threads) {
  const FilterLoops<Real>& loops = BestFilterLoops<Real>();
  std::vector<double> sums((count + kDotChunk - 1) / kDotChunk);
  const int chunks = static_cast<int>(sums.size());
  ForBands(chunks, BandCount(chunks, threads, kMinDotChunks), [&](int, int first, int last) {
    for (std::size_t chunk = Index(first); chunk < Index(last); ++chunk) {
      const std::size_t at = chunk * kDotChunk;
      sums[chunk] = loops.dot(x + at, y + at, w != nullptr ? w + at : nullptr,
                              std::min(kDotChunk, count - at));
    }
  });
  double total = 0;
  for (const double sum : sums) total += sum;
  return total;
}

template PixelCsr<float> Transposed(const PixelCsr<float>&);
template PixelCsr<double> Transposed(const PixelCsr<double>&);
template double Dot(const float*, const float*, const float*, std::size_t, int);
template double Dot(const double*, const double*, const double*, std::size_t, int);

}  // namespace thicklens::kernels
