// One image with all views side by side, U x V tiles without borders, as in many papers, or with
// lines of one colour between them, as our own mosaics have them.
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

namespace {

// Views with lines between them. The tiles must be those of the option layout, if it states them.
ViewSource BorderedSource(const LayoutInput& input,
                          const std::shared_ptr<const DecodedImage>& image,
                          const BorderedTiles& found) {
  const int stated_u = input.is_forced ? input.reading->layout_u : 0;
  const int stated_v = input.is_forced ? input.reading->layout_v : 0;
  const AxisCounts tiles = found.tiles;
  if (stated_u > 0 && (stated_u != tiles.across || stated_v != tiles.down)) {
    throw Error(fmt::format(
        "{}: the option layout states {} x {} views, but lines of {} x {} px divide the image into "
        "{} x {}: tiles:{}x{}",
        input.path, stated_u, stated_v, found.gap_px.across, found.gap_px.down, tiles.across,
        tiles.down, tiles.across, tiles.down));
  }
  ViewSource source;
  source.kind = "an image of views side by side";
  source.frame = FullFrame(tiles.across, tiles.down);
  source.details.push_back(
      fmt::format("{} x {} views, which lines of {} x {} px divide; the lines are left out",
                  tiles.across, tiles.down, found.gap_px.across, found.gap_px.down));
  source.read = [image, found, path = input.path](int k, int l) {
    const cv::Rect tile(k * (found.tile_px.across + found.gap_px.across),
                        l * (found.tile_px.down + found.gap_px.down), found.tile_px.across,
                        found.tile_px.down);
    return LightOfPixels(image->pixels(tile), image->facts, path);
  };
  return source;
}

// How often the image repeats itself, as a clause for a message about other numbers.
std::string RepetitionsInWords(AxisCounts found) {
  if (found.across < 2 && found.down < 2) return "";
  return fmt::format("; the image repeats itself {} times across and {} times down: tiles:{}x{}",
                     found.across, found.down, found.across, found.down);
}

}  // namespace

std::optional<ViewSource> OpenTiledImage(const LayoutInput& input) {
  ReportInput(input.path);
  const auto image = std::make_shared<const DecodedImage>(ReadImageData(input.path));
  const cv::Mat& pixels = image->pixels;
  // An image with two such lines may show anything, so that more are needed unless the layout is
  // stated.
  const std::optional<BorderedTiles> bordered = BorderedTilesOf(pixels);
  if (bordered && (input.is_forced || bordered->tiles.across * bordered->tiles.down >= 9))
    return BorderedSource(input, image, *bordered);
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
        "borders are expected, or with lines of one colour between them{}",
        input.path, pixels.cols, pixels.rows, tiles.across, tiles.down,
        RepetitionsInWords(RepetitionsOf(pixels))));
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
  if (!is_found && !Repeats(pixels, tiles)) {
    const AxisCounts found = RepetitionsOf(pixels);
    const bool is_other = (found.across > 1 && found.across != tiles.across) ||
                          (found.down > 1 && found.down != tiles.down);
    if (is_other) {
      source.notices.push_back(fmt::format("{}: the option layout states {} x {} views{}",
                                           input.path, tiles.across, tiles.down,
                                           RepetitionsInWords(found)));
    }
  }
  source.read = [image, width, height, path = input.path](int k, int l) {
    const cv::Rect tile(k * width, l * height, width, height);
    return LightOfPixels(image->pixels(tile), image->facts, path);
  };
  return source;
}

}  // namespace thicklens::io
