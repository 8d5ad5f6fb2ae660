#include "tools/io/image_file_kind.h"

#include <fmt/format.h>
#include <tiffio.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>

#include "thicklens/base/error.h"
#include "thicklens/base/memory_available.h"
#include "thicklens/base/printable_text.h"
#include "tools/io/opencv_codecs.h"
#include "tools/io/png_check.h"
#include "tools/io/png_pixels.h"

namespace thicklens::io {
namespace {

using namespace std::string_literals;

struct StatedSize {
  double width_px = 0, height_px = 0;
  double bytes_per_px = 1;
  double most_of_a_byte = 1;  // at most so many decoded bytes per byte of the file
};

bool StartsWith(const std::string& bytes, const std::string& start) {
  return bytes.compare(0, start.size(), start) == 0;
}

// Reads zeros beyond the end.
std::uint32_t BigEndian(const std::string& bytes, std::size_t at, std::size_t count) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < count; ++i) {
    value = value << 8 | (at + i < bytes.size() ? static_cast<std::uint8_t>(bytes[at + i]) : 0U);
  }
  return value;
}

double LittleEndian(const std::string& bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 4; i-- > 0;) value = value << 8 | BigEndian(bytes, at + i, 1);
  return static_cast<std::int32_t>(value);
}

std::optional<StatedSize> SizeOfPng(const std::string& bytes) {
  const double bits = BigEndian(bytes, 24, 1);
  constexpr std::array<int, 7> kChannels = {1, 1, 3, 1, 2, 1, 4};
  const double channels = kChannels[std::min<std::size_t>(BigEndian(bytes, 25, 1), 6)];
  constexpr double kDeflate = 1032;
  return StatedSize{static_cast<double>(BigEndian(bytes, 16, 4)),
                    static_cast<double>(BigEndian(bytes, 20, 4)), bits * channels / 8, kDeflate};
}

// Goes from segment to segment up to the start of frame.
std::optional<StatedSize> SizeOfJpeg(const std::string& bytes) {
  std::size_t at = 2;
  while (at + 9 < bytes.size()) {
    // Skips to the next marker, as libjpeg does.
    if (BigEndian(bytes, at, 1) != 0xFF) {
      ++at;
      continue;
    }
    const std::uint32_t marker = BigEndian(bytes, at + 1, 1);
    const bool is_frame =
        marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
    if (is_frame) {
      // Each 8 x 8 px take at least one bit, but none if all blocks are alike (progressive).
      const bool is_arithmetic = marker >= 0xC9;
      const double most = is_arithmetic ? 1 << 16 : 512;
      return StatedSize{static_cast<double>(BigEndian(bytes, at + 7, 2)),
                        static_cast<double>(BigEndian(bytes, at + 5, 2)), 1, most};
    }
    const bool is_alone = marker == 0 || marker == 1 || (marker >= 0xD0 && marker <= 0xD8);
    // Bytes 0xFF may precede a marker as padding.
    at += marker == 0xFF ? 1 : is_alone ? 2 : 2 + BigEndian(bytes, at + 2, 2);
  }
  return std::nullopt;
}

// The bytes of a file that libtiff reads from memory.
struct BytesInMemory {
  const std::string* bytes = nullptr;
  std::size_t at = 0;

