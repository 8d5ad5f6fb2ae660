#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "bands.h"
#include "filter_loops.h"
#include "thicklens/kernels/picture_filter.h"

namespace thicklens::kernels {
namespace {

// Of a band: enough that a thread is not woken up for little, few enough that there are bands for
// all threads.
constexpr std::int64_t kLeastRuns = 1 << 14;
constexpr int kLeastRowsOfAThread = 512;
constexpr int kLeastCopiedPx = 16384;  // by a thread

std::size_t Index(std::int64_t i) { return static_cast<std::size_t>(i); }

template <typename Real>
RunRange<Real> RangeOf(const PixelRuns<Real>& runs, std::size_t first, std::size_t last) {
  return {runs.pixel.data(), runs.run.data(), runs.index.data(), runs.weight.data(), first, last};
}

// The first row of a part, so that all parts have about as many runs.
template <typename Real>
std::size_t FirstRow(const PixelRuns<Real>& runs, int part, int parts) {
  if (part == parts) return runs.pixel.size();
  const std::int64_t run = runs.run.back() / parts * part;
  const auto row = std::lower_bound(runs.run.begin(), runs.run.end() - 1, run);
  return static_cast<std::size_t>(row - runs.run.begin());
}

// A copy of planes with the rows that runs read.
template <typename Real>
class SpacedPlanes {
 public:
  SpacedPlanes(const PixelRuns<Real>& runs, int channels, int threads)
      : width_(runs.width_px),
        height_(runs.height_px),
        row_(runs.stride_px()),
        threads_(BandCount(height_, threads, kLeastCopiedPx / std::max(1, width_))),
        values_(new Real[Index(channels) * Index(stride())]) {}

  std::ptrdiff_t stride() const { return std::ptrdiff_t{row_} * height_; }
  Real* values() { return values_.get(); }

  void Copy(const Real* planes, std::ptrdiff_t plane_stride, int channels) {
    ForRows(channels, [&](int channel, int y, Real* row) {
      const Real* from = planes + channel * plane_stride + std::ptrdiff_t{y} * width_;
      std::copy_n(from, width_, row);
      std::fill(row + width_, row + row_, Real{0});
    });
  }
  void Clear(int channels) {
    ForRows(channels, [&](int, int, Real* row) { std::fill(row, row + row_, Real{0}); });
  }
  void AddTo(Real* planes, std::ptrdiff_t plane_stride, int channels) {
    ForRows(channels, [&](int channel, int y, const Real* row) {
      Real* to = planes + channel * plane_stride + std::ptrdiff_t{y} * width_;
      for (int x = 0; x < width_; ++x) to[x] += row[x];
    });
  }

 private:
  template <typename Work>
  void ForRows(int channels, const Work& work) {
    ForBands(height_, threads_, [&](int, int first, int last) {
      for (int channel = 0; channel < channels; ++channel) {
        for (int y = first; y < last; ++y) {
          work(channel, y, values() + channel * stride() + std::ptrdiff_t{y} * row_);
        }
      }
    });
  }

