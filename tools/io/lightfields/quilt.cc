// Quilts of Looking Glass displays: one image of C x R tiles, whose name states "_qsCxRaA" with the
// aspect ratio A of the display (docs.lookingglassfactory.com/keyconcepts/quilts). The tiles are
// views from places in one row, from the leftmost in the bottom-left tile to the rightmost in the
// top-right one.
#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <regex>

#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/io/image_file.h"
#include "tools/io/lightfields/image_tiles.h"
#include "tools/io/lightfields/layout.h"
#include "tools/io/lightfields/view_grid.h"
#include "tools/io/lightfields/view_pixels.h"

namespace thicklens::io {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxColumns = 100;
// A tile may differ this much from the stated aspect ratio: tiles have whole pixels.
constexpr double kAspectTolerance = 0.02;

struct QuiltSize {
  int columns = 0, rows = 0;
  double aspect = 0;  // width / height; 0: not stated
};

std::optional<QuiltSize> SizeInName(const std::string& name) {
  static const std::regex expression(
      "_qs([0-9]{1,3})x([0-9]{1,3})(?:a([0-9]{1,4}(?:\\.[0-9]{0,9})?))?");
  std::smatch found;
  constexpr std::size_t kMaxName = 255;
  if (name.size() > kMaxName || !std::regex_search(name, found, expression)) return std::nullopt;
  return QuiltSize{std::atoi(found[1].str().c_str()), std::atoi(found[2].str().c_str()),
                   std::atof(found[3].str().c_str())};
}

}  // namespace

bool IsNamedQuilt(const std::string& path) {
  return SizeInName(fs::path(path).filename().string()).has_value();
}

std::optional<ViewSource> OpenQuilt(const LayoutInput& input) {
  std::optional<QuiltSize> size = SizeInName(fs::path(input.path).filename().string());
  if (input.reading->layout_u > 0 && input.is_forced)
    size = QuiltSize{input.reading->layout_u, input.reading->layout_v, 0};
  if (!size && !input.is_forced) return std::nullopt;
  if (!size) {
    throw Error(fmt::format(
        "{}: a quilt states its tiles in its name, e.g. _qs8x6a0.75; otherwise the option layout "
        "states them: quilt:8x6",
        input.path));
  }
  const int columns = size->columns;
  const int rows = size->rows;
  if (columns < 1 || rows < 1 || columns > kMaxColumns || rows > kMaxColumns) {
    throw Error(fmt::format("{}: a quilt has 1 to {} columns and rows, the name states {} x {}",
                            input.path, kMaxColumns, columns, rows));
  }
  ReportInput(input.path);
  const auto image = std::make_shared<const DecodedImage>(ReadImageData(input.path));
  const cv::Mat& pixels = image->pixels;
  if (pixels.cols % columns != 0 || pixels.rows % rows != 0) {
    throw Error(fmt::format(
        "{}: {} x {} px are not a whole number of pixels for each of {} x {} tiles: the name or "
        "the size of the image is wrong",
        input.path, pixels.cols, pixels.rows, columns, rows));
  }
  const int width = pixels.cols / columns;
  const int height = pixels.rows / rows;
  ViewSource source;
  source.kind = fmt::format("a quilt of {} x {} tiles", columns, rows);
  source.frame = FullFrame(columns * rows, 1);
  source.details.push_back("the bottom-left tile is the leftmost view");
  const double aspect = static_cast<double>(width) / height;
  if (size->aspect > 0 && std::abs(aspect / size->aspect - 1) > kAspectTolerance) {
    source.notices.push_back(
        fmt::format("{}: the name states an aspect ratio of {:g}, the tiles have {:.3g} ({} x {} "
                    "px): their pixels are taken as square",
                    input.path, size->aspect, aspect, width, height));
  }
  source.read = [image, columns, rows, width, height, path = input.path](int k, int) {
    const cv::Rect tile(k % columns * width, (rows - 1 - k / columns) * height, width, height);
    return LightOfPixels(image->pixels(tile), image->facts, path);
  };
  return source;
}

}  // namespace thicklens::io