  static tmsize_t Read(thandle_t handle, void* to, tmsize_t size) {
    auto* file = static_cast<BytesInMemory*>(handle);
    const std::size_t left = file->bytes->size() - std::min(file->at, file->bytes->size());
    const std::size_t count = std::min(left, static_cast<std::size_t>(std::max<tmsize_t>(size, 0)));
    if (count > 0) std::memcpy(to, file->bytes->data() + file->at, count);
    file->at += count;
    return static_cast<tmsize_t>(count);
  }
  static tmsize_t Write(thandle_t, void*, tmsize_t) { return 0; }
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

int KeepStill(TIFF*, void*, const char*, const char*, std::va_list) { return 1; }

struct CloseTiff {
  void operator()(TIFF* tiff) const { TIFFClose(tiff); }
};

// Returns the maximum expansion of a compression in decoded bytes per byte; for rarely used ones
// the value is a generous bound.
double MostOfAByte(int compression) {
  switch (compression) {
    case COMPRESSION_NONE:
      return 1;
    case COMPRESSION_PACKBITS:
      return 64;
    case COMPRESSION_LZW:
    case COMPRESSION_DEFLATE:
    case COMPRESSION_ADOBE_DEFLATE:
      return 2048;
    default:
      return 1 << 16;
  }
}

std::optional<StatedSize> SizeOfTiff(const std::string& bytes) {
  BytesInMemory file{&bytes, 0};
  TIFFOpenOptions* options = TIFFOpenOptionsAlloc();
  TIFFOpenOptionsSetErrorHandlerExtR(options, KeepStill, nullptr);
  TIFFOpenOptionsSetWarningHandlerExtR(options, KeepStill, nullptr);
  const std::unique_ptr<TIFF, CloseTiff> tiff(TIFFClientOpenExt(
      "", "rm", &file, BytesInMemory::Read, BytesInMemory::Write, BytesInMemory::Seek,
      BytesInMemory::Close, BytesInMemory::Size, nullptr, nullptr, options));
  TIFFOpenOptionsFree(options);
  if (!tiff) return std::nullopt;
  std::uint32_t width = 0, height = 0;
  std::uint16_t bits = 1, channels = 1, compression = COMPRESSION_NONE;
  std::uint16_t photometric = PHOTOMETRIC_MINISBLACK;
  TIFFGetField(tiff.get(), TIFFTAG_IMAGEWIDTH, &width);
  TIFFGetField(tiff.get(), TIFFTAG_IMAGELENGTH, &height);
  TIFFGetFieldDefaulted(tiff.get(), TIFFTAG_BITSPERSAMPLE, &bits);
  TIFFGetFieldDefaulted(tiff.get(), TIFFTAG_SAMPLESPERPIXEL, &channels);
  TIFFGetFieldDefaulted(tiff.get(), TIFFTAG_COMPRESSION, &compression);
  TIFFGetField(tiff.get(), TIFFTAG_PHOTOMETRIC, &photometric);
  if (photometric == PHOTOMETRIC_YCBCR) channels = 1;  // the other channels have fewer pixels
  return StatedSize{static_cast<double>(width), static_cast<double>(height), bits / 8.0 * channels,
                    MostOfAByte(compression)};
}

struct ExrAttribute {
  std::string name;
  double size = 0;  // size of its value as stated: it may be negative, or end beyond the file
  std::size_t value_at = 0;

