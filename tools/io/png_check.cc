#include "tools/io/png_check.h"

#include <fmt/format.h>
#include <zlib.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>

#include "thicklens/base/error.h"

namespace thicklens::io {
namespace {

constexpr char kSignature[] = "\x89PNG\r\n\x1A\n";
constexpr std::size_t kSignatureBytes = 8;
constexpr std::size_t kLengthBytes = 4, kTypeBytes = 4, kCrcBytes = 4;
constexpr std::size_t kFrame = kLengthBytes + kTypeBytes + kCrcBytes;
constexpr std::size_t kBitsAt = 24, kColourTypeAt = 25;  // in the first chunk, IHDR

bool IsPng(const std::string& bytes) {
  return bytes.compare(0, kSignatureBytes, kSignature, kSignatureBytes) == 0;
}

std::uint32_t BigEndian(const std::string& bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<std::uint8_t>(bytes[at + i]);
  return value;
}

// The CRC of ISO 3309, which PNG uses, by zlib: it takes several bytes at a time.
std::uint32_t Crc(const std::string& bytes, std::size_t begin, std::size_t end) {
  return static_cast<std::uint32_t>(
      crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()) + begin, end - begin));  // NOLINT
}

// Returns the size of the content of the chunk that begins there, or none if the file ends before
// the chunk does.
std::optional<std::size_t> ContentBytes(const std::string& bytes, std::size_t at) {
  const std::size_t left = bytes.size() - at;
  if (left < kFrame) return std::nullopt;
  const std::size_t length = BigEndian(bytes, at);
  return left - kFrame < length ? std::nullopt : std::optional(length);
}

std::string BigEndianBytes(std::uint32_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8)
    bytes += static_cast<char>(static_cast<std::uint8_t>(value >> shift & 0xFFU));
  return bytes;
}

}  // namespace

void RequireWholePng(const std::string& bytes, const std::string& name) {
  if (!IsPng(bytes)) return;
  for (std::size_t at = kSignatureBytes;;) {
    const std::optional<std::size_t> length = ContentBytes(bytes, at);
    if (!length) {
      throw Error(fmt::format("{}: broken PNG: it ends after {} bytes, in the middle of the image",
                              name, bytes.size()));
    }
    const std::size_t type_at = at + kLengthBytes;
    const std::size_t crc_at = type_at + kTypeBytes + *length;
    if (Crc(bytes, type_at, crc_at) != BigEndian(bytes, crc_at)) {
      throw Error(
          fmt::format("{}: broken PNG: the checksum of the chunk at byte {} is wrong", name, at));
    }
    if (bytes.compare(type_at, kTypeBytes, "IEND") == 0) return;
    at = crc_at + kCrcBytes;
  }
}

std::string WithoutPngTexts(const std::string& bytes) {
  if (!IsPng(bytes) || bytes.size() <= kColourTypeAt) return bytes;
  constexpr char kIndexed = 3;
  std::string kept(bytes, 0, kSignatureBytes);
  for (std::size_t at = kSignatureBytes; at < bytes.size();) {
    const std::optional<std::size_t> length = ContentBytes(bytes, at);
    if (!length) return bytes;
    const std::string type(bytes, at + kLengthBytes, kTypeBytes);
    constexpr unsigned kAncillary = 0x20;
    const bool is_critical = (static_cast<std::uint8_t>(type[0]) & kAncillary) == 0;
    const bool is_suggested = type == "PLTE" && bytes[kColourTypeAt] != kIndexed;
    if (type == "tRNS" || (is_critical && !is_suggested)) kept.append(bytes, at, kFrame + *length);
    if (type == "IEND") break;
    at += kFrame + *length;
  }
  return kept;
}

int PngBits(const std::string& bytes) {
  if (!IsPng(bytes) || bytes.size() <= kBitsAt) return 0;
  return static_cast<std::uint8_t>(bytes[kBitsAt]);
}

int PngColourType(const std::string& bytes) {
  if (!IsPng(bytes) || bytes.size() <= kColourTypeAt) return -1;
  return static_cast<std::uint8_t>(bytes[kColourTypeAt]);
}

std::string WithPngChunk(const std::string& png, const std::string& type,
                         const std::string& content) {
  const std::string checked = type + content;
  const std::string chunk = BigEndianBytes(static_cast<std::uint32_t>(content.size())) + checked +
                            BigEndianBytes(Crc(checked, 0, checked.size()));
  const std::size_t header_bytes =
      kLengthBytes + kTypeBytes + BigEndian(png, kSignatureBytes) + kCrcBytes;
  std::string with = png;
  return with.insert(kSignatureBytes + header_bytes, chunk);
}

std::string WithPngResolution(const std::string& png, int pixels_per_metre) {
  const std::string resolution = BigEndianBytes(static_cast<std::uint32_t>(pixels_per_metre));
  const std::string unit_metre(1, '\1');
  // It must precede the first IDAT chunk; directly behind IHDR is always allowed.
  return WithPngChunk(png, "pHYs", resolution + resolution + unit_metre);  // across, down
}

std::string WithPngProfile(const std::string& png, const std::string& icc_profile) {
  uLongf size = compressBound(icc_profile.size());
  std::string packed(size, '\0');
  compress(reinterpret_cast<Bytef*>(packed.data()), &size,      // NOLINT
           reinterpret_cast<const Bytef*>(icc_profile.data()),  // NOLINT
           icc_profile.size());
  using namespace std::string_literals;
  return WithPngChunk(png, "iCCP", "ICC\0\0"s + packed.substr(0, size));
}

}  // namespace thicklens::io
