#include "tools/io/tiff_pixels.h"

#include <fmt/format.h>
#include <tiffio.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <limits>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <system_error>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"

namespace thicklens::io {
namespace {

constexpr std::size_t kMaxPages = 100000;
constexpr std::size_t kStripBytes = 1 << 18;
constexpr std::uint16_t kPhotometricCfa = 32803, kPhotometricLinearRaw = 34892;

// The bytes of a file that libtiff reads from memory, or writes to memory.
struct BytesInMemory {
  const std::string* bytes = nullptr;
  std::string* written = nullptr;
  std::size_t at = 0;

  static tmsize_t Read(thandle_t handle, void* to, tmsize_t size) {
    auto* file = static_cast<BytesInMemory*>(handle);
    const std::size_t left = file->bytes->size() - std::min(file->at, file->bytes->size());
    const std::size_t count = std::min(left, static_cast<std::size_t>(std::max<tmsize_t>(size, 0)));
    if (count > 0) std::memcpy(to, file->bytes->data() + file->at, count);
    file->at += count;
    return static_cast<tmsize_t>(count);
  }
  static tmsize_t Write(thandle_t handle, void* from, tmsize_t size) {
    auto* file = static_cast<BytesInMemory*>(handle);
    if (file->written == nullptr || size < 0) return 0;
    const auto count = static_cast<std::size_t>(size);
    if (file->written->size() < file->at + count) file->written->resize(file->at + count);
    std::memcpy(file->written->data() + file->at, from, count);
    file->at += count;
    return size;
  }
  static toff_t Seek(thandle_t handle, toff_t offset, int whence) {
    auto* file = static_cast<BytesInMemory*>(handle);
    if (whence == SEEK_CUR) offset += file->at;
    if (whence == SEEK_END) offset += file->bytes->size();
    file->at = static_cast<std::size_t>(offset);
    return offset;
  }
  static int Close(thandle_t) { return 0; }
  static toff_t Size(thandle_t handle) {
    return static_cast<BytesInMemory*>(handle)->bytes->size();
  }
};

// Keeps the first message that libtiff would print: the others follow from it.
int KeepMessage(TIFF* /*tiff*/, void* message, const char* /*module*/, const char* format,
                std::va_list arguments) {
  auto* kept = static_cast<std::string*>(message);
  if (!kept->empty()) return 1;
  char text[512];
  std::vsnprintf(text, sizeof text, format, arguments);
  *kept = text;
  return 1;
}
int KeepStill(TIFF*, void*, const char*, const char*, std::va_list) { return 1; }

struct CloseTiff {
  void operator()(TIFF* tiff) const { TIFFClose(tiff); }
};

// A file that is open, with the message of what failed.
struct OpenFile {
  BytesInMemory memory;
  std::string error;
  std::unique_ptr<TIFF, CloseTiff> tiff;

  OpenFile(BytesInMemory opened, const char* mode) : memory(opened) {
    TIFFOpenOptions* options = TIFFOpenOptionsAlloc();
    TIFFOpenOptionsSetErrorHandlerExtR(options, KeepMessage, &error);
    // Warnings are about tags that libtiff does not know, which every camera writes.
    TIFFOpenOptionsSetWarningHandlerExtR(options, KeepStill, nullptr);
    tiff.reset(TIFFClientOpenExt("", mode, &memory, BytesInMemory::Read, BytesInMemory::Write,
                                 BytesInMemory::Seek, BytesInMemory::Close, BytesInMemory::Size,
                                 nullptr, nullptr, options));
    TIFFOpenOptionsFree(options);
  }
  explicit OpenFile(const std::string& bytes) : OpenFile(BytesInMemory{&bytes}, "rm") {}
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;
};

template <typename T>
T Field(TIFF* tiff, std::uint32_t tag, T otherwise) {
  T value = otherwise;
  return TIFFGetField(tiff, tag, &value) == 1 ? value : otherwise;
}

std::string Text(TIFF* tiff, std::uint32_t tag) {
  const char* text = nullptr;
  return TIFFGetField(tiff, tag, &text) == 1 && text != nullptr ? text : "";
}

bool IsReducedOrMask(TIFF* tiff) {
  return (Field<std::uint32_t>(tiff, TIFFTAG_SUBFILETYPE, 0) &
          (FILETYPE_REDUCEDIMAGE | FILETYPE_MASK)) != 0;
}

bool IsRawPhotometric(TIFF* tiff) {
  const auto photometric = Field<std::uint16_t>(tiff, TIFFTAG_PHOTOMETRIC, 0);
  return photometric == kPhotometricCfa || photometric == kPhotometricLinearRaw;
}

// The arrangement and type of the values of one directory.
struct Layout {
  std::uint32_t width = 0, height = 0;
  std::uint16_t bits = 1, samples = 1, format = SAMPLEFORMAT_UINT, planar = PLANARCONFIG_CONTIG;
  std::uint16_t photometric = PHOTOMETRIC_MINISBLACK, compression = COMPRESSION_NONE;
  bool is_tiled = false;
  std::uint32_t chunk_width = 0, chunk_height = 0;  // of a tile or strip

