#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "kernels/cpu/bands.h"
#include "kernels/cpu/filter_loops.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/index.h"
#include "thicklens/kernels/image_filter.h"

namespace thicklens::kernels {
namespace {

// Minimum size of a band: large enough that a thread is worth waking, small enough that there are
// bands for all threads.
constexpr std::int64_t kMinRuns = 1 << 14;
constexpr int kMinRowsOfAThread = 512;
constexpr int kMinCopiedPx = 16384;  // minimum number per thread
constexpr int kPartPx = 64;          // parts of a row have multiples of this size
// A computation can be cancelled between pieces and between this number of rows, which need far
// less than 0.2 s.
constexpr int kPiecesOfAPart = 16;
constexpr std::size_t kRowsAtOnce = 1024;

template <typename Real>
RunRange<Real> RangeOf(const PixelBlockedCsr<Real>& runs, std::size_t first, std::size_t last) {
  return {runs.pixel.data(), runs.run.data(), runs.index.data(), runs.weight.data(), first, last};
}

// Returns the first row of a part; the parts have nearly equal numbers of runs.
template <typename Real>
std::size_t FirstRow(const PixelBlockedCsr<Real>& runs, int part, int parts) {
  if (part == parts) return runs.pixel.size();
  const std::int64_t run = runs.run.back() / parts * part;
  const auto row = std::lower_bound(runs.run.begin(), runs.run.end() - 1, run);
  return static_cast<std::size_t>(row - runs.run.begin());
}

// A copy of planes with the row stride of runs. It contains only the parts that the runs read.
template <typename Real>
class SpacedPlanes {
 public:
  SpacedPlanes(const PixelBlockedCsr<Real>& runs, int channels, int threads)
      : runs_(runs), row_(runs.stride_px()), values_(new Real[Index(channels) * Index(stride())]) {
    std::int64_t pixels = 0;
    for (const auto& part : runs.read) pixels += part.last - part.first;
    threads_ =
        static_cast<int>(std::clamp<std::int64_t>(pixels / kMinCopiedPx, 1, std::max(1, threads)));
  }

  std::ptrdiff_t stride() const { return std::ptrdiff_t{row_} * runs_.height_px; }
  Real* values() { return values_.get(); }

  void Copy(const Real* planes, std::ptrdiff_t plane_stride, int channels) {
    ForParts(channels, [&](int channel, std::ptrdiff_t pixel, int count, int beyond, Real* part) {
      std::copy_n(planes + channel * plane_stride + pixel, count, part);
      std::fill_n(part + count, beyond, Real{0});
    });
  }
  void Clear(int channels) {
    ForParts(channels, [&](int, std::ptrdiff_t, int count, int beyond, Real* part) {
      std::fill_n(part, count + beyond, Real{0});
    });
  }
  void AddTo(Real* planes, std::ptrdiff_t plane_stride, int channels) {
    ForParts(channels, [&](int channel, std::ptrdiff_t pixel, int count, int, const Real* part) {
      Real* to = planes + channel * plane_stride + pixel;
      for (int i = 0; i < count; ++i) to[i] += part[i];
    });
  }

 private:
  // Calls work(channel, pixel, count, beyond, part) with `count` pixels of the image from `pixel`
  // on and `beyond` places past the end of its row.
  template <typename Work>
  void ForParts(int channels, const Work& work) {
    ForBands(static_cast<int>(runs_.read.size()), threads_, [&](int, int first, int last) {
      for (int channel = 0; channel < channels; ++channel) {
        for (int i = first; i < last; ++i) {
          const auto& part = runs_.read[Index(i)];
          const int y = part.first / row_;
          const int x = part.first % row_;
          const int places = part.last - part.first;
          const int count = std::clamp(runs_.width_px - x, 0, places);
          work(channel, std::ptrdiff_t{y} * runs_.width_px + x, count, places - count,
               values() + channel * stride() + part.first);
        }
      }
    });
  }

