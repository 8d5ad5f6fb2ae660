#include "tools/io/float_tiff.h"

#include <fmt/format.h>
#include <tiffio.h>

#include <algorithm>
#include <cerrno>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <limits>
#include <memory>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"

namespace thicklens::io {
namespace {

constexpr std::size_t kStripBytes = 1 << 18;

// Keeps the message that libtiff would print.
int KeepMessage(TIFF* /*tiff*/, void* message, const char* /*module*/, const char* format,
                std::va_list arguments) {
  char text[512];
  std::vsnprintf(text, sizeof text, format, arguments);
  *static_cast<std::string*>(message) = text;
  return 1;
}

struct CloseTiff {
  void operator()(TIFF* tiff) const { TIFFClose(tiff); }
};
using TiffFile = std::unique_ptr<TIFF, CloseTiff>;

TiffFile OpenForWriting(const std::string& path, std::string* message) {
  TIFFOpenOptions* options = TIFFOpenOptionsAlloc();
  TIFFOpenOptionsSetErrorHandlerExtR(options, KeepMessage, message);
  TIFFOpenOptionsSetWarningHandlerExtR(options, KeepMessage, message);
  TiffFile tiff(TIFFOpenExt(path.c_str(), "w", options));
  TIFFOpenOptionsFree(options);
  return tiff;
}

// Returns false if libtiff fails.
bool Write(const model::LinearImage& image, TIFF* tiff) {
  const auto width = static_cast<std::uint32_t>(image.width_px);
  const auto height = static_cast<std::uint32_t>(image.height_px);
  const int channels = image.channels;
  const std::size_t row_values = std::size_t{width} * static_cast<std::size_t>(channels);
  const auto strip_rows = static_cast<std::uint32_t>(
      std::clamp<std::size_t>(kStripBytes / (row_values * sizeof(float)), 1, height));
  bool done = true;
  const auto set = [&](std::uint32_t tag, auto value) {
    done = done && TIFFSetField(tiff, tag, value) == 1;
  };
  set(TIFFTAG_IMAGEWIDTH, width);
  set(TIFFTAG_IMAGELENGTH, height);
  set(TIFFTAG_BITSPERSAMPLE, 32);
  set(TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_IEEEFP);
  set(TIFFTAG_SAMPLESPERPIXEL, channels);
  set(TIFFTAG_COMPRESSION, COMPRESSION_NONE);
  set(TIFFTAG_PHOTOMETRIC, channels == 1 ? PHOTOMETRIC_MINISBLACK : PHOTOMETRIC_RGB);
  set(TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  set(TIFFTAG_ROWSPERSTRIP, strip_rows);
  for (std::uint32_t y = 0; done && y < height; y += strip_rows) {
    ThrowIfCancelled();
    const std::size_t rows = std::min(strip_rows, height - y);
    // libtiff only reads them: the values are in the byte order of this machine, as is the file.
    float* values = const_cast<float*>(image.values.data()) + y * row_values;  // NOLINT
    const auto bytes = static_cast<tmsize_t>(rows * row_values * sizeof(float));
    done = TIFFWriteEncodedStrip(tiff, y / strip_rows, values, bytes) == bytes;
  }
  return done && TIFFWriteDirectory(tiff) == 1;
}

}  // namespace

void WriteFloatTiff(const model::LinearImage& image, const std::string& path,
                    const std::string& shown_name) {
  constexpr std::size_t kRoomForDirectory = 1 << 20;
  const std::size_t bytes = image.values.size() * sizeof(float);
  if (bytes > std::numeric_limits<std::uint32_t>::max() - kRoomForDirectory) {
    throw Error(fmt::format(
        "{}: {}x{} px take {} bytes, but a TIFF file holds at most 4 GiB; PNG files are "
        "smaller",
        shown_name, image.width_px, image.height_px, bytes));
  }
  errno = 0;
  std::string message;
  const TiffFile tiff = OpenForWriting(path, &message);
  if (tiff && Write(image, tiff.get())) return;
  throw Error(fmt::format("{}: cannot be written: {}", shown_name,
                          errno != 0 ? std::strerror(errno) : message));
}

}  // namespace thicklens::io