  explicit Layout(TIFF* tiff) {
    TIFFGetField(tiff, TIFFTAG_IMAGEWIDTH, &width);
    TIFFGetField(tiff, TIFFTAG_IMAGELENGTH, &height);
    TIFFGetFieldDefaulted(tiff, TIFFTAG_BITSPERSAMPLE, &bits);
    TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLESPERPIXEL, &samples);
    TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLEFORMAT, &format);
    TIFFGetFieldDefaulted(tiff, TIFFTAG_PLANARCONFIG, &planar);
    TIFFGetFieldDefaulted(tiff, TIFFTAG_COMPRESSION, &compression);
    photometric = Field<std::uint16_t>(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
    is_tiled = TIFFIsTiled(tiff) != 0;
    if (is_tiled) {
      TIFFGetField(tiff, TIFFTAG_TILEWIDTH, &chunk_width);
      TIFFGetField(tiff, TIFFTAG_TILELENGTH, &chunk_height);
    } else {
      chunk_width = width;
      TIFFGetFieldDefaulted(tiff, TIFFTAG_ROWSPERSTRIP, &chunk_height);
      chunk_height = std::min(chunk_height, height);
    }
    if (format == SAMPLEFORMAT_VOID) format = SAMPLEFORMAT_UINT;
  }

