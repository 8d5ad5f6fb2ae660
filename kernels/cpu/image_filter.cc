#include "thicklens/kernels/image_filter.h"

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <vector>

#include "kernels/cpu/bands.h"
#include "kernels/cpu/filter_loops.h"
#include "thicklens/base/index.h"

namespace thicklens::kernels {
namespace {

constexpr int kMinBandPx = 4096;

// Computes rows of the result, one after the other, and has the memory for this.
template <typename Real>
class RowFilter {
 public:
  RowFilter(const VaryingFilter<Real>& filter, bool transposed, const ImageIn<Real>& x,
            const ImageOut<Real>& y);
  void Filter(int row) {
    if (filter_.axis == Axis::kAcross) {
      transposed_ ? AcrossTransposed(row) : Across(row);
    } else {
      transposed_ ? DownTransposed(row) : Down(row);
    }
  }

 private:
  struct Block {
    int x = 0, count = 0;  // first pixel and number of pixels
    int radius = 0;
    const Real* coefficients = nullptr;

    int terms() const { return 2 * radius + 1; }
    const Real* of(int n) const {
      return coefficients + std::ptrdiff_t{n + radius} * kFilterBlockPx;
    }
    // Distance to the same coefficient of a later block, if that has the same radius. It is large
    // enough for the latency of the memory.
    std::ptrdiff_t ahead() const {
      const std::ptrdiff_t size = std::ptrdiff_t{terms()} * kFilterBlockPx;
      return size * (1 + 1536 / size);
    }
  };
  // Unused elements behind written memory, so that no other thread writes to the same cache line.
  static constexpr std::size_t kApart = 32;

  Block BlockAt(int row, int column) const {
    const std::size_t block = Index(row) * Index(filter_.blocks_in_row()) + Index(column);
    const int x = column * kFilterBlockPx;
    return {x, std::min(kFilterBlockPx, filter_.width_px - x), filter_.radius_px[block],
            filter_.coefficients.data() + filter_.start[block]};
  }
  // Calls work(first, count) for every group of channels that the loops process together.
  template <typename Work>
  void ForChannels(const Work& work) const {
    for (int first = 0; first < x_.channels; first += kMaxChannels) {
      work(first, std::min(kMaxChannels, x_.channels - first));
    }
  }
  const Real* In(int channel, int row, int x) const {
    return x_.values + channel * x_.plane_stride + std::ptrdiff_t{row} * filter_.width_px + x;
  }
  Real* Out(int channel, int row, int x) const {
    return y_.values + channel * y_.plane_stride + std::ptrdiff_t{row} * filter_.width_px + x;
  }
  // Sizes per channel: the window has a block's pixels and two radii on either side; the sums have
  // the pixels to which a block contributes; the row has all pixels and one radius on either side.
  int window_stride() const { return kFilterBlockPx + 4 * most_radius_; }
  int sums_stride() const { return kFilterBlockPx + 2 * most_radius_; }
  int row_stride() const { return filter_.width_px + 2 * most_radius_; }
  Real* Window(int channel) {
    return window_.data() + std::ptrdiff_t{channel} * window_stride() + 2 * most_radius_;
  }
  Real* Row(int channel) {
    return row_.data() + std::ptrdiff_t{channel} * row_stride() + most_radius_;
  }

  void Across(int row);
  void AcrossTransposed(int row);
  void Down(int row);
  void DownTransposed(int row);
  static void Prefetch(const Block& block);
  // The window's margins are always 0.
  void FillWindow(const Block& block, int row, int first_channel, int channels);
  void AddToRow(const Block& block, int row, int first_channel, int channels);

