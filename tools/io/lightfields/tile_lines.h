#ifndef THICKLENS_TOOLS_IO_LIGHTFIELDS_TILE_LINES_H_
#define THICKLENS_TOOLS_IO_LIGHTFIELDS_TILE_LINES_H_

#include <opencv2/core/mat.hpp>

namespace thicklens::io {

// Tiles of one size along an axis, with lines of one colour between them, a border of that colour
// around all of them, or both. Lines may have the noise of JPEG.
struct AxisLines {
  int count = 1;     // of tiles; 1: no lines divide the image
  int gap_px = 0;    // between tiles
  int first_px = 0;  // of the border before the first tile
  int tile_px = 0;   // of a tile, or of all that is within the border
  // Every tile has a uniform edge of this width on one side, which may be its own; it is no line.
  int one_side_px = 0;
  double level = 0;  // of the lines, as the sum of the channels
};
struct TileLines {
  AxisLines across, down;
};
// `may_be_blurred`: the image was compressed with losses.
TileLines LinesOf(const cv::Mat& pixels, bool may_be_blurred);
// Whether so many tiles within a border alone have clearer edges than as many tiles of the whole
// image, whose outer tiles contain the border; false if the edges do not show it.
bool AreEdgesWithinBorder(const cv::Mat& pixels, AxisLines border, int count, bool is_down);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_LIGHTFIELDS_TILE_LINES_H_