  bool IsFloat() const { return format == SAMPLEFORMAT_IEEEFP; }
  bool IsPlanar() const { return planar == PLANARCONFIG_SEPARATE && samples > 1; }
  std::size_t SamplesPerChunkPixel() const { return IsPlanar() ? 1 : samples; }
};

std::string TypeName(const Layout& layout) {
  if (layout.IsFloat())
    return layout.bits == 16 ? "half floats" : fmt::format("{}-bit floats", layout.bits);
  return fmt::format("{} {}-bit integers",
                     layout.format == SAMPLEFORMAT_INT ? "signed" : "unsigned", layout.bits);
}

void RequireReadable(const Layout& layout) {
  const auto refuse = [](const std::string& what) { throw Error("a TIFF file " + what); };
  if (layout.width == 0 || layout.height == 0 || layout.samples == 0) refuse("without pixels");
  constexpr std::uint32_t kMaxSidePx = 1 << 20;
  if (layout.width > kMaxSidePx || layout.height > kMaxSidePx)
    refuse(fmt::format("of {}x{} px: at most {} px per side are read", layout.width, layout.height,
                       kMaxSidePx));
  if (layout.samples > CV_CN_MAX)
    refuse(fmt::format("with {} channels: at most {} are read", layout.samples, CV_CN_MAX));
  switch (layout.photometric) {
    case PHOTOMETRIC_SEPARATED:
      refuse("in CMYK, whose colours depend on inks: convert it to RGB");
      break;
    case PHOTOMETRIC_CIELAB:
    case PHOTOMETRIC_ICCLAB:
    case PHOTOMETRIC_ITULAB:
      refuse("in Lab: convert it to RGB");
      break;
    case PHOTOMETRIC_LOGL:
    case PHOTOMETRIC_LOGLUV:
      refuse("in LogLuv: convert it to a TIFF or EXR file of floats");
      break;
    default:
      break;
  }
  const int bits = layout.bits;
  bool is_known = false;
  if (layout.IsFloat()) {
    is_known = bits == 16 || bits == 32 || bits == 64;
  } else if (layout.format == SAMPLEFORMAT_INT) {
    is_known = bits == 8 || bits == 16 || bits == 32;
  } else if (layout.format == SAMPLEFORMAT_UINT) {
    is_known = (bits >= 1 && bits <= 16) || bits == 32;
  } else {
    refuse("of complex numbers");
  }
  if (!is_known) {
    refuse(
        fmt::format("of {}: unsigned integers of 1 to 16 or 32 bits, signed ones of 8, 16 or 32 "
                    "bits, and floats of 16, 32 or 64 bits are read",
                    TypeName(layout)));
  }
  if (TIFFIsCODECConfigured(layout.compression) == 0)
    refuse(fmt::format("with compression {}, which libtiff does not know", layout.compression));
}

// The bytes that hold `bits` bits.
std::size_t ContainerBytes(int bits) {
  return bits <= 8 ? 1 : static_cast<std::size_t>(bits) / 8 + (bits % 8 != 0 ? 1 : 0);
}

int StoredDepth(const Layout& layout) {
  const int bits = layout.bits;
  if (layout.IsFloat()) return bits == 16 ? CV_16F : bits == 32 ? CV_32F : CV_64F;
  if (layout.format == SAMPLEFORMAT_INT) return bits == 8 ? CV_8S : bits == 16 ? CV_16S : CV_32S;
  return bits <= 8 ? CV_8U : bits <= 16 ? CV_16U : CV_32S;
}

// Unpacks numbers of `bits` bits, the first in the highest bits of the first byte.
template <typename T>
void UnpackBits(const std::uint8_t* from, int bits, std::size_t count, T* to, std::size_t step) {
  std::uint32_t held = 0;
  int held_bits = 0;
  const std::uint32_t mask = (1U << bits) - 1;
  for (std::size_t i = 0; i < count; ++i) {
    while (held_bits < bits) {
      held = held << 8 | *from++;
      held_bits += 8;
    }
    held_bits -= bits;
    to[i * step] = static_cast<T>(held >> held_bits & mask);
  }
}

template <typename T>
void Spread(const std::uint8_t* from, std::size_t count, std::uint8_t* to, std::size_t step) {
  const T* values = reinterpret_cast<const T*>(from);  // NOLINT: the buffer is aligned
  T* const target = reinterpret_cast<T*>(to);          // NOLINT
  for (std::size_t i = 0; i < count; ++i) target[i * step] = values[i];
}

// Copies `count` values of a row to every `step`-th value at `to`.
void CopyRow(const Layout& layout, const std::uint8_t* from, std::size_t count, std::uint8_t* to,
             std::size_t step) {
  const int bits = layout.bits;
  if (bits < 8) return UnpackBits(from, bits, count, to, step);
  if (bits > 8 && bits < 16) {
    return UnpackBits(from, bits, count, reinterpret_cast<std::uint16_t*>(to), step);  // NOLINT
  }
  if (step == 1) {
    std::memcpy(to, from, count * ContainerBytes(bits));
    return;
  }
  switch (bits) {
    case 8:
      return Spread<std::uint8_t>(from, count, to, step);
    case 16:
      return Spread<std::uint16_t>(from, count, to, step);
    case 32:
      return Spread<std::uint32_t>(from, count, to, step);
    default:
      return Spread<std::uint64_t>(from, count, to, step);
  }
}

// Reads all strips or tiles into an image with interleaved channels.
void ReadChunks(const Layout& layout, OpenFile* file, cv::Mat* image) {
  TIFF* const tiff = file->tiff.get();
  const auto chunk_bytes = layout.is_tiled ? TIFFTileSize(tiff) : TIFFStripSize(tiff);
  const auto row_bytes = layout.is_tiled ? TIFFTileRowSize(tiff) : TIFFScanlineSize(tiff);
  // A chunk may be larger than the image, but not by much.
  const std::size_t samples = layout.SamplesPerChunkPixel();
  const std::size_t needed_row = (std::size_t{layout.chunk_width} * samples * layout.bits + 7) / 8;
  constexpr tmsize_t kMuch = tmsize_t{1} << 28;
  const auto image_bytes = static_cast<tmsize_t>(image->total() * image->elemSize());
  const tmsize_t max_chunk_bytes = std::min(tmsize_t{1} << 32, kMuch + image_bytes);
  if (chunk_bytes <= 0 || row_bytes <= 0 || static_cast<std::size_t>(row_bytes) < needed_row ||
      chunk_bytes > max_chunk_bytes || layout.chunk_width == 0 || layout.chunk_height == 0) {
    throw Error(file->error.empty() ? "the sizes of its strips or tiles make no sense"
                                    : file->error);
  }
  // Strips whose rows are those of the image are decoded into their place.
  const bool is_direct = !layout.is_tiled && !layout.IsPlanar() && image->isContinuous() &&
                         layout.bits % 8 == 0 &&
                         static_cast<std::size_t>(row_bytes) == image->step[0];
  std::vector<std::uint64_t> buffer(is_direct ? 0 : static_cast<std::size_t>(chunk_bytes) / 8 + 2);
  auto* const bytes = reinterpret_cast<std::uint8_t*>(buffer.data());  // NOLINT: aligned
  const std::size_t planes = layout.IsPlanar() ? layout.samples : 1;
  const std::size_t step = layout.IsPlanar() ? layout.samples : 1;
  const std::size_t value_bytes = image->elemSize1();
  for (std::size_t plane = 0; plane < planes; ++plane) {
    for (std::uint32_t y = 0; y < layout.height; y += layout.chunk_height) {
      for (std::uint32_t x = 0; x < layout.width; x += layout.chunk_width) {
        ThrowIfCancelled();
        const auto sample = static_cast<std::uint16_t>(plane);
        const std::uint32_t rows = std::min(layout.chunk_height, layout.height - y);
        const std::uint32_t columns = std::min(layout.chunk_width, layout.width - x);
        const tmsize_t wanted =
            layout.is_tiled ? chunk_bytes : row_bytes * static_cast<tmsize_t>(rows);
        const tmsize_t read =
            layout.is_tiled
                ? TIFFReadEncodedTile(tiff, TIFFComputeTile(tiff, x, y, 0, sample), bytes,
                                      chunk_bytes)
                : TIFFReadEncodedStrip(tiff, TIFFComputeStrip(tiff, y, sample),
                                       is_direct ? image->ptr(static_cast<int>(y)) : bytes, wanted);
        // Without an exception for it, memory that nobody wrote would become pixels.
        if (read != wanted) {
          throw Error(file->error.empty()
                          ? fmt::format("row {}: {} of {} bytes of a strip or tile can be read", y,
                                        std::max<tmsize_t>(read, 0), wanted)
                          : file->error);
        }
        for (std::uint32_t row = 0; row < rows && !is_direct; ++row) {
          std::uint8_t* const to = image->ptr(static_cast<int>(y + row)) +
                                   (std::size_t{x} * layout.samples + plane) * value_bytes;
          CopyRow(layout, bytes + static_cast<std::size_t>(row_bytes) * row, columns * samples, to,
                  step);
        }
      }
    }
  }
}

// Files with subsampled colours: libtiff makes RGB of 8 bits.
cv::Mat ReadAsRgba(const Layout& layout, OpenFile* file) {
  std::vector<std::uint32_t> raster(std::size_t{layout.width} * layout.height);
  const auto orientation = Field<std::uint16_t>(file->tiff.get(), TIFFTAG_ORIENTATION, 1);
  if (TIFFReadRGBAImageOriented(file->tiff.get(), layout.width, layout.height, raster.data(),
                                orientation, 1) != 1) {
    throw Error(file->error.empty() ? "it cannot be decoded" : file->error);
  }
  cv::Mat image(static_cast<int>(layout.height), static_cast<int>(layout.width), CV_8UC3);
  for (int y = 0; y < image.rows; ++y) {
    const std::uint32_t* from =
        raster.data() + std::size_t{layout.width} * static_cast<std::size_t>(y);
    std::uint8_t* to = image.ptr(y);
    for (int x = 0; x < image.cols; ++x) {
      to[3 * x] = static_cast<std::uint8_t>(TIFFGetR(from[x]));
      to[3 * x + 1] = static_cast<std::uint8_t>(TIFFGetG(from[x]));
      to[3 * x + 2] = static_cast<std::uint8_t>(TIFFGetB(from[x]));
    }
  }
  return image;
}

// Values of a palette become its colours: 8 bits if the palette has no more.
cv::Mat ByPalette(TIFF* tiff, const Layout& layout, const cv::Mat& indices) {
  std::uint16_t *red = nullptr, *green = nullptr, *blue = nullptr;
  if (TIFFGetField(tiff, TIFFTAG_COLORMAP, &red, &green, &blue) != 1 || layout.samples != 1)
    throw Error("a TIFF file with a palette that is not there");
  const std::size_t count = std::size_t{1} << layout.bits;
  bool is_small = true, is_doubled = true;  // 8 bits as they are, or v * 256 or v * 257
  for (const std::uint16_t* colours : {red, green, blue}) {
    for (std::size_t i = 0; i < count; ++i) {
      is_small = is_small && colours[i] < 256;
      const int low = colours[i] & 255, high = colours[i] >> 8;
      is_doubled = is_doubled && (low == 0 || low == high);
    }
  }
  const bool is_8_bit = is_small || is_doubled;
  cv::Mat image(indices.size(), is_8_bit ? CV_8UC3 : CV_16UC3);
  const std::uint16_t* const maps[] = {red, green, blue};
  for (int y = 0; y < indices.rows; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < indices.cols; ++x) {
      const std::size_t i = indices.depth() == CV_8U ? indices.at<std::uint8_t>(y, x)
                                                     : indices.at<std::uint16_t>(y, x);
      for (int c = 0; c < 3; ++c) {
        const std::uint16_t value = maps[c][i];
        if (is_8_bit) {
          image.ptr(y)[3 * x + c] = static_cast<std::uint8_t>(is_small ? value : value >> 8);
        } else {
          image.ptr<std::uint16_t>(y)[3 * x + c] = value;
        }
      }
    }
  }
  return image;
}