  std::size_t end() const { return value_at + static_cast<std::size_t>(std::max(size, 0.0)); }
};

// Reads the name, type, size and value of the attribute that begins there. Returns none at the end
// of a header, or if the file ends before a value.
std::optional<ExrAttribute> ExrAttributeAt(const std::string& bytes, std::size_t at) {
  if (at >= bytes.size() || bytes[at] == '\0') return std::nullopt;
  ExrAttribute attribute;
  attribute.name = bytes.c_str() + at;
  const std::size_t type_at = at + attribute.name.size() + 1;
  if (type_at >= bytes.size()) return std::nullopt;
  const std::size_t size_at = type_at + std::strlen(bytes.c_str() + type_at) + 1;
  attribute.value_at = size_at + 4;
  if (attribute.value_at > bytes.size()) return std::nullopt;
  attribute.size = LittleEndian(bytes, size_at);
  return attribute;
}

constexpr std::size_t kExrHeaderAt = 8;

std::optional<StatedSize> SizeOfExr(const std::string& bytes) {
  std::size_t at = kExrHeaderAt;
  while (const std::optional<ExrAttribute> attribute = ExrAttributeAt(bytes, at)) {
    if (attribute->size < 0) break;
    if (attribute->name == "dataWindow") {
      const auto side = [&](std::size_t low, std::size_t high) {
        return LittleEndian(bytes, attribute->value_at + high) + 1 -
               LittleEndian(bytes, attribute->value_at + low);
      };
      constexpr double kHalfFloat = 2, kMax = 1 << 16;
      return StatedSize{side(0, 8), side(4, 12), kHalfFloat, kMax};
    }
    at = attribute->end();
  }
  return std::nullopt;
}

// Checks the sizes of attributes, because OpenEXR allocates memory for an attribute before it reads
// it. A file of several parts has one header per part, one after the other.
void RequirePossibleExrHeaders(const std::string& bytes, const std::string& name) {
  std::size_t at = kExrHeaderAt;
  while (at < bytes.size()) {
    const std::optional<ExrAttribute> attribute = ExrAttributeAt(bytes, at);
    if (attribute && (attribute->size < 0 || attribute->end() > bytes.size())) {
      throw Error(fmt::format("{}: a broken image: {:.0f} bytes of '{}' do not fit into {} bytes",
                              name, attribute->size, PrintableUtf8(attribute->name), bytes.size()));
    }
    constexpr std::size_t kFlagsAt = 5;  // the second byte of the version
    constexpr char kSeveralParts = 0x10;
    const bool is_end = bytes[at] == '\0';
    if (!attribute && !(is_end && (bytes[kFlagsAt] & kSeveralParts) != 0)) return;
    at = attribute ? attribute->end() : at + 1;
    // An empty header marks the end of the headers.
    if (is_end && at < bytes.size() && bytes[at] == '\0') return;
  }
}

std::optional<StatedSize> SizeOfBmp(const std::string& bytes) {
  constexpr double kRunLength = 1 << 16;
  // The oldest header has sides of 16 bits and no compression; OpenCV reads no header between it
  // and the usual ones.
  constexpr double kOldest = 12, kMinUsual = 36;
  const double header = LittleEndian(bytes, 14);
  if (header == kOldest) {
    const auto word = [&](std::size_t at) {
      return static_cast<double>(BigEndian(bytes, at + 1, 1) << 8 | BigEndian(bytes, at, 1));
    };
    return StatedSize{word(18), word(20), word(24) / 8, 1};
  }
  if (header < kMinUsual) return std::nullopt;
  const double bits = BigEndian(bytes, 28, 1);
  return StatedSize{std::abs(LittleEndian(bytes, 18)), std::abs(LittleEndian(bytes, 22)), bits / 8,
                    BigEndian(bytes, 30, 1) == 0 ? 1 : kRunLength};
}

std::optional<StatedSize> SizeOfPnm(const std::string& bytes) {
  std::array<double, 2> sides{};
  std::size_t at = 2;
  for (double& side : sides) {
    const auto is_digit = [&] { return bytes[at] >= '0' && bytes[at] <= '9'; };
    // Skips to the next digit.
    while (at < bytes.size() && !is_digit()) {
      if (bytes[at] == '#') at = std::min(bytes.find_first_of("\r\n", at), bytes.size() - 1);
      ++at;
    }
    constexpr double kMuch = 1e12;
    for (; at < bytes.size() && is_digit(); ++at) {
      side = std::min(10 * side + (bytes[at] - '0'), kMuch);
    }
    ++at;  // OpenCV consumes one more byte with the number, even where it begins a comment
  }
  const bool is_bitmap = bytes[1] == '4';
  return StatedSize{sides[0], sides[1], is_bitmap ? 1.0 / 8 : 1, 1};
}

std::optional<StatedSize> SizeOf(const std::string& bytes, ImageFileKind kind) {
  switch (kind) {
    case ImageFileKind::kPng:
      return SizeOfPng(bytes);
    case ImageFileKind::kJpeg:
      return SizeOfJpeg(bytes);
    case ImageFileKind::kTiff:
      return SizeOfTiff(bytes);
    case ImageFileKind::kExr:
      return SizeOfExr(bytes);
    case ImageFileKind::kBmp:
      return SizeOfBmp(bytes);
    case ImageFileKind::kPnm:
      break;
  }
  return SizeOfPnm(bytes);
}

// A small file may need more memory than there is when decoded; this is reported beforehand, with
// the file's name. A decoded image has at least one byte per value, and is then copied to wider
// numbers.
void RequireMemory(const StatedSize& size, const std::string& name) {
  constexpr double kCopies = 3, kLittleMib = 64;
  const double needed_mib =
      kCopies * size.width_px * size.height_px * std::max(1.0, size.bytes_per_px) / (1 << 20);
  if (needed_mib <= kLittleMib) return;
  const std::optional<double> left_mib = MemoryLeftMib();
  if (!left_mib || needed_mib <= *left_mib) return;
  throw Error(
      fmt::format("{}: {:.0f}x{:.0f} px need at least {:.0f} MiB of memory, {:.0f} MiB are left",
                  name, size.width_px, size.height_px, needed_mib, *left_mib));
}

}  // namespace