  const PixelBlockedCsr<Real>& runs_;
  const int row_;
  int threads_ = 1;
  const std::unique_ptr<Real[]> values_;
};

template <typename Real>
void SetRead(PixelBlockedCsr<Real>* runs) {
  const int stride = runs->stride_px();
  const int of_row = (stride + kPartPx - 1) / kPartPx;
  std::vector<char> is_read(Index(of_row) * Index(runs->height_px), 0);
  std::int32_t y = 0;
  for (const std::int32_t index : runs->index) {
    const std::int32_t x = index - y * stride;
    if (x < 0 || x >= stride) y = index / stride;
    char* const row = is_read.data() + std::ptrdiff_t{y} * of_row;
    row[(index - y * stride) / kPartPx] = 1;
    row[(index - y * stride + kPixelsOfRun - 1) / kPartPx] = 1;
  }
  runs->read.clear();
  for (y = 0; y < runs->height_px; ++y) {
    const char* const row = is_read.data() + std::ptrdiff_t{y} * of_row;
    for (int i = 0; i < of_row; ++i) {
      if (row[i] == 0) continue;
      const std::int32_t first = y * stride + i * kPartPx;
      const std::int32_t last = y * stride + std::min((i + 1) * kPartPx, stride);
      if (i > 0 && row[i - 1] != 0) {
        runs->read.back().last = last;
      } else {
        runs->read.push_back({first, last});
      }
    }
  }
}

}  // namespace

// A band ends where all following rows read beyond the pixels that were read before the band began.
// The band after the next of any band then reads beyond the pixels of that band.
template <typename Real>
void SetBands(PixelBlockedCsr<Real>* runs) {
  const std::size_t rows = runs->pixel.size();
  // The first pixel that a row or a later row reads.
  std::vector<std::int32_t> first(rows + 1, std::numeric_limits<std::int32_t>::max());
  for (std::size_t r = rows; r-- > 0;) {
    ThrowIfCancelled();
    first[r] = first[r + 1];
    for (std::size_t n = Index(runs->run[r]); n < Index(runs->run[r + 1]); ++n) {
      first[r] = std::min(first[r], runs->index[n]);
    }
  }
  runs->band.assign(1, 0);
  std::int32_t read = -1, read_before = -1;  // last pixel read so far, and before the band
  for (std::size_t r = 0; r < rows; ++r) {
    ThrowIfCancelled();
    if (runs->run[r] - runs->run[runs->band.back()] >= kMinRuns && first[r] > read_before) {
      runs->band.push_back(r);
      read_before = read;
    }
    for (std::size_t n = Index(runs->run[r]); n < Index(runs->run[r + 1]); ++n) {
      read = std::max(read, runs->index[n] + (kPixelsOfRun - 1));
    }
  }
  if (rows > 0) runs->band.push_back(rows);
  SetRead(runs);
}

template <typename Real>
PixelBlockedCsr<Real> RunsOf(const PixelCsr<Real>& rows, int width_px) {
  PixelBlockedCsr<Real> runs;
  runs.width_px = width_px;
  runs.height_px = rows.pixels / std::max(1, width_px);
  runs.pixel = rows.pixel;
  runs.run.push_back(0);
  for (std::size_t r = 0; r < rows.pixel.size(); ++r) {
    ThrowIfCancelled();
    for (std::size_t e = Index(rows.start[r]); e < Index(rows.start[r + 1]); ++e) {
      const std::int32_t place =
          rows.index[e] / width_px * runs.stride_px() + rows.index[e] % width_px;
      if (static_cast<std::int64_t>(runs.index.size()) == runs.run.back() ||
          place < runs.index.back() || place >= runs.index.back() + kPixelsOfRun) {
        runs.index.push_back(place);
        runs.weight.resize(runs.weight.size() + Index(kPixelsOfRun), Real{0});
      }
      runs.weight[runs.weight.size() - Index(kPixelsOfRun) + Index(place - runs.index.back())] +=
          rows.weight[e];
    }
    runs.run.push_back(static_cast<std::int64_t>(runs.index.size()));
  }
  SetBands(&runs);
  return runs;
}

template <typename Real>
PixelCsr<Real> RowsOf(const PixelBlockedCsr<Real>& runs) {
  PixelCsr<Real> rows;
  rows.pixels = runs.width_px * runs.height_px;
  rows.pixel = runs.pixel;
  rows.start.push_back(0);
  for (std::size_t r = 0; r < runs.pixel.size(); ++r) {
    ThrowIfCancelled();
    for (std::size_t n = Index(runs.run[r]); n < Index(runs.run[r + 1]); ++n) {
      const std::int32_t first =
          runs.index[n] / runs.stride_px() * runs.width_px + runs.index[n] % runs.stride_px();
      for (int i = 0; i < kPixelsOfRun; ++i) {
        const Real weight = runs.weight[n * Index(kPixelsOfRun) + Index(i)];
        if (weight == 0) continue;
        rows.index.push_back(first + i);
        rows.weight.push_back(weight);
      }
    }
    rows.start.push_back(static_cast<std::int64_t>(rows.index.size()));
  }
  return rows;
}

template <typename Real>
void ApplyRuns(const PixelBlockedCsr<Real>& runs, const ImageIn<Real>& x, const ImageOut<Real>& y,
               int threads) {
  if (runs.pixel.empty()) return;
  const FilterLoops<Real>& loops = BestFilterLoops<Real>();
  SpacedPlanes<Real> copy(runs, std::min(kMaxChannels, x.channels), threads);
  const int parts = BandCount(static_cast<int>(runs.pixel.size()), threads, kMinRowsOfAThread);
  for (int first = 0; first < x.channels; first += kMaxChannels) {
    const int channels = std::min(kMaxChannels, x.channels - first);
    copy.Copy(x.values + first * x.plane_stride, x.plane_stride, channels);
    // Each part is computed in pieces, between which it can be cancelled.
    const int pieces = kPiecesOfAPart * parts;
    ForBands(pieces, parts, [&](int, int begin, int end) {
      loops.sum_runs(RangeOf(runs, FirstRow(runs, begin, pieces), FirstRow(runs, end, pieces)),
                     copy.values(), copy.stride(), channels, y.values + first * y.plane_stride,
                     y.plane_stride);
    });
  }
}

// Bands that share no pixel run in parallel, then the bands between them. The order in which the
// sums are added to a pixel is therefore fixed.
template <typename Real>
void AddTransposed(const PixelBlockedCsr<Real>& runs, const ImageIn<Real>& y,
                   const ImageOut<Real>& x, int threads) {
  if (runs.pixel.empty()) return;
  const FilterLoops<Real>& loops = BestFilterLoops<Real>();
  SpacedPlanes<Real> sums(runs, std::min(kMaxChannels, y.channels), threads);
  for (int first = 0; first < y.channels; first += kMaxChannels) {
    const int channels = std::min(kMaxChannels, y.channels - first);
    sums.Clear(channels);
    for (std::size_t odd = 0; odd < 2; ++odd) {
      const int bands = static_cast<int>((runs.band.size() - odd) / 2);
      ForBands(bands, std::max(1, std::min(bands, threads)), [&](int, int begin, int end) {
        for (int i = begin; i < end; ++i) {
          const std::size_t band = 2 * Index(i) + odd;
          for (std::size_t row = runs.band[band]; row < runs.band[band + 1] && !IsCancelled();
               row += kRowsAtOnce) {
            loops.spread_runs(RangeOf(runs, row, std::min(row + kRowsAtOnce, runs.band[band + 1])),
                              y.values + first * y.plane_stride, y.plane_stride, channels,
                              sums.values(), sums.stride());
          }
        }
      });
    }
    sums.AddTo(x.values + first * x.plane_stride, x.plane_stride, channels);
  }
}

#define THICKLENS_RUNS(Real)                                                      \
  template void SetBands(PixelBlockedCsr<Real>*);                                 \
  template PixelBlockedCsr<Real> RunsOf(const PixelCsr<Real>&, int);              \
  template PixelCsr<Real> RowsOf(const PixelBlockedCsr<Real>&);                   \
  template void ApplyRuns(const PixelBlockedCsr<Real>&, const ImageIn<Real>&,     \
                          const ImageOut<Real>&, int);                            \
  template void AddTransposed(const PixelBlockedCsr<Real>&, const ImageIn<Real>&, \
                              const ImageOut<Real>&, int);
THICKLENS_RUNS(float)
THICKLENS_RUNS(double)
#undef THICKLENS_RUNS

}  // namespace thicklens::kernels