template <typename T>
void MapValues(cv::Mat* image, const std::function<T(T)>& map) {
  for (int y = 0; y < image->rows; ++y) {
    T* row = image->ptr<T>(y);
    for (int i = 0; i < image->cols * image->channels(); ++i) row[i] = map(row[i]);
  }
}

void Invert(const Layout& layout, cv::Mat* image) {
  const auto full = static_cast<std::uint32_t>((std::uint64_t{1} << layout.bits) - 1);
  if (image->depth() == CV_8U) {
    MapValues<std::uint8_t>(image,
                            [&](std::uint8_t v) { return static_cast<std::uint8_t>(full - v); });
  } else if (image->depth() == CV_16U) {
    MapValues<std::uint16_t>(image,
                             [&](std::uint16_t v) { return static_cast<std::uint16_t>(full - v); });
  } else {
    MapValues<std::int32_t>(image, [&](std::int32_t v) { return ~v; });  // unsigned 32 bits
  }
}

void SpreadBits(int bits, cv::Mat* image) {
  const std::uint32_t from = (1U << bits) - 1;
  if (image->depth() == CV_8U) {
    MapValues<std::uint8_t>(image, [&](std::uint8_t v) {
      return static_cast<std::uint8_t>((255U * v + from / 2) / from);
    });
  } else {
    MapValues<std::uint16_t>(image, [&](std::uint16_t v) {
      return static_cast<std::uint16_t>((65535U * v + from / 2) / from);
    });
  }
}

