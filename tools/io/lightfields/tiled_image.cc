// One image with all views side by side, U x V tiles without borders, as in many papers.
#include <fmt/format.h>

#include <memory>

#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "thicklens/io/image_file.h"
#include "tools/io/lightfields/image_tiles.h"
#include "tools/io/lightfields/layout.h"
#include "tools/io/lightfields/view_grid.h"
#include "tools/io/lightfields/view_pixels.h"

namespace thicklens::io {

std::optional<ViewSource> OpenTiledImage(const LayoutInput& input) {
  ReportInput(input.path);
  const auto image = std::make_shared<const DecodedImage>(ReadImageData(input.path));
  const cv::Mat& pixels = image->pixels;
  AxisCounts tiles{input.reading->layout_u, input.reading->layout_v};
  const bool is_found = !input.is_forced || tiles.across == 0;
  if (is_found) {
    tiles = RepetitionsOf(pixels);
    if (tiles.across < 2 || tiles.down < 2) {
      if (!input.is_forced) return std::nullopt;
      throw Error(fmt::format(
          "{}: the {} x {} px do not repeat across and down as views side by side do (found {} x "
          "{}): the option layout must state how many views there are, e.g. tiles:9x9",
          input.path, pixels.cols, pixels.rows, tiles.across, tiles.down));
    }
  }
  if (pixels.cols % tiles.across != 0 || pixels.rows % tiles.down != 0) {
    throw Error(fmt::format(
        "{}: {} x {} px are not a whole number of pixels for each of {} x {} views; views without "
        "borders are expected",
        input.path, pixels.cols, pixels.rows, tiles.across, tiles.down));
  }
  const int width = pixels.cols / tiles.across;
  const int height = pixels.rows / tiles.down;
  ViewSource source;
  source.kind = "an image of views side by side";
  source.frame = FullFrame(tiles.across, tiles.down);
  if (is_found) {
    source.details.push_back(
        fmt::format("{} x {} views, because the image repeats that often; the option layout states "
                    "other numbers: tiles:{}x{}",
                    tiles.across, tiles.down, tiles.across, tiles.down));
  }
  source.read = [image, width, height, path = input.path](int k, int l) {
    const cv::Rect tile(k * width, l * height, width, height);
    return LightOfPixels(image->pixels(tile), image->facts, path);
  };
  return source;
}

}  // namespace thicklens::io
