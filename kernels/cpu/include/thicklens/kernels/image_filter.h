#ifndef THICKLENS_KERNELS_IMAGE_FILTER_H_
#define THICKLENS_KERNELS_IMAGE_FILTER_H_

#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <utility>
#include <vector>

#include "thicklens/base/export.h"

namespace thicklens::kernels {

// Linear maps from images to images of the same size in which every pixel of the result has its own
// weights. Images are planes, one per channel, rows top to bottom.

// Direction of a filter: along a row (kAcross) or along a column (kDown).
enum class Axis { kAcross, kDown };

// Number of pixels of a row that share a radius: [0, 64), [64, 128), ...
constexpr int kFilterBlockPx = 64;

// The map (F x)(p) = sum_n c_n(p) x(p + n e), n from -radius to radius, e along the axis. No
// coefficient reaches beyond the image: c_n(p) = 0 where p + n e is outside (tested by Check).
template <typename Real>
struct VaryingFilter {
  Axis axis = Axis::kAcross;        // direction e
  int width_px = 0, height_px = 0;  // size of the image, px
  // Radius of each block; the blocks of a row from left to right, row after row.
  std::vector<std::int32_t> radius_px;
  std::vector<std::size_t> start;  // start of each block's coefficients; one more than there are
                                   // blocks
  std::vector<Real> coefficients;  // of each block [n + radius][kFilterBlockPx]; 0 beyond the row

  // Number of blocks of a row; the last one may be shorter.
  int blocks_in_row() const { return (width_px + kFilterBlockPx - 1) / kFilterBlockPx; }
};

// Sums over arbitrary pixels for some pixels of the result: (R x)(pixel_r) = sum_e weight_e
// x(index_e).
template <typename Real>
struct PixelCsr {
  int pixels = 0;                   // number of pixels of the image
  std::vector<std::int32_t> pixel;  // ascending, without duplicates
  std::vector<std::int64_t> start;  // first entry of each row; one more than there are rows
  std::vector<std::int32_t> index;  // pixel that each entry reads
  std::vector<Real> weight;         // weight of each entry
};
// Returns the same weights sorted by the pixels that they read: (R^T y)(pixel) = sum weight
// y(index). The entries of a row have the order of their original rows.
template <typename Real>
THICKLENS_EXPORT PixelCsr<Real> Transposed(const PixelCsr<Real>& rows);

// Number of adjacent pixels that are read together.
constexpr int kPixelsOfRun = 8;

// Allocator of vectors whose resize() leaves new numbers uninitialised. The threads that first
// write them then bear the cost of the memory.
template <typename T>
struct DefaultInitAllocator : std::allocator<T> {
  DefaultInitAllocator() = default;
  // Converts from the allocator of another type, as the standard library requires.
  template <typename U>
  DefaultInitAllocator(const DefaultInitAllocator<U>&) noexcept {}
  // The allocator of another type, as the standard library requires.
  template <typename U>
  struct rebind {
    using other = DefaultInitAllocator<U>;  // the allocator of U
  };
  // Constructs a number; without arguments it stays uninitialised.
  template <typename U, typename... Arguments>
  void construct(U* at, Arguments&&... arguments) {
    if constexpr (sizeof...(Arguments) > 0) new (at) U(std::forward<Arguments>(arguments)...);
  }
};

// The sums of PixelCsr in runs of adjacent pixels, which need less memory and are faster to read.
// Run n reads the pixels index_n to index_n + kPixelsOfRun - 1 of a copy of the image whose rows
// are stride_px() apart. Its weights may be 0, and are 0 beyond the row of the image.
template <typename Real>
struct PixelBlockedCsr {
  int width_px = 0, height_px = 0;  // size of the image, px
  std::vector<std::int32_t> pixel;  // pixel of each row: ascending, without duplicates
  std::vector<std::int64_t> run;    // first run of each row; one more than there are rows
  std::vector<std::int32_t> index;  // first pixel of each run
  // kPixelsOfRun weights per run. resize() leaves them uninitialised.
  std::vector<Real, DefaultInitAllocator<Real>> weight;
  // First rows of bands, and the end. Two bands with one band between them read different pixels.
  std::vector<std::size_t> band;
  // The parts of the copy that runs read, each in one row of it, ascending. They may include
  // further pixels.
  struct Part {
    std::int32_t first = 0, last = 0;  // indices of pixels: [first, last)
  };
  std::vector<Part> read;  // all parts that runs read