cv::Mat FromUnsigned32(const cv::Mat& stored) {
  cv::Mat wide(stored.size(), CV_64FC(stored.channels()));
  for (int y = 0; y < stored.rows; ++y) {
    const auto* from = stored.ptr<std::int32_t>(y);
    auto* to = wide.ptr<double>(y);
    for (int i = 0; i < stored.cols * stored.channels(); ++i)
      to[i] = static_cast<double>(static_cast<std::uint32_t>(from[i]));
  }
  return wide;
}

// Names the channels; those beyond the colours are alpha or other data.
void NameChannels(TIFF* tiff, const Layout& layout, int channels, ImageFacts* facts) {
  const bool has_colours =
      (layout.photometric == PHOTOMETRIC_RGB || layout.photometric == PHOTOMETRIC_PALETTE ||
       layout.photometric == PHOTOMETRIC_YCBCR || layout.photometric == kPhotometricLinearRaw) &&
      channels >= 3;
  facts->channels =
      has_colours ? std::vector<std::string>{"R", "G", "B"} : std::vector<std::string>{"Y"};
  std::uint16_t extra = 0;
  std::uint16_t* kinds = nullptr;
  TIFFGetFieldDefaulted(tiff, TIFFTAG_EXTRASAMPLES, &extra, &kinds);
  for (int i = 0, others = 1; static_cast<int>(facts->channels.size()) < channels; ++i) {
    const int kind = i < extra && kinds != nullptr ? kinds[i] : EXTRASAMPLE_UNSPECIFIED;
    const bool is_alpha = kind == EXTRASAMPLE_ASSOCALPHA || kind == EXTRASAMPLE_UNASSALPHA;
    if (is_alpha && facts->alpha == AlphaKind::kNone) {
      facts->alpha = kind == EXTRASAMPLE_ASSOCALPHA ? AlphaKind::kAssociated : AlphaKind::kStraight;
      facts->channels.emplace_back("A");
    } else {
      facts->channels.push_back(fmt::format("X{}", others++));
    }
  }
}

