#ifndef THICKLENS_KERNELS_PICTURE_FILTER_H_
#define THICKLENS_KERNELS_PICTURE_FILTER_H_

#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <utility>
#include <vector>

namespace thicklens::kernels {

// Linear maps from pictures to pictures of the same size in which every pixel of the result has
// weights of its own. Pictures are planes, one for each channel, rows top to bottom.

enum class Axis { kAcross, kDown };

// Pixels of a row that share a radius: [0, 64), [64, 128), ...
constexpr int kFilterBlockPx = 64;

// (F x)(p) = sum_n c_n(p) x(p + n e), n from -radius to radius, e along the axis.
// No coefficient reaches beyond the picture: c_n(p) = 0 where p + n e is outside (Check sees to
// it).
template <typename Real>
struct PixelFilter {
  Axis axis = Axis::kAcross;
  int width_px = 0, height_px = 0;
  // Of each block, the blocks of a row from left to right, row after row.
  std::vector<std::int32_t> radius_px;
  std::vector<std::size_t> start;  // of a block's coefficients; one more than there are blocks
  std::vector<Real> coefficients;  // of a block: [n + radius][kFilterBlockPx]; 0 beyond the row

  int blocks_in_row() const { return (width_px + kFilterBlockPx - 1) / kFilterBlockPx; }
};

// For some pixels of the result a sum over any pixels: (R x)(pixel_r) = sum_e weight_e x(index_e).
template <typename Real>
struct PixelRows {
  int pixels = 0;                   // of the picture
  std::vector<std::int32_t> pixel;  // ascending, none twice
  std::vector<std::int64_t> start;  // of a row's entries; one more than there are rows
  std::vector<std::int32_t> index;
  std::vector<Real> weight;
};
// The same numbers by the pixels that they read: (R^T y)(pixel) = sum weight y(index). Entries of a
// row in the order of the rows they came from.
template <typename Real>
PixelRows<Real> Transposed(const PixelRows<Real>& rows);

// Pixels beside each other that are read together.
constexpr int kPixelsOfRun = 8;

// For vectors whose resize() leaves new numbers as they are, so that the threads that write them
// first are those that pay for the memory.
template <typename T>
struct UntouchedAllocator : std::allocator<T> {
  UntouchedAllocator() = default;
  template <typename U>
  UntouchedAllocator(const UntouchedAllocator<U>&) noexcept {}
  template <typename U>
  struct rebind {
    using other = UntouchedAllocator<U>;
  };
  template <typename U, typename... Arguments>
  void construct(U* at, Arguments&&... arguments) {
    if constexpr (sizeof...(Arguments) > 0) new (at) U(std::forward<Arguments>(arguments)...);
  }
};

// The same sums by runs of pixels that lie beside each other, which take less to hold and to read:
// run n reads the pixels index_n to index_n + kPixelsOfRun - 1 of a copy of the picture whose rows
// lie stride_px() apart, by weights that may be 0 (and are beyond the picture's row).
template <typename Real>
struct PixelRuns {
  int width_px = 0, height_px = 0;
  std::vector<std::int32_t> pixel;  // of each row: ascending, none twice
  std::vector<std::int64_t> run;    // of each row its first; one more than there are rows
  std::vector<std::int32_t> index;  // of each run
  // kPixelsOfRun of each run. resize() leaves them to be written.
  std::vector<Real, UntouchedAllocator<Real>> weight;
  // First rows of bands, and the end: two bands that have one between them read different pixels.
  std::vector<std::size_t> band;
  // The parts of the copy that runs read, each in one row of it, ascending; some pixels more.
  struct Part {
    std::int32_t first = 0, last = 0;  // indices of pixels: [first, last)
  };
  std::vector<Part> read;

  // Every row has room behind it for a run that begins in it; and an odd number of parts of 64
  // bytes (of floats), so that rows and planes do not meet in one place of a cache.
  int stride_px() const { return ((width_px + kPixelsOfRun + 15) / 16 | 1) * 16; }
};
// From all but the bands and the parts that are read, which it sets.
template <typename Real>
void SetBands(PixelRuns<Real>* runs);
// One form from the other: entries that follow each other share a run; weights of 0 are left out.
template <typename Real>
PixelRuns<Real> RunsOf(const PixelRows<Real>& rows, int width_px);
template <typename Real>
PixelRows<Real> RowsOf(const PixelRuns<Real>& runs);

// What a map is applied to: `channels` planes of as many pixels, `plane_stride` apart.
template <typename Real>
struct PictureIn {
  const Real* values = nullptr;
  std::ptrdiff_t plane_stride = 0;
  int channels = 1;
};
template <typename Real>
struct PictureOut {
  Real* values = nullptr;
  std::ptrdiff_t plane_stride = 0;
  int channels = 1;
};

// Every function below sets its whole result (ApplyRuns: the pixels that have a row, the others
// are left as they are; AddTransposed: adds to it), uses up to `threads` threads (>= 1), and gives
// the same bits for any number of them. In and out are different memory. Sizes and order are taken
// as right; Check tells them.
template <typename Real>
void Apply(const PixelFilter<Real>& filter, const PictureIn<Real>& x, const PictureOut<Real>& y,
           int threads);
template <typename Real>
void ApplyTransposed(const PixelFilter<Real>& filter, const PictureIn<Real>& x,
                     const PictureOut<Real>& y, int threads);
template <typename Real>
void ApplyRuns(const PixelRuns<Real>& runs, const PictureIn<Real>& x, const PictureOut<Real>& y,
               int threads);
// x += R^T y.
template <typename Real>
void AddTransposed(const PixelRuns<Real>& runs, const PictureIn<Real>& y, const PictureOut<Real>& x,
                   int threads);

// Throws Error that names the field if sizes or indices do not fit or a number is not finite.
template <typename Real>
void Check(const PixelFilter<Real>& filter);
template <typename Real>
void Check(const PixelRows<Real>& rows);

// Sum of x y w over `count` numbers (w may be null: 1), added in double, in an order that does not
// depend on `threads`.
template <typename Real>
double Dot(const Real* x, const Real* y, const Real* w, std::size_t count, int threads);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_PICTURE_FILTER_H_