  // Every row has space behind it for a run that begins in it. The stride is an odd number of parts
  // of 64 bytes (of floats), so that rows and planes do not share one place of a cache.
  int stride_px() const { return ((width_px + kPixelsOfRun + 15) / 16 | 1) * 16; }
};
// Sets `band` and `read` from all other fields.
template <typename Real>
THICKLENS_EXPORT void SetBands(PixelBlockedCsr<Real>* runs);
// Conversions between the two forms: RunsOf puts entries that follow each other into one run;
// RowsOf leaves out weights of 0.
template <typename Real>
THICKLENS_EXPORT PixelBlockedCsr<Real> RunsOf(const PixelCsr<Real>& rows, int width_px);
// Converts runs to entries; see RunsOf.
template <typename Real>
THICKLENS_EXPORT PixelCsr<Real> RowsOf(const PixelBlockedCsr<Real>& runs);

// The image to which a map is applied (ImageOut: its result): `channels` planes of equal size,
// `plane_stride` numbers apart. The memory is not owned.
template <typename Real>
struct ImageIn {
  const Real* values = nullptr;     // first number of the first plane
  std::ptrdiff_t plane_stride = 0;  // numbers from plane to plane
  int channels = 1;                 // number of planes
};
// The result of a map; see ImageIn.
template <typename Real>
struct ImageOut {
  Real* values = nullptr;           // first number of the first plane
  std::ptrdiff_t plane_stride = 0;  // numbers from plane to plane
  int channels = 1;                 // number of planes
};

// Each function below sets its whole result, with two exceptions: ApplyRuns sets only the pixels
// that have a row and does not change the others, and AddTransposed adds to its result. The
// functions use up to `threads` threads (>= 1) and give the same bits for any number of threads.
// Input and output must not overlap. Sizes and order are not tested; use Check for this.
template <typename Real>
THICKLENS_EXPORT void Apply(const VaryingFilter<Real>& filter, const ImageIn<Real>& x,
                            const ImageOut<Real>& y, int threads);
// Computes y = F^T x; see Apply.
template <typename Real>
THICKLENS_EXPORT void ApplyTransposed(const VaryingFilter<Real>& filter, const ImageIn<Real>& x,
                                      const ImageOut<Real>& y, int threads);
// Computes y = R x at the pixels that have a row; see Apply.
template <typename Real>
THICKLENS_EXPORT void ApplyRuns(const PixelBlockedCsr<Real>& runs, const ImageIn<Real>& x,
                                const ImageOut<Real>& y, int threads);
// Computes x += R^T y.
template <typename Real>
THICKLENS_EXPORT void AddTransposed(const PixelBlockedCsr<Real>& runs, const ImageIn<Real>& y,
                                    const ImageOut<Real>& x, int threads);

// Throws Error, which names the field, if sizes or indices do not fit or a number is not finite.
template <typename Real>
THICKLENS_EXPORT void Check(const VaryingFilter<Real>& filter);
template <typename Real>
THICKLENS_EXPORT void Check(const PixelCsr<Real>& rows);

// Returns the sum of x y w over `count` numbers (w may be null: 1). It is added in double, in an
// order that does not depend on `threads`.
template <typename Real>
THICKLENS_EXPORT double Dot(const Real* x, const Real* y, const Real* w, std::size_t count,
                            int threads);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_IMAGE_FILTER_H_