void TakeMosaic(TIFF* tiff, const Layout& layout, ImageFacts* facts) {
  RawFacts raw;
  raw.camera = Text(tiff, TIFFTAG_MAKE);
  const std::string model = Text(tiff, TIFFTAG_MODEL);
  if (!model.empty()) raw.camera += (raw.camera.empty() ? "" : " ") + model;
  raw.white_level = std::ldexp(1.0, layout.bits) - 1;
  raw.sensor_width_px = raw.active_width_px = static_cast<int>(layout.width);
  raw.sensor_height_px = raw.active_height_px = static_cast<int>(layout.height);
  std::uint16_t* repeats = nullptr;
  std::uint16_t count = 0;
  std::uint8_t* colours = nullptr;
  const bool is_stated = TIFFGetField(tiff, TIFFTAG_CFAREPEATPATTERNDIM, &repeats) == 1 &&
                         TIFFGetField(tiff, TIFFTAG_CFAPATTERN, &count, &colours) == 1;
  if (is_stated && repeats[0] * repeats[1] == count) {
    for (int i = 0; i < count; ++i) raw.mosaic += colours[i] < 3 ? "RGB"[colours[i]] : '?';
  }
  facts->raw = raw;
  facts->channels = {"mosaic"};
}

// ImageJ writes large stacks with one directory; the other images follow without one.
int ImageJImages(const std::string& description) {
  if (description.compare(0, 7, "ImageJ=") != 0) return 1;
  const std::size_t at = description.find("images=");
  return at == std::string::npos ? 1 : std::atoi(description.c_str() + at + 7);
}

// The number in the tag GDAL_NODATA, a text that libtiff does not know by itself.
std::optional<double> NoData(TIFF* tiff) {
  constexpr std::uint32_t kTagNoData = 42113, kMaxLength = 100;
  const TIFFField* const field = TIFFFindField(tiff, kTagNoData, TIFF_ASCII);
  if (field == nullptr || TIFFFieldPassCount(field) == 0 ||
      TIFFFieldReadCount(field) != TIFF_VARIABLE2) {
    return std::nullopt;
  }
  std::uint32_t count = 0;
  const char* text = nullptr;
  if (TIFFGetField(tiff, kTagNoData, &count, &text) != 1 || text == nullptr || count > kMaxLength)
    return std::nullopt;
  const char* const end = std::find(text, text + count, '\0');
  while (text != end && *text == ' ') ++text;
  double number = 0;
  return std::from_chars(text, end, number).ec == std::errc() ? std::optional(number)
                                                              : std::nullopt;
}

}  // namespace

std::vector<TiffPage> TiffPages(const std::string& bytes) {
  OpenFile file(bytes);
  if (!file.tiff) throw Error(file.error.empty() ? "a TIFF file is expected" : file.error);
  std::vector<TiffPage> pages, reduced;
  std::string description;
  for (unsigned i = 0; i < kMaxPages; ++i) {
    ThrowIfCancelled();
    const Layout layout(file.tiff.get());
    const double samples = layout.photometric == PHOTOMETRIC_YCBCR ? 1 : layout.samples;
    if (i == 0) description = Text(file.tiff.get(), TIFFTAG_IMAGEDESCRIPTION);
    (IsReducedOrMask(file.tiff.get()) ? reduced : pages)
        .push_back({i, static_cast<int>(std::min<std::uint32_t>(layout.width, 1U << 30)),
                    static_cast<int>(std::min<std::uint32_t>(layout.height, 1U << 30)),
                    samples * layout.bits, layout.compression});
    // A message about a tag that libtiff does not know is none about the directory.
    if (TIFFLastDirectory(file.tiff.get()) != 0) break;
    file.error.clear();
    if (TIFFReadDirectory(file.tiff.get()) != 1)
      throw Error(file.error.empty() ? "a directory of the file cannot be read" : file.error);
  }
  if (pages.empty()) pages = reduced;
  if (pages.size() == 1 && ImageJImages(description) > 1) {
    throw Error(
        fmt::format("an ImageJ stack of {} images, of which only the first has a "
                    "directory: save it as an image sequence or as OME-TIFF",
                    ImageJImages(description)));
  }
  return pages;
}

