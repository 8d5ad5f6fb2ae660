#ifndef THICKLENS_TOOLS_IO_LIGHTFIELDS_IMAGE_TILES_H_
#define THICKLENS_TOOLS_IO_LIGHTFIELDS_IMAGE_TILES_H_

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>

namespace thicklens::io {

// Numbers of pixels or of views along both axes; 0: not found.
struct AxisCounts {
  int across = 0, down = 0;
};
// How often an image repeats itself across and down, as views side by side do: the differences at
// the distance of one view are much smaller than at half of it. At most 40; 1: it does not repeat.
AxisCounts RepetitionsOf(const cv::Mat& pixels);
// Whether it repeats itself so often; 1 along an axis: that axis is not asked.
bool Repeats(const cv::Mat& pixels, AxisCounts counts);
// Tiles of one size along an axis, with lines of one colour between them, a border of that colour
// around all of them, or both. Lines may have the noise of JPEG.
struct AxisLines {
  int count = 1;     // of tiles; 1: no lines divide the image
  int gap_px = 0;    // between tiles
  int first_px = 0;  // of the border before the first tile
  int tile_px = 0;   // of a tile, or of all that is within the border
  // Every tile has a uniform edge of this width on one side, which may be its own; it is no line.
  int one_side_px = 0;
};
struct TileLines {
  AxisLines across, down;
};
TileLines LinesOf(const cv::Mat& pixels);
// Whether so many tiles within a border alone have clearer edges than as many tiles of the whole
// image, whose outer tiles contain the border; false if the edges do not show it.
bool AreEdgesWithinBorder(const cv::Mat& pixels, AxisLines border, int count, bool is_down);
// The period of the differences between neighbouring pixels, as the edges of square lenslets have
// it: 2 to 100 px; 0: there is none, or the axes differ.
int LensletPitchOf(const cv::Mat& pixels);
// "1, 2, 4, 8": the numbers from 2 to 40 that divide both sides.
std::string CommonDivisors(int width_px, int height_px);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_LIGHTFIELDS_IMAGE_TILES_H_
