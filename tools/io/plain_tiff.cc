#include "tools/io/plain_tiff.h"

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

// Values of one type, as they lie in memory and in the file.
struct Samples {
  const void* values = nullptr;
  int width_px = 0, height_px = 0, channels = 0;
  std::uint16_t bits = 0, format = 0;  // SAMPLEFORMAT_ of libtiff
  std::size_t row_bytes() const {
    return static_cast<std::size_t>(width_px) * static_cast<std::size_t>(channels) * bits / 8;
  }
  std::size_t bytes() const { return row_bytes() * static_cast<std::size_t>(height_px); }
};

// Returns false if libtiff fails.
bool Write(const Samples& samples, TIFF* tiff) {
  const auto height = static_cast<std::uint32_t>(samples.height_px);
  const std::size_t row_bytes = samples.row_bytes();
  const auto strip_rows =
      static_cast<std::uint32_t>(std::clamp<std::size_t>(kStripBytes / row_bytes, 1, height));
  bool done = true;
  const auto set = [&](std::uint32_t tag, auto value) {
    done = done && TIFFSetField(tiff, tag, value) == 1;
  };
  set(TIFFTAG_IMAGEWIDTH, static_cast<std::uint32_t>(samples.width_px));
  set(TIFFTAG_IMAGELENGTH, height);
  set(TIFFTAG_BITSPERSAMPLE, samples.bits);
  set(TIFFTAG_SAMPLEFORMAT, samples.format);
  set(TIFFTAG_SAMPLESPERPIXEL, samples.channels);
  set(TIFFTAG_COMPRESSION, COMPRESSION_NONE);
  set(TIFFTAG_PHOTOMETRIC, samples.channels == 1 ? PHOTOMETRIC_MINISBLACK : PHOTOMETRIC_RGB);
  set(TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  set(TIFFTAG_ROWSPERSTRIP, strip_rows);
  for (std::uint32_t y = 0; done && y < height; y += strip_rows) {
    ThrowIfCancelled();
    const std::size_t rows = std::min(strip_rows, height - y);
    // libtiff only reads them: the values are in the byte order of this machine, as is the file.
    void* values = const_cast<char*>(  // NOLINT
        static_cast<const char*>(samples.values) + y * row_bytes);
    const auto bytes = static_cast<tmsize_t>(rows * row_bytes);
    done = TIFFWriteEncodedStrip(tiff, y / strip_rows, values, bytes) == bytes;
  }
  return done && TIFFWriteDirectory(tiff) == 1;
}

void WriteTiff(const Samples& samples, const std::string& path, const std::string& shown_name) {
  constexpr std::size_t kRoomForDirectory = 1 << 20;
  if (samples.bytes() > std::numeric_limits<std::uint32_t>::max() - kRoomForDirectory) {
    throw Error(fmt::format(
        "{}: {}x{} px take {} bytes, but a TIFF file holds at most 4 GiB; PNG files are "
        "smaller",
        shown_name, samples.width_px, samples.height_px, samples.bytes()));
  }
  errno = 0;
  std::string message;
  const TiffFile tiff = OpenForWriting(path, &message);
  if (tiff && Write(samples, tiff.get())) return;
  throw Error(fmt::format("{}: cannot be written: {}", shown_name,
                          errno != 0 ? std::strerror(errno) : message));
}

}  // namespace

void WriteFloatTiff(const model::LinearImage& image, const std::string& path,
                    const std::string& shown_name) {
  WriteTiff({image.values.data(), image.width_px, image.height_px, image.channels, 32,
             SAMPLEFORMAT_IEEEFP},
            path, shown_name);
}

void WriteWholeTiff(const std::vector<std::uint16_t>& values, int width_px, int height_px,
                    int channels, const std::string& path, const std::string& shown_name) {
  WriteTiff({values.data(), width_px, height_px, channels, 16, SAMPLEFORMAT_UINT}, path,
            shown_name);
}

}  // namespace thicklens::io
