#include "tools/io/image_file_kind.h"

#include <fmt/format.h>
#include <tiffio.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/memory_available.h"
#include "thicklens/base/printable_text.h"
#include "tools/io/image_library.h"
#include "tools/io/tiff_pixels.h"

namespace thicklens::io {
namespace {

using namespace std::string_literals;

struct StatedSize {
  double width_px = 0, height_px = 0;
  double bytes_per_px = 1;
  double most_of_a_byte = 1;  // at most so many decoded bytes per byte of the file
};

bool HasAt(const std::string& bytes, std::size_t at, const std::string& text) {
  return bytes.size() >= at && bytes.compare(at, text.size(), text) == 0;
}

bool StartsWith(const std::string& bytes, const std::string& start) {
  return HasAt(bytes, 0, start);
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

// The largest of its pages.
std::optional<StatedSize> SizeOfTiff(const std::string& bytes) {
  std::optional<StatedSize> largest;
  std::vector<TiffPage> pages;
  try {
    pages = TiffPages(bytes);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error&) {
    return std::nullopt;
  }
  for (const TiffPage& page : pages) {
    const StatedSize size{static_cast<double>(page.width_px), static_cast<double>(page.height_px),
                          page.bits_per_px / 8, MostOfAByte(page.compression)};
    if (!largest || size.width_px * size.height_px * size.bytes_per_px >
                        largest->width_px * largest->height_px * largest->bytes_per_px) {
      largest = size;
    }
  }
  return largest;
}

struct ExrAttribute {
  std::string name, type;
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
  attribute.type = bytes.c_str() + type_at;
  const std::size_t size_at = type_at + attribute.type.size() + 1;
  attribute.value_at = size_at + 4;
  if (attribute.value_at > bytes.size()) return std::nullopt;
  attribute.size = LittleEndian(bytes, size_at);
  return attribute;
}

constexpr std::size_t kExrHeaderAt = 8;

// The data window of a part of an EXR file.
StatedSize SizeOfExrWindow(const std::string& bytes, const ExrAttribute& window) {
  const auto side = [&](std::size_t low, std::size_t high) {
    return LittleEndian(bytes, window.value_at + high) + 1 -
           LittleEndian(bytes, window.value_at + low);
  };
  constexpr double kHalfFloat = 2, kMax = 1 << 16;
  return {side(0, 8), side(4, 12), kHalfFloat, kMax};
}

constexpr std::size_t kBytesPerExrChannel = 16;  // after the name

// Throws Error for a channel whose type is none of those of EXR: OpenImageIO 2.4 aborts the
// program.
void RequireKnownChannels(const std::string& bytes, const ExrAttribute& channels,
                          const std::string& name) {
  std::size_t at = channels.value_at;
  while (at < channels.end() && bytes[at] != '\0') {
    const std::string channel = bytes.c_str() + at;
    at += channel.size() + 1;
    const double type = LittleEndian(bytes, at);
    constexpr double kUnsigned = 0, kFloat = 2;
    if (!(type >= kUnsigned && type <= kFloat)) {
      throw Error(fmt::format(
          "{}: a broken image: channel '{}' has the type {:.0f}; 0 (unsigned 32-bit integers), 1 "
          "(half) or 2 (float) is expected",
          name, PrintableUtf8(channel), type));
    }
    at += kBytesPerExrChannel;
  }
}

// Returns how many bytes OpenEXR reads as the value, whatever size is stated; none if it reads the
// stated size.
std::optional<double> BytesOfExrValue(const std::string& bytes, const ExrAttribute& attribute) {
  static const std::map<std::string, double> kOfType = {{"box2f", 16},
                                                        {"box2i", 16},
                                                        {"chromaticities", 32},
                                                        {"compression", 1},
                                                        {"deepImageState", 1},
                                                        {"double", 8},
                                                        {"envmap", 1},
                                                        {"float", 4},
                                                        {"int", 4},
                                                        {"keycode", 28},
                                                        {"lineOrder", 1},
                                                        {"m33d", 72},
                                                        {"m33f", 36},
                                                        {"m44d", 128},
                                                        {"m44f", 64},
                                                        {"rational", 8},
                                                        {"tiledesc", 9},
                                                        {"timecode", 8},
                                                        {"v2d", 16},
                                                        {"v2f", 8},
                                                        {"v2i", 8},
                                                        {"v3d", 24},
                                                        {"v3f", 12},
                                                        {"v3i", 12}};
  const auto fixed = kOfType.find(attribute.type);
  if (fixed != kOfType.end()) return fixed->second;
  const std::size_t begin = attribute.value_at;
  if (attribute.type == "preview") {  // two sides and that many pixels of four bytes
    constexpr double kSides = 8, kBytesPerPixel = 4;
    return kSides + kBytesPerPixel * LittleEndian(bytes, begin) * LittleEndian(bytes, begin + 4);
  }
  if (attribute.type == "chlist") {  // names, each with 16 bytes, up to an empty name
    std::size_t at = begin;
    while (at < bytes.size() && bytes[at] != '\0')
      at += std::strlen(bytes.c_str() + at) + 1 + kBytesPerExrChannel;
    return static_cast<double>(at + 1 - begin);
  }
  if (attribute.type == "stringvector") {  // each with its length before it
    double read = 0;
    while (read < attribute.size) {
      const double length = LittleEndian(bytes, begin + static_cast<std::size_t>(read));
      constexpr double kLength = 4;
      if (length < 0) return length;
      read += kLength + length;
    }
    return read;
  }
  return std::nullopt;
}

// Throws Error if the file is too small for an image of that size, or memory is.
void RequireFits(const StatedSize& size, double least_rows, const std::string& bytes,
                 const std::string& name) {
  // Small images may have a container that is larger than needed.
  constexpr double kLittle = 1 << 20, kMuch = 1 << 28;
  const double possible = size.most_of_a_byte * static_cast<double>(bytes.size());
  const double needed = size.width_px * size.height_px * size.bytes_per_px;
  const double taken = size.width_px * least_rows * size.bytes_per_px;
  if (needed <= kLittle + possible && taken <= kMuch + possible) {
    RequireMemory(size.width_px, size.height_px, size.bytes_per_px, name);
    return;
  }
  throw Error(fmt::format("{}: a broken image: {:.0f}x{:.0f} px do not fit into {} bytes", name,
                          size.width_px, size.height_px, bytes.size()));
}

// Checks the sizes of attributes, because OpenEXR allocates memory for an attribute before it reads
// it. Of some types it reads another number of bytes than is stated, and would take what follows
// for the name of the next attribute. A file of several parts has one header per part, one after
// the other.
void RequirePossibleExrHeaders(const std::string& bytes, const std::string& name) {
  std::size_t at = kExrHeaderAt;
  while (at < bytes.size()) {
    const std::optional<ExrAttribute> attribute = ExrAttributeAt(bytes, at);
    if (attribute && (attribute->size < 0 || attribute->end() > bytes.size())) {
      throw Error(fmt::format("{}: a broken image: {:.0f} bytes of '{}' do not fit into {} bytes",
                              name, attribute->size, PrintableUtf8(attribute->name), bytes.size()));
    }
    const auto read = attribute ? BytesOfExrValue(bytes, *attribute) : std::nullopt;
    if (read && *read != attribute->size) {
      throw Error(fmt::format(
          "{}: a broken image: '{}' of type {} states {:.0f} bytes and has {:.0f}", name,
          PrintableUtf8(attribute->name), PrintableUtf8(attribute->type), attribute->size, *read));
    }
    if (attribute && attribute->type == "chlist") RequireKnownChannels(bytes, *attribute, name);
    // OpenImageIO 2.4 takes memory for this many rows at least, which matters if they are very
    // wide.
    constexpr double kRows = 256;
    if (attribute && attribute->name == "dataWindow")
      RequireFits(SizeOfExrWindow(bytes, *attribute), kRows, bytes, name);
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
  }
  constexpr char kPam = '7';  // its size is in words; its decoder checks it
  if (bytes[1] == kPam) return std::nullopt;
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
    case ImageFileKind::kBmp:
      return SizeOfBmp(bytes);
    case ImageFileKind::kPnm:
      return SizeOfPnm(bytes);
    default:
      return std::nullopt;  // its decoder checks the size before it allocates
  }
}

bool IsIsoMedia(const std::string& bytes, const std::vector<std::string>& brands) {
  constexpr std::size_t kTypeAt = 4, kBrandAt = 8, kBrandBytes = 4, kMaxBytes = 256;
  if (!HasAt(bytes, kTypeAt, "ftyp")) return false;
  const std::size_t end =
      std::min({static_cast<std::size_t>(BigEndian(bytes, 0, 4)), bytes.size(), kMaxBytes});
  for (std::size_t at = kBrandAt; at + kBrandBytes <= end; at += kBrandBytes) {
    constexpr std::size_t kMinorVersionAt = 12;
    if (at == kMinorVersionAt) continue;
    if (std::find(brands.begin(), brands.end(), bytes.substr(at, kBrandBytes)) != brands.end())
      return true;
  }
  return false;
}

// Raw files that are no TIFF files.
bool IsOtherRaw(const std::string& bytes) {
  for (const std::string& start : {"IIRO"s, "IIRS"s, "MMOR"s, "IIU\0"s, "FUJIFILMCCD-RAW"s, "FOVb"s,
                                   "\0MRM"s, "II\x1A\0\0\0HEAPCCDR"s}) {
    if (StartsWith(bytes, start)) return true;
  }
  return IsIsoMedia(bytes, {"crx "});
}

}  // namespace

// A small file may need more memory than there is when decoded; this is reported beforehand, with
// the file's name. A decoded image has at least one byte per value, and is then copied to wider
// numbers.
void RequireMemory(double width_px, double height_px, double bytes_per_px,
                   const std::string& name) {
  constexpr double kCopies = 3, kLittleMib = 64;
  const double needed_mib =
      kCopies * width_px * height_px * std::max(1.0, bytes_per_px) / (1 << 20);
  if (needed_mib <= kLittleMib) return;
  const std::optional<double> left_mib = MemoryLeftMib();
  if (!left_mib || needed_mib <= *left_mib) return;
  throw Error(
      fmt::format("{}: {:.0f}x{:.0f} px need at least {:.0f} MiB of memory, {:.0f} MiB are left",
                  name, width_px, height_px, needed_mib, *left_mib));
}

std::optional<ImageFileKind> KindOfImage(const std::string& bytes) {
  if (StartsWith(bytes, "\x89PNG\r\n\x1A\n")) return ImageFileKind::kPng;
  if (StartsWith(bytes, "\xFF\xD8\xFF")) return ImageFileKind::kJpeg;
  for (const std::string& start : {"II*\0"s, "MM\0*"s, "II+\0"s, "MM\0+"s}) {  // + for BigTIFF
    if (StartsWith(bytes, start))
      return IsRawTiff(bytes) ? ImageFileKind::kRaw : ImageFileKind::kTiff;
  }
  if (StartsWith(bytes, "\x76\x2F\x31\x01")) return ImageFileKind::kExr;
  if (StartsWith(bytes, "BM")) return ImageFileKind::kBmp;
  if (StartsWith(bytes, "RIFF") && HasAt(bytes, 8, "WEBP")) return ImageFileKind::kWebp;
  if (IsIsoMedia(bytes, {"heic", "heix", "heim", "heis", "hevc", "hevx", "mif1", "msf1", "avif",
                         "avis"})) {
    return ImageFileKind::kHeif;
  }
  constexpr std::size_t kDicomMarkAt = 128;
  if (HasAt(bytes, kDicomMarkAt, "DICM")) return ImageFileKind::kDicom;
  if (IsOtherRaw(bytes)) return ImageFileKind::kRaw;
  const bool is_p = bytes.size() > 2 && bytes[0] == 'P' &&
                    std::isspace(static_cast<unsigned char>(bytes[2])) != 0;
  if (is_p && bytes[1] >= '1' && bytes[1] <= '7') return ImageFileKind::kPnm;
  if (is_p && (bytes[1] == 'f' || bytes[1] == 'F')) return ImageFileKind::kPfm;
  return std::nullopt;
}

std::string NameOfOtherKind(const std::string& bytes) {
  const std::vector<std::pair<std::string, std::string>> starts = {
      {"GIF8", "GIF"},
      {"8BPS", "PSD (Photoshop)"},
      {"\0\0\0\x0CjP  "s, "JPEG 2000"},
      {"\xFF\x4F\xFF\x51", "JPEG 2000"},
      {"\xFF\x0A", "JPEG XL"},
      {"\0\0\0\x0CJXL "s, "JPEG XL"},
      {"#?RADIANCE", "Radiance HDR"},
      {"#?RGBE", "Radiance HDR"},
      {"SDPX", "DPX"},
      {"XPDS", "DPX"},
      {"SIMPLE  =", "FITS"},
      {"%PDF", "PDF"},
      {"\x93NUMPY", "NPY (numpy)"},
      {"MATLAB ", "MAT (Matlab)"},
      {"\x89HDF\r\n", "HDF5"},
      {"PK\x03\x04", "ZIP"},
      {"\x1F\x8B", "gzip"},
      {"<?xml", "XML"},
      {"<svg", "SVG"},
      {"\x1A\x45\xDF\xA3", "Matroska or WebM video"},
      {"NITF", "NITF"}};
  for (const auto& [start, name] : starts) {
    if (StartsWith(bytes, start)) return name;
  }
  if (bytes.compare(std::min<std::size_t>(4, bytes.size()), 4, "ftyp") == 0)
    return "MP4 or MOV video";
  if (StartsWith(bytes, "RIFF") &&
      bytes.compare(std::min<std::size_t>(8, bytes.size()), 4, "AVI ") == 0)
    return "AVI video";
  return "";
}

std::string ReadableKinds() {
  return HasImageLibrary()
             ? "PNG, TIFF, JPEG, EXR, WebP, HEIF (HEIC, AVIF), BMP, PNM, PFM, DICOM or raw"
             : "PNG, TIFF, JPEG, PNM or PFM";
}

std::string NameOf(ImageFileKind kind) {
  switch (kind) {
    case ImageFileKind::kPng:
      return "PNG";
    case ImageFileKind::kTiff:
      return "TIFF";
    case ImageFileKind::kPnm:
      return "PNM";
    case ImageFileKind::kPfm:
      return "PFM";
    case ImageFileKind::kJpeg:
      return "JPEG";
    case ImageFileKind::kExr:
      return "EXR";
    case ImageFileKind::kWebp:
      return "WebP";
    case ImageFileKind::kHeif:
      return "HEIF";
    case ImageFileKind::kBmp:
      return "BMP";
    case ImageFileKind::kDicom:
      return "DICOM";
    case ImageFileKind::kRaw:
      break;
  }
  return "raw";
}

bool IsLossy(const std::string& bytes, ImageFileKind kind) {
  if (kind != ImageFileKind::kWebp) return kind == ImageFileKind::kJpeg;
  constexpr std::size_t kHeaderBytes = 12, kNameBytes = 4, kChunkBytes = 8;
  std::size_t at = kHeaderBytes;
  while (at + kChunkBytes <= bytes.size()) {
    if (bytes.compare(at, kNameBytes, "VP8 ") == 0) return true;
    std::size_t size = 0;
    for (std::size_t i = kChunkBytes; i > kNameBytes; --i)
      size = size << 8 | static_cast<unsigned char>(bytes[at + i - 1]);
    at += kChunkBytes + size + size % 2;  // chunks have an even size
  }
  return false;
}

void RequirePossibleSize(const std::string& bytes, ImageFileKind kind, const std::string& name) {
  if (kind == ImageFileKind::kExr) RequirePossibleExrHeaders(bytes, name);
  if (const std::optional<StatedSize> size = SizeOf(bytes, kind))
    RequireFits(*size, 0, bytes, name);
}

}  // namespace thicklens::io