  const VaryingFilter<Real>& filter_;
  bool transposed_;
  ImageIn<Real> x_;
  ImageOut<Real> y_;
  const FilterLoops<Real>& loops_;
  int most_radius_ = 0;
  std::vector<FilterTerm<Real>> terms_;
  std::vector<Real> window_, sums_, row_;
};

template <typename Real>
RowFilter<Real>::RowFilter(const VaryingFilter<Real>& filter, bool transposed,
                           const ImageIn<Real>& x, const ImageOut<Real>& y)
    : filter_(filter), transposed_(transposed), x_(x), y_(y), loops_(BestFilterLoops<Real>()) {
  for (const std::int32_t radius : filter.radius_px) most_radius_ = std::max(most_radius_, radius);
  terms_.resize(2 * Index(most_radius_) + 1 + kApart);
  if (filter.axis == Axis::kDown) return;
  window_.resize(Index(kMaxChannels) * Index(window_stride()) + kApart);
  if (!transposed) return;
  sums_.resize(Index(kMaxChannels) * Index(sums_stride()) + kApart);
  row_.resize(Index(kMaxChannels) * Index(row_stride()) + kApart);
}

// Computes (F x)(p) = sum_n c_n(p) x(p + n). Blocks at the border read a copy with zeros beside it.
template <typename Real>
void RowFilter<Real>::Across(int row) {
  for (int column = 0; column < filter_.blocks_in_row(); ++column) {
    const Block block = BlockAt(row, column);
    const int from = std::max(0, block.x - block.radius);
    const int to = std::min(filter_.width_px, block.x + block.count + block.radius);
    const bool inside = to - from == block.count + 2 * block.radius;
    ForChannels([&](int first, int channels) {
      const Real* x = inside ? In(first, row, block.x) : Window(0);
      for (int c = 0; !inside && c < channels; ++c) {
        Real* window = Window(c);
        std::fill(window - block.radius, window + (from - block.x), Real{0});
        std::copy(In(first + c, row, from), In(first + c, row, to), window + (from - block.x));
        std::fill(window + (to - block.x), window + block.count + block.radius, Real{0});
      }
      for (int n = -block.radius; n <= block.radius; ++n) {
        terms_[Index(n + block.radius)] = {block.of(n), x + n};
      }
      loops_.sum_terms(terms_.data(), block.terms(), block.ahead(),
                       inside ? x_.plane_stride : window_stride(), channels, block.count,
                       Out(first, row, block.x), y_.plane_stride);
    });
  }
}

template <typename Real>
void RowFilter<Real>::FillWindow(const Block& block, int row, int first_channel, int channels) {
  for (int c = 0; c < channels; ++c) {
    const Real* x = In(first_channel + c, row, block.x);
    std::copy(x, x + block.count, Window(c));
    std::fill(Window(c) + block.count, Window(c) + kFilterBlockPx, Real{0});
  }
}

// Adds the contributions of the pixels of a block: pixel q, from -radius to 63 + radius relative to
// the first of them, gets sum_n c_n(q - n) x(q - n), where x is 0 beside the block. The sum is
// computed for each q, so that it remains in a register. Where q - n is beside the block, another
// coefficient of this block is read instead, which is finite: its offset from the start of c_n is q
// - n, that is -(n + radius) to 63 + radius - n. Before c_n there are 64 coefficients for each of n
// + radius, and after it 64 for each of radius - n.
template <typename Real>
void RowFilter<Real>::AddToRow(const Block& block, int row, int first_channel, int channels) {
  FillWindow(block, row, first_channel, channels);
  for (int n = -block.radius; n <= block.radius; ++n) {
    const int back = n + block.radius;
    terms_[Index(back)] = {block.of(n) - back, Window(0) - back};
  }
  loops_.sum_terms(terms_.data(), block.terms(), block.ahead(), window_stride(), channels,
                   kFilterBlockPx + 2 * block.radius, sums_.data(), sums_stride());
  const int given = block.count + 2 * block.radius;
  for (int c = 0; c < channels; ++c) {
    const Real* sums = sums_.data() + std::ptrdiff_t{c} * sums_stride();
    Real* to = Row(c) + (block.x - block.radius);
    for (int q = 0; q < given; ++q) to[q] += sums[q];
  }
}

// Computes (F^T x)(q) = sum_n c_n(q - n) x(q - n), by blocks of x: rows are independent of each
// other.
template <typename Real>
void RowFilter<Real>::AcrossTransposed(int row) {
  ForChannels([&](int first, int channels) {
    std::fill(row_.begin(), row_.end(), Real{0});
    for (int column = 0; column < filter_.blocks_in_row(); ++column) {
      AddToRow(BlockAt(row, column), row, first, channels);
    }
    for (int c = 0; c < channels; ++c) {
      std::copy(Row(c), Row(c) + filter_.width_px, Out(first + c, row, 0));
    }
  });
}

template <typename Real>
void RowFilter<Real>::Down(int row) {
  for (int column = 0; column < filter_.blocks_in_row(); ++column) {
    const Block block = BlockAt(row, column);
    const int from = std::max(-block.radius, -row);
    const int to = std::min(block.radius, filter_.height_px - 1 - row);
    ForChannels([&](int first, int channels) {
      for (int n = from; n <= to; ++n) {
        terms_[Index(n - from)] = {block.of(n), In(first, row + n, block.x)};
      }
      loops_.sum_terms(terms_.data(), to - from + 1, block.ahead(), x_.plane_stride, channels,
                       block.count, Out(first, row, block.x), y_.plane_stride);
    });
  }
}

// A column of blocks gives a different part of each block to each row of the result. A block is
// prefetched as a whole before its first part is needed, because memory is several times slower
// part by part.
template <typename Real>
void RowFilter<Real>::Prefetch(const Block& block) {
  constexpr std::ptrdiff_t kLine = 64 / sizeof(Real);
  const std::ptrdiff_t size = std::ptrdiff_t{block.terms()} * kFilterBlockPx;
  for (std::ptrdiff_t i = 0; i < size; i += kLine) __builtin_prefetch(block.coefficients + i, 0, 2);
}

// Computes (F^T x)(q) = sum_n c_n(q - n e) x(q - n e). Nothing is added to memory, so that no two
// rows of the result conflict.
template <typename Real>
void RowFilter<Real>::DownTransposed(int row) {
  const int top = std::max(0, row - most_radius_);
  const int bottom = std::min(filter_.height_px - 1, row + most_radius_);
  for (int column = 0; column < filter_.blocks_in_row(); ++column) {
    const Block own = BlockAt(row, column);
    if (bottom + 1 < filter_.height_px) Prefetch(BlockAt(bottom + 1, column));
    ForChannels([&](int first, int channels) {
      int count = 0;
      for (int from = top; from <= bottom; ++from) {
        const Block block = BlockAt(from, column);
        if (std::abs(row - from) > block.radius) continue;
        terms_[Index(count++)] = {block.of(row - from), In(first, from, block.x)};
      }
      loops_.sum_terms(terms_.data(), count, own.ahead(), x_.plane_stride, channels, own.count,
                       Out(first, row, own.x), y_.plane_stride);
    });
  }
}

template <typename Real>
void ApplyEither(const VaryingFilter<Real>& filter, bool transposed, const ImageIn<Real>& x,
                 const ImageOut<Real>& y, int threads) {
  const int least_rows = kMinBandPx / std::max(1, filter.width_px);
  const int bands = BandCount(filter.height_px, threads, least_rows);
  // The memory is allocated before the threads start, because threads must not throw.
  std::vector<RowFilter<Real>> filters(Index(bands), RowFilter<Real>(filter, transposed, x, y));
  ForBands(filter.height_px, bands, [&](int band, int first, int last) {
    for (int row = first; row < last; ++row) filters[Index(band)].Filter(row);
  });
}

}  // namespace

template <typename Real>
void Apply(const VaryingFilter<Real>& filter, const ImageIn<Real>& x, const ImageOut<Real>& y,
           int threads) {
  ApplyEither(filter, false, x, y, threads);
}

template <typename Real>
void ApplyTransposed(const VaryingFilter<Real>& filter, const ImageIn<Real>& x,
                     const ImageOut<Real>& y, int threads) {
  ApplyEither(filter, true, x, y, threads);
}

template void Apply(const VaryingFilter<float>&, const ImageIn<float>&, const ImageOut<float>&,
                    int);
template void Apply(const VaryingFilter<double>&, const ImageIn<double>&, const ImageOut<double>&,
                    int);
template void ApplyTransposed(const VaryingFilter<float>&, const ImageIn<float>&,
                              const ImageOut<float>&, int);
template void ApplyTransposed(const VaryingFilter<double>&, const ImageIn<double>&,
                              const ImageOut<double>&, int);

}  // namespace thicklens::kernels
