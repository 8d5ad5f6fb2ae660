// One image with all views side by side, U x V tiles without borders, as in many papers, or with
// lines of one colour between them, as our own mosaics have them, or around them.
#include <fmt/format.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "thicklens/io/image_file.h"
#include "tools/io/image_file_kind.h"
#include "tools/io/lightfields/image_tiles.h"
#include "tools/io/lightfields/layout.h"
#include "tools/io/lightfields/tile_lines.h"
#include "tools/io/lightfields/view_grid.h"
#include "tools/io/lightfields/view_pixels.h"

namespace thicklens::io {

namespace {

bool HasLines(const AxisLines& lines) { return lines.gap_px > 0 || lines.first_px > 0; }

// The lines that are left out, as a clause.
std::string LinesInWords(const TileLines& lines) {
  const AxisLines &across = lines.across, &down = lines.down;
  const bool has_gaps = across.gap_px > 0 || down.gap_px > 0;
  const std::string border =
      across.first_px > 0 || down.first_px > 0
          ? fmt::format("a border of {} x {} px", across.first_px, down.first_px)
          : "";
  if (!has_gaps) return border + " is left out";
  return fmt::format("lines of {} x {} px divide the views{}, and are left out", across.gap_px,
                     down.gap_px, border.empty() ? "" : " within " + border);
}

// How often the image repeats itself, as a clause for a message about other numbers.
std::string RepetitionsInWords(AxisCounts found) {
  if (found.across < 2 && found.down < 2) return "";
  if (found.down < 2)
    return fmt::format("; the image repeats itself {} times across: tiles:{}xV", found.across,
                       found.across);
  if (found.across < 2)
    return fmt::format("; the image repeats itself {} times down: tiles:Ux{}", found.down,
                       found.down);
  return fmt::format("; the image repeats itself {} times across and {} times down: tiles:{}x{}",
                     found.across, found.down, found.across, found.down);
}

// The part of the image in which tiles without lines may be: all of it along an axis without lines,
// what is within the border, or one tile along an axis with lines between tiles.
cv::Mat Undivided(const cv::Mat& pixels, const TileLines& lines) {
  return pixels(cv::Rect(lines.across.first_px, lines.down.first_px, lines.across.tile_px,
                         lines.down.tile_px));
}

// Numbers of tiles: those of the lines, and otherwise how often the image repeats itself.
AxisCounts CountsOf(const cv::Mat& pixels, const TileLines& lines) {
  AxisCounts counts{lines.across.count, lines.down.count};
  if (counts.across > 1 && counts.down > 1) return counts;
  const AxisCounts repeated = RepetitionsOf(Undivided(pixels, lines));
  if (counts.across == 1) counts.across = repeated.across;
  if (counts.down == 1) counts.down = repeated.down;
  return counts;
}

// Throws Error if lines divide the image into other numbers than the option layout states.
void RequireStated(const LayoutInput& input, AxisCounts stated, const TileLines& lines) {
  const bool differs = (lines.across.count > 1 && lines.across.count != stated.across) ||
                       (lines.down.count > 1 && lines.down.count != stated.down);
  if (!differs) return;
  const AxisCounts tiles{lines.across.count > 1 ? lines.across.count : stated.across,
                         lines.down.count > 1 ? lines.down.count : stated.down};
  throw Error(fmt::format(
      "{}: the option layout states {} x {} views, but lines of {} x {} px divide the image into "
      "{} x {}: tiles:{}x{}",
      input.path, stated.across, stated.down, lines.across.gap_px, lines.down.gap_px, tiles.across,
      tiles.down, tiles.across, tiles.down));
}

bool IsBorderAlone(const AxisLines& lines) { return lines.count == 1 && lines.first_px > 0; }

// A border alone that is wider than half a view is not one: the outer views may be black.
bool IsWideBorder(const AxisLines& lines, int count) {
  return IsBorderAlone(lines) && 2 * lines.first_px * count > lines.tile_px;
}

// Whether a border alone belongs to the outer views: the whole image is a whole number of pixels
// for each view, and the edges of the views do not stand within the border.
bool IsBorderOfViews(const cv::Mat& pixels, const AxisLines& lines, int count, bool is_down) {
  if (!IsBorderAlone(lines) || count < 2) return false;
  if ((is_down ? pixels.rows : pixels.cols) % count != 0) return false;
  return lines.tile_px % count != 0 || !AreEdgesWithinBorder(pixels, lines, count, is_down);
}

// Takes a border that is none, or one of the views, for a part of the image.
bool DropBorder(const cv::Mat& pixels, int count, bool is_down, AxisLines* lines) {
  if (!IsWideBorder(*lines, count) && !IsBorderOfViews(pixels, *lines, count, is_down))
    return false;
  *lines = {1, 0, 0, is_down ? pixels.rows : pixels.cols, 0};
  return true;
}

// A sentence about the border of an axis that is taken for a part of the outer views.
void AddNoticeOfBorder(const std::string& path, const AxisLines& found, const AxisLines& lines,
                       int count, const char* axis, std::vector<std::string>* notices) {
  if (!IsBorderAlone(found) || lines.first_px > 0 || IsWideBorder(found, count)) return;
  notices->push_back(fmt::format(
      "{}: a border of {} px {} is read as part of the outer views, which have {} px: if it is "
      "around all views and not a part of them, it must be cut off the image",
      path, found.first_px, axis, lines.tile_px));
}

// The pixels that are left behind the last tile.
int LastPx(const AxisLines& lines, int all_px) {
  return all_px - lines.first_px - lines.count * lines.tile_px - (lines.count - 1) * lines.gap_px;
}

// Whether lines may be the edges of views of one size without lines, such as black bars.
bool MayBeBarsOfViews(const AxisLines& lines, int all_px) {
  return lines.count > 1 && lines.gap_px > 0 && lines.first_px > 0 &&
         lines.first_px + LastPx(lines, all_px) == lines.gap_px && all_px % lines.count == 0;
}

// A sentence about lines that may be bars of the views.
void AddNoticeOfBars(const std::string& path, const cv::Mat& pixels, const TileLines& lines,
                     std::vector<std::string>* notices) {
  const bool across = MayBeBarsOfViews(lines.across, pixels.cols);
  const bool down = MayBeBarsOfViews(lines.down, pixels.rows);
  if (!across && !down) return;
  const int width = across ? pixels.cols / lines.across.count : lines.across.tile_px;
  const int height = down ? pixels.rows / lines.down.count : lines.down.tile_px;
  notices->push_back(fmt::format(
      "{}: every view has a uniform edge on both sides, which may be lines between views or bars "
      "of the views themselves, and is left out: {} x {} of {} x {} px are read",
      path, lines.across.tile_px, lines.down.tile_px, width, height));
}

// Whether the uniform edge on one side of each view may be a line; a wide one is the views' own.
bool MayBeLine(const AxisLines& lines) {
  constexpr int kWidestPart = 10;
  return lines.one_side_px > 0 && kWidestPart * lines.one_side_px <= lines.tile_px;
}

// Tiles without lines along an axis divide what is within the border.
bool SetTileSize(int count, AxisLines* lines) {
  if (lines->count > 1) return true;
  if (lines->tile_px % count != 0) return false;
  lines->count = count;
  lines->tile_px /= count;
  return true;
}

}  // namespace

std::optional<ViewSource> OpenTiledImage(const LayoutInput& input) {
  ReportInput(input.path);
  const std::string bytes = ReadWholeFile(input.path);
  const std::optional<ImageFileKind> kind = KindOfImage(bytes);
  const auto image = std::make_shared<const DecodedImage>(DecodeImageFile(bytes, input.path));
  const cv::Mat& pixels = image->pixels;
  const AxisCounts stated =
      input.is_forced ? AxisCounts{input.reading->layout_u, input.reading->layout_v} : AxisCounts{};
  const bool is_stated = stated.across > 0;
  TileLines lines = LinesOf(pixels, kind && IsLossy(bytes, *kind));
  const auto are_divided = [&lines] { return lines.across.count > 1 || lines.down.count > 1; };
  // The views themselves may show such lines.
  if (is_stated && are_divided() &&
      (lines.across.count == 1 || lines.across.count != stated.across) &&
      (lines.down.count == 1 || lines.down.count != stated.down) && Repeats(pixels, stated)) {
    lines = TileLines{{1, 0, 0, pixels.cols, 0}, {1, 0, 0, pixels.rows, 0}};
  }
  const TileLines found = lines;
  AxisCounts tiles = stated;
  if (is_stated) {
    RequireStated(input, stated, lines);
    DropBorder(pixels, stated.across, false, &lines.across);
    DropBorder(pixels, stated.down, true, &lines.down);
  } else {
    tiles = CountsOf(pixels, lines);
    // An image that does not repeat itself within a border may do so with it.
    const auto drop = [&pixels](int count, bool is_down, AxisLines* axis) {
      if (count > 1 || !IsBorderAlone(*axis)) return DropBorder(pixels, count, is_down, axis);
      *axis = {1, 0, 0, is_down ? pixels.rows : pixels.cols, 0};
      return true;
    };
    const bool is_other_across = drop(tiles.across, false, &lines.across);
    const bool is_other_down = drop(tiles.down, true, &lines.down);
    if (is_other_across || is_other_down) tiles = CountsOf(pixels, lines);
    // An image with two such lines may show anything, so that more are needed unless the layout is
    // stated or the image repeats itself, as views with black bars do.
    const bool are_few = are_divided() && tiles.across * tiles.down < 9 && !Repeats(pixels, tiles);
    if (!input.is_forced && (tiles.across < 2 || tiles.down < 2 || are_few)) return std::nullopt;
    if (tiles.across < 2 || tiles.down < 2) {
      throw Error(fmt::format(
          "{}: the {} x {} px do not repeat across and down as views side by side do (found {} x "
          "{}): the option layout must state how many views there are, e.g. tiles:9x9",
          input.path, pixels.cols, pixels.rows, tiles.across, tiles.down));
    }
  }
  const bool has_lines = HasLines(lines.across) || HasLines(lines.down);
  const bool is_found = !is_stated && !are_divided();
  const AxisCounts undivided{lines.across.tile_px, lines.down.tile_px};
  if (!SetTileSize(tiles.across, &lines.across) || !SetTileSize(tiles.down, &lines.down)) {
    const std::string within = has_lines ? fmt::format(" (of {} x {} px; {})", pixels.cols,
                                                       pixels.rows, LinesInWords(lines))
                                         : "";
    throw Error(fmt::format(
        "{}: {} x {} px{} are not a whole number of pixels for each of {} x {} views; views "
        "without borders are expected, or with lines of one colour and one width between them or "
        "around them{}",
        input.path, undivided.across, undivided.down, within, tiles.across, tiles.down,
        RepetitionsInWords(RepetitionsOf(pixels))));
  }
  ViewSource source;
  source.kind = "an image of views side by side";
  AddNoticeOfBorder(input.path, found.across, lines.across, tiles.across, "across",
                    &source.notices);
  AddNoticeOfBorder(input.path, found.down, lines.down, tiles.down, "down", &source.notices);
  AddNoticeOfBars(input.path, pixels, lines, &source.notices);
  source.frame = FullFrame(tiles.across, tiles.down);
  if (has_lines) source.details.push_back(LinesInWords(lines));
  if (is_found) {
    source.details.push_back(
        fmt::format("{} x {} views, because the image repeats that often; the option layout states "
                    "other numbers: tiles:{}x{}",
                    tiles.across, tiles.down, tiles.across, tiles.down));
  }
  if (MayBeLine(lines.across) || MayBeLine(lines.down)) {
    source.notices.push_back(fmt::format(
        "{}: every view has a uniform edge of {} x {} px on one side, which may be a line between "
        "views and is kept; the option crop leaves it out",
        input.path, lines.across.one_side_px, lines.down.one_side_px));
  }
  if (is_stated && !has_lines && !Repeats(pixels, tiles)) {
    const AxisCounts repeated = RepetitionsOf(pixels);
    const bool is_other = (repeated.across > 1 && repeated.across != tiles.across) ||
                          (repeated.down > 1 && repeated.down != tiles.down);
    if (is_other) {
      source.notices.push_back(fmt::format("{}: the option layout states {} x {} views{}",
                                           input.path, tiles.across, tiles.down,
                                           RepetitionsInWords(repeated)));
    }
  }
  source.read = [image, lines, path = input.path](int k, int l) {
    const AxisLines &across = lines.across, &down = lines.down;
    const cv::Rect tile(across.first_px + k * (across.tile_px + across.gap_px),
                        down.first_px + l * (down.tile_px + down.gap_px), across.tile_px,
                        down.tile_px);
    return LightOfPixels(image->pixels(tile), image->facts, path);
  };
  return source;
}

}  // namespace thicklens::io
