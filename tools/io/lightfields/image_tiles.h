#ifndef THICKLENS_TOOLS_IO_LIGHTFIELDS_IMAGE_TILES_H_
#define THICKLENS_TOOLS_IO_LIGHTFIELDS_IMAGE_TILES_H_

#include <opencv2/core/mat.hpp>
#include <string>
#include <utility>
#include <vector>

namespace thicklens::io {

// Numbers of pixels or of views along both axes; 0: not found.
struct AxisCounts {
  int across = 0, down = 0;
};
constexpr int kMaxTiles = 40;  // along an axis
constexpr int kMinTilePx = 8;
// How often an image repeats itself across and down, as views side by side do: the differences at
// the distance of one view are much smaller than at half of it, and smaller than for other numbers.
// At most 40; 1: it does not repeat.
AxisCounts RepetitionsOf(const cv::Mat& pixels);
// Whether it repeats itself so often; 1 along an axis: that axis is not asked.
bool Repeats(const cv::Mat& pixels, AxisCounts counts);
// The differences of a grey image (GreyOf) at a distance across, relative to those at half of it.
double RatioAt(const cv::Mat& grey, int lag_px);
// The ratio below which an image repeats itself: views side by side differ by their parallax only,
// and a photograph without repetitions has a ratio near 1.
constexpr double kRepeats = 0.5;
// Numbers of tiles, each with the ratio at the distance of a tile.
using RatioOfCount = std::pair<int, double>;
// The largest number with about the least ratio; 1: none repeats. A small object on a plain
// background repeats itself at wrong distances too, but less well; views without parallax do so in
// fractions of their number.
int CountOf(const std::vector<RatioOfCount>& ratios);
// The sum of the colour channels, as floats. It throws CancelledError.
cv::Mat GreyOf(const cv::Mat& pixels);
// The period of the differences between neighbouring pixels, as the edges of square lenslets have
// it: 2 to 100 px; 0: there is none, or the axes differ.
int LensletPitchOf(const cv::Mat& pixels);
// "1, 2, 4, 8": the numbers from 2 to 40 that divide both sides.
std::string CommonDivisors(int width_px, int height_px);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_LIGHTFIELDS_IMAGE_TILES_H_