bool IsRawTiff(const std::string& bytes) {
  constexpr std::size_t kMarkAt = 8;
  if (bytes.size() > kMarkAt && bytes.compare(kMarkAt, 2, "CR") == 0) return true;  // Canon's CR2
  const OpenFile file(bytes);
  TIFF* const tiff = file.tiff.get();
  if (tiff == nullptr) return false;
  const std::uint8_t* version = nullptr;
  if (TIFFGetField(tiff, TIFFTAG_DNGVERSION, &version) == 1) return true;
  // A camera states its maker beside a mosaic; a mosaic of a laboratory's program is plain TIFF.
  const bool has_maker = !Text(tiff, TIFFTAG_MAKE).empty();
  for (unsigned i = 0; i < kMaxPages; ++i) {
    if (has_maker && IsRawPhotometric(tiff)) return true;
    std::uint16_t count = 0;
    std::uint64_t* offsets = nullptr;
    std::vector<std::uint64_t> others;
    if (TIFFGetField(tiff, TIFFTAG_SUBIFD, &count, &offsets) == 1)
      others.assign(offsets, offsets + count);
    const tdir_t here = TIFFCurrentDirectory(tiff);
    for (const std::uint64_t offset : others) {
      if (TIFFSetSubDirectory(tiff, offset) == 1 && IsRawPhotometric(tiff)) return true;
    }
    if (!others.empty() && TIFFSetDirectory(tiff, here) != 1) return false;
    if (TIFFReadDirectory(tiff) != 1) return false;
  }
  return false;
}

DecodedImage DecodeTiff(const std::string& bytes, const TiffPage& page, bool spread_bits) {
  OpenFile file(bytes);
  TIFF* const tiff = file.tiff.get();
  if (tiff == nullptr ||
      (page.directory > 0 && TIFFSetDirectory(tiff, static_cast<tdir_t>(page.directory)) != 1))
    throw Error(file.error.empty() ? "a TIFF file is expected" : file.error);
  file.error.clear();  // messages about tags
  const Layout layout(tiff);
  RequireReadable(layout);
  DecodedImage image;
  ImageFacts& facts = image.facts;
  facts.sample_type = TypeName(layout);
  facts.container_bits = static_cast<int>(8 * ContainerBytes(layout.bits));
  facts.description = Text(tiff, TIFFTAG_IMAGEDESCRIPTION);
  facts.no_data = NoData(tiff);
  const auto orientation = Field<std::uint16_t>(tiff, TIFFTAG_ORIENTATION, 1);
  if (orientation >= 1 && orientation <= 8) facts.orientation = orientation;
  std::uint32_t profile_bytes = 0;
  void* profile = nullptr;
  if (TIFFGetField(tiff, TIFFTAG_ICCPROFILE, &profile_bytes, &profile) == 1 && profile != nullptr)
    facts.icc_profile.assign(static_cast<const char*>(profile), profile_bytes);

  const bool is_ycbcr = layout.photometric == PHOTOMETRIC_YCBCR;
  const bool is_jpeg = layout.compression == COMPRESSION_JPEG;
  if (is_ycbcr && is_jpeg && layout.planar == PLANARCONFIG_CONTIG)
    TIFFSetField(tiff, TIFFTAG_JPEGCOLORMODE, JPEGCOLORMODE_RGB);
  cv::Mat& pixels = image.pixels;
  if (is_ycbcr && !(is_jpeg && layout.planar == PLANARCONFIG_CONTIG)) {
    pixels = ReadAsRgba(layout, &file);
  } else {
    pixels.create(static_cast<int>(layout.height), static_cast<int>(layout.width),
                  CV_MAKETYPE(StoredDepth(layout), layout.samples));
    ReadChunks(layout, &file, &pixels);
  }

  const bool is_unsigned = layout.format == SAMPLEFORMAT_UINT;
  if (layout.photometric == PHOTOMETRIC_PALETTE) {
    if (!is_unsigned || layout.bits > 16) throw Error("a TIFF file with a palette for such values");
    pixels = ByPalette(tiff, layout, pixels);
    facts.full_scale = pixels.depth() == CV_8U ? 255 : 65535;
    facts.notes.emplace_back("The colours of its palette are taken.");
  } else if (is_unsigned) {
    facts.is_inverted = layout.photometric == PHOTOMETRIC_MINISWHITE;
    if (facts.is_inverted) Invert(layout, &pixels);
    facts.full_scale = std::ldexp(1.0, layout.bits) - 1;
    if (layout.bits < 16 && layout.bits != 8) {
      facts.significant_bits = layout.bits;
      if (spread_bits) {
        SpreadBits(layout.bits, &pixels);
        facts.full_scale = layout.bits < 8 ? 255 : 65535;
      }
    }
    if (layout.bits == 32) pixels = FromUnsigned32(pixels);
  } else if (layout.IsFloat() && layout.bits == 16) {
    cv::Mat wide;
    pixels.convertTo(wide, CV_32F);
    pixels = wide;
  }
  NameChannels(tiff, layout, pixels.channels(), &facts);
  if (layout.photometric == kPhotometricCfa && pixels.channels() == 1)
    TakeMosaic(tiff, layout, &facts);
  return image;
}