  const int width_, height_, row_, threads_;
  const std::unique_ptr<Real[]> values_;
};

}  // namespace

// A band ends where all rows that come read beyond what was read before the band began: then the
// next but one of any band reads beyond what that has read.
template <typename Real>
void SetBands(PixelRuns<Real>* runs) {
  const std::size_t rows = runs->pixel.size();
  // The first pixel that a row, or one that comes after it, reads.
  std::vector<std::int32_t> first(rows + 1, std::numeric_limits<std::int32_t>::max());
  for (std::size_t r = rows; r-- > 0;) {
    first[r] = first[r + 1];
    for (std::size_t n = Index(runs->run[r]); n < Index(runs->run[r + 1]); ++n) {
      first[r] = std::min(first[r], runs->index[n]);
    }
  }
  runs->band.assign(1, 0);
  std::int32_t read = -1, read_before = -1;  // the last pixel: by now, and before the band
  for (std::size_t r = 0; r < rows; ++r) {
    if (runs->run[r] - runs->run[runs->band.back()] >= kLeastRuns && first[r] > read_before) {
      runs->band.push_back(r);
      read_before = read;
    }
    for (std::size_t n = Index(runs->run[r]); n < Index(runs->run[r + 1]); ++n) {
      read = std::max(read, runs->index[n] + (kPixelsOfRun - 1));
    }
  }
  if (rows > 0) runs->band.push_back(rows);
}

template <typename Real>
PixelRuns<Real> RunsOf(const PixelRows<Real>& rows, int width_px) {
  PixelRuns<Real> runs;
  runs.width_px = width_px;
  runs.height_px = rows.pixels / std::max(1, width_px);
  runs.pixel = rows.pixel;
  runs.run.push_back(0);
  for (std::size_t r = 0; r < rows.pixel.size(); ++r) {
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
PixelRows<Real> RowsOf(const PixelRuns<Real>& runs) {
  PixelRows<Real> rows;
  rows.pixels = runs.width_px * runs.height_px;
  rows.pixel = runs.pixel;
  rows.start.push_back(0);
  for (std::size_t r = 0; r < runs.pixel.size(); ++r) {
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
void ApplyRuns(const PixelRuns<Real>& runs, const PictureIn<Real>& x, const PictureOut<Real>& y,
               int threads) {
  if (runs.pixel.empty()) return;
  const FilterLoops<Real>& loops = BestFilterLoops<Real>();
  SpacedPlanes<Real> copy(runs, std::min(kMostChannels, x.channels), threads);
  const int parts = BandCount(static_cast<int>(runs.pixel.size()), threads, kLeastRowsOfAThread);
  for (int first = 0; first < x.channels; first += kMostChannels) {
    const int channels = std::min(kMostChannels, x.channels - first);
    copy.Copy(x.values + first * x.plane_stride, x.plane_stride, channels);
    ForBands(parts, parts, [&](int part, int, int) {
      loops.sum_runs(RangeOf(runs, FirstRow(runs, part, parts), FirstRow(runs, part + 1, parts)),
                     copy.values(), copy.stride(), channels, y.values + first * y.plane_stride,
                     y.plane_stride);
    });
  }
}

// Bands that share no pixel side by side, and then those between them: the order in which a pixel
// gets its sums is always the same.
template <typename Real>
void AddTransposed(const PixelRuns<Real>& runs, const PictureIn<Real>& y, const PictureOut<Real>& x,
                   int threads) {
  if (runs.pixel.empty()) return;
  const FilterLoops<Real>& loops = BestFilterLoops<Real>();
  SpacedPlanes<Real> sums(runs, std::min(kMostChannels, y.channels), threads);
  for (int first = 0; first < y.channels; first += kMostChannels) {
    const int channels = std::min(kMostChannels, y.channels - first);
    sums.Clear(channels);
    for (std::size_t odd = 0; odd < 2; ++odd) {
      const int bands = static_cast<int>((runs.band.size() - odd) / 2);
      ForBands(bands, std::max(1, std::min(bands, threads)), [&](int, int begin, int end) {
        for (int i = begin; i < end; ++i) {
          const std::size_t band = 2 * Index(i) + odd;
          loops.spread_runs(RangeOf(runs, runs.band[band], runs.band[band + 1]),
                            y.values + first * y.plane_stride, y.plane_stride, channels,
                            sums.values(), sums.stride());
        }
      });
    }
    sums.AddTo(x.values + first * x.plane_stride, x.plane_stride, channels);
  }
}

#define THICKLENS_RUNS(Real)                                                                       \
  template void SetBands(PixelRuns<Real>*);                                                        \
  template PixelRuns<Real> RunsOf(const PixelRows<Real>&, int);                                    \
  template PixelRows<Real> RowsOf(const PixelRuns<Real>&);                                         \
  template void ApplyRuns(const PixelRuns<Real>&, const PictureIn<Real>&, const PictureOut<Real>&, \
                          int);                                                                    \
  template void AddTransposed(const PixelRuns<Real>&, const PictureIn<Real>&,                      \
                              const PictureOut<Real>&, int);
THICKLENS_RUNS(float)
THICKLENS_RUNS(double)
#undef THICKLENS_RUNS

}  // namespace thicklens::kernels
