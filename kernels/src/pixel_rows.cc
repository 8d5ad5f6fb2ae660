#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "bands.h"
#include "filter_loops.h"
#include "thicklens/kernels/picture_filter.h"

namespace thicklens::kernels {
namespace {

constexpr std::size_t kDotChunk = 4096;
constexpr int kLeastDotChunks = 8;   // of a band
constexpr int kLeastEntries = 8192;  // of a band
constexpr int kLeastPixels = 16384;  // of a band, to be interleaved

std::size_t Index(std::int64_t i) { return static_cast<std::size_t>(i); }

// The first row of a band, so that all bands have about as many entries.
template <typename Real>
std::size_t FirstRow(const PixelRows<Real>& rows, int band, int bands) {
  if (band == bands) return rows.pixel.size();
  const std::int64_t entries = rows.start.back() / bands * band;
  const auto row = std::lower_bound(rows.start.begin(), rows.start.end() - 1, entries);
  return static_cast<std::size_t>(row - rows.start.begin());
}

template <typename Real>
void SumRows(const PixelRows<Real>& rows, bool add, const PictureIn<Real>& x,
             const PictureOut<Real>& y, int threads) {
  if (rows.pixel.empty()) return;
  const FilterLoops<Real>& loops = BestFilterLoops<Real>();
  std::unique_ptr<Real[]> interleaved;
  if (x.channels > 1) interleaved.reset(new Real[Index(rows.pixels) * kMostChannels]);
  for (int first = 0; first < x.channels; first += kMostChannels) {
    const int channels = std::min(kMostChannels, x.channels - first);
    const Real* from = x.values + first * x.plane_stride;
    Real* to = y.values + first * y.plane_stride;
    if (channels > 1) {
      ForBands(rows.pixels, BandCount(rows.pixels, threads, kLeastPixels),
               [&](int, int begin, int end) {
                 loops.interleave(from + begin, x.plane_stride, channels, Index(end - begin),
                                  interleaved.get() + std::ptrdiff_t{kMostChannels} * begin);
               });
    }
    const int bands = static_cast<int>(std::max<std::int64_t>(
        1, std::min<std::int64_t>(threads, rows.start.back() / kLeastEntries)));
    ForBands(bands, bands, [&](int band, int, int) {
      RowRange<Real> range{rows.pixel.data(), rows.start.data(), rows.index.data(),
                           rows.weight.data()};
      range.first = FirstRow(rows, band, bands);
      range.last = FirstRow(rows, band + 1, bands);
      if (channels > 1) {
        loops.sum_row_entries_of_4(range, interleaved.get(), add, channels, to, y.plane_stride);
      } else {
        loops.sum_row_entries(range, from, add, to);
      }
    });
  }
}

}  // namespace

template <typename Real>
PixelRows<Real> Transposed(const PixelRows<Real>& rows) {
  PixelRows<Real> transposed;
  transposed.pixels = rows.pixels;
  // Where the entries of each pixel go.
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
void ApplyRows(const PixelRows<Real>& rows, const PictureIn<Real>& x, const PictureOut<Real>& y,
               int threads) {
  SumRows(rows, false, x, y, threads);
}

template <typename Real>
void AddRows(const PixelRows<Real>& rows, const PictureIn<Real>& x, const PictureOut<Real>& y,
             int threads) {
  SumRows(rows, true, x, y, threads);
}

template <typename Real>
double Dot(const Real* x, const Real* y, const Real* w, std::size_t count, int threads) {
  const FilterLoops<Real>& loops = BestFilterLoops<Real>();
  std::vector<double> sums((count + kDotChunk - 1) / kDotChunk);
  const int chunks = static_cast<int>(sums.size());
  ForBands(chunks, BandCount(chunks, threads, kLeastDotChunks), [&](int, int first, int last) {
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

template PixelRows<float> Transposed(const PixelRows<float>&);
template PixelRows<double> Transposed(const PixelRows<double>&);
template void ApplyRows(const PixelRows<float>&, const PictureIn<float>&, const PictureOut<float>&,
                        int);
template void ApplyRows(const PixelRows<double>&, const PictureIn<double>&,
                        const PictureOut<double>&, int);
template void AddRows(const PixelRows<float>&, const PictureIn<float>&, const PictureOut<float>&,
                      int);
template void AddRows(const PixelRows<double>&, const PictureIn<double>&, const PictureOut<double>&,
                      int);
template double Dot(const float*, const float*, const float*, std::size_t, int);
template double Dot(const double*, const double*, const double*, std::size_t, int);

}  // namespace thicklens::kernels
