#ifndef THICKLENS_KERNELS_CELL_ROW_H_
#define THICKLENS_KERNELS_CELL_ROW_H_

#include <cstddef>
#include <cstdint>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/kernels/cell_disparity.h"

namespace thicklens::kernels {

// The positions of a row of pixels of the centre view in another view, one number for each pixel.
//
// Positions are relative to the pixel, so that float holds them, and two cells that share an edge
// get the same numbers for it: a sample on the wrong side of the edge for one cell is on the right
// side for the other.
struct PixelRow {
  // Makes a row of `width_px` pixels without positions.
  THICKLENS_EXPORT explicit PixelRow(std::size_t width_px);

  // The positions and disparities of the pixels, not owned by the result.
  Corners corners() const { return {offset_x.data(), offset_y.data(), disparity}; }
  // The bounds of the pixels, not owned by the result.
  Bounds bounds() const { return {first_x.data(), last_x.data(), first_y.data(), last_y.data()}; }

  const float* disparity = nullptr;                     // in the unit of the map
  std::vector<float> offset_x, offset_y;                // px, from the pixel in the centre view
  std::vector<float> first_x, last_x, first_y, last_y;  // see Bounds
};

// Sets offset = -disparity * shift, clamped to +-limit_px, which must exceed the width and the
// height of the view.
THICKLENS_EXPORT void PlacePixels(const float* disparity, float shift_x, float shift_y,
                                  float limit_px, PixelRow* row);

// Number of samples of the view in the rectangle around a cell.
enum class CellSamples : std::int32_t {
  kNone,     // no sample
  kOne,      // a single sample
  kTwo,      // two samples
  kSeveral,  // more than two samples
  kOdd,      // at least one sample, and a part of the cell is flipped or degenerate
};

// The cells between two rows of pixels: one for each pixel but the last.
struct CellRow {
  // Makes the cells of rows of `width_px` pixels.
  THICKLENS_EXPORT explicit CellRow(std::size_t width_px);

  std::vector<CellSamples> samples;  // number of samples of each cell
  // The first and the last sample: its index relative to that of the cell's top left pixel, and the
  // disparity of the cell there. Undefined for cells without samples and for odd cells.
  std::vector<std::int32_t> first, last;
  std::vector<float> first_disparity, last_disparity;  // -infinity where the sample is outside
};

// Finds the samples of all cells between the rows `upper` (row view.y) and `lower` (the next one).
THICKLENS_EXPORT void SampleCells(const PixelRow& upper, const PixelRow& lower, const ViewRow& view,
                                  CellRow* cells);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_CELL_ROW_H_