std::string EncodeTiff(const cv::Mat& pixels, const ImageWriting& writing) {
  const int depth = pixels.depth(), channels = pixels.channels();
  const auto width = static_cast<std::uint32_t>(pixels.cols);
  const auto height = static_cast<std::uint32_t>(pixels.rows);
  const std::size_t row_bytes = pixels.elemSize() * width;
  constexpr std::size_t kRoomForDirectory = 1 << 20;
  const bool is_big =
      row_bytes * height > std::numeric_limits<std::uint32_t>::max() - kRoomForDirectory;
  std::string bytes;
  OpenFile file(BytesInMemory{&bytes, &bytes}, is_big ? "w8" : "w");
  TIFF* const tiff = file.tiff.get();
  bool done = tiff != nullptr;
  const auto set = [&](std::uint32_t tag, auto... values) {
    done = done && TIFFSetField(tiff, tag, values...) == 1;
  };
  const auto strip_rows =
      static_cast<std::uint32_t>(std::clamp<std::size_t>(kStripBytes / row_bytes, 1, height));
  set(TIFFTAG_IMAGEWIDTH, width);
  set(TIFFTAG_IMAGELENGTH, height);
  set(TIFFTAG_BITSPERSAMPLE, static_cast<int>(8 * pixels.elemSize1()));
  set(TIFFTAG_SAMPLEFORMAT, depth == CV_32F ? SAMPLEFORMAT_IEEEFP : SAMPLEFORMAT_UINT);
  set(TIFFTAG_SAMPLESPERPIXEL, channels);
  // The noise of photographs and floats hardly gets smaller.
  set(TIFFTAG_COMPRESSION, depth == CV_8U ? COMPRESSION_ADOBE_DEFLATE : COMPRESSION_NONE);
  if (depth == CV_8U) set(TIFFTAG_PREDICTOR, PREDICTOR_HORIZONTAL);
  set(TIFFTAG_PHOTOMETRIC, channels == 1 ? PHOTOMETRIC_MINISBLACK : PHOTOMETRIC_RGB);
  set(TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  set(TIFFTAG_ROWSPERSTRIP, strip_rows);
  if (channels == 4) {
    const std::uint16_t straight = EXTRASAMPLE_UNASSALPHA;
    set(TIFFTAG_EXTRASAMPLES, 1, &straight);
  }
  if (!writing.description.empty()) set(TIFFTAG_IMAGEDESCRIPTION, writing.description.c_str());
  if (!writing.icc_profile.empty()) {
    set(TIFFTAG_ICCPROFILE, static_cast<std::uint32_t>(writing.icc_profile.size()),
        writing.icc_profile.data());
  }
  std::vector<std::uint8_t> strip;
  for (std::uint32_t y = 0; done && y < height; y += strip_rows) {
    ThrowIfCancelled();
    const std::uint32_t rows = std::min(strip_rows, height - y);
    strip.clear();  // the predictor changes the values in place
    for (std::uint32_t row = 0; row < rows; ++row) {
      const std::uint8_t* from = pixels.ptr(static_cast<int>(y + row));
      strip.insert(strip.end(), from, from + row_bytes);
    }
    const auto size = static_cast<tmsize_t>(strip.size());
    done = TIFFWriteEncodedStrip(tiff, y / strip_rows, strip.data(), size) == size;
  }
  done = done && TIFFWriteDirectory(tiff) == 1;
  file.tiff.reset();
  if (!done) throw Error("an image could not be encoded as TIFF: " + file.error);
  return bytes;
}

}  // namespace thicklens::io