std::optional<ImageFileKind> KindOfImage(const std::string& bytes) {
  if (StartsWith(bytes, "\x89PNG\r\n\x1A\n")) return ImageFileKind::kPng;
  if (StartsWith(bytes, "\xFF\xD8\xFF")) return ImageFileKind::kJpeg;
  for (const std::string& start : {"II*\0"s, "MM\0*"s, "II+\0"s, "MM\0+"s}) {  // + for BigTIFF
    if (StartsWith(bytes, start)) return ImageFileKind::kTiff;
  }
  if (StartsWith(bytes, "\x76\x2F\x31\x01")) return ImageFileKind::kExr;
  if (StartsWith(bytes, "BM")) return ImageFileKind::kBmp;
  // This test is as strict as OpenCV, which otherwise would try other decoders, one of which ends
  // the program.
  const bool is_pnm = bytes.size() > 2 && bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '6' &&
                      std::isspace(static_cast<unsigned char>(bytes[2])) != 0;
  if (is_pnm) return ImageFileKind::kPnm;
  return std::nullopt;
}

void RequirePossibleSize(const std::string& bytes, ImageFileKind kind, const std::string& name) {
  if (kind == ImageFileKind::kExr) RequirePossibleExrHeaders(bytes, name);
  const std::optional<StatedSize> size = SizeOf(bytes, kind);
  if (!size) return;
  // Small images may have a container that is larger than needed.
  constexpr double kLittle = 1 << 20;
  const double needed = size->width_px * size->height_px * size->bytes_per_px;
  if (needed <= kLittle + size->most_of_a_byte * static_cast<double>(bytes.size())) {
    RequireMemory(*size, name);
    return;
  }
  throw Error(fmt::format("{}: a broken image: {:.0f}x{:.0f} px do not fit into {} bytes", name,
                          size->width_px, size->height_px, bytes.size()));
}

cv::Mat DecodeUnchanged(const std::string& bytes, const std::string& name,
                        const std::vector<ImageFileKind>& kinds, std::string* why) {
  why->clear();
  const std::optional<ImageFileKind> kind = KindOfImage(bytes);
  if (!kind || std::find(kinds.begin(), kinds.end(), *kind) == kinds.end()) return {};
  RequireWholePng(bytes, name);
  RequirePossibleSize(bytes, *kind, name);
  if (*kind == ImageFileKind::kPng) return DecodePngPixels(bytes, why);
  const OpenCvCodecs* codecs = nullptr;
  try {
    codecs = &LoadedOpenCvCodecs();
  } catch (const Error& error) {
    throw Error(fmt::format("{}: {}", name, error.what()));
  }
  return codecs->decode(bytes, why);
}

}  // namespace thicklens::io
