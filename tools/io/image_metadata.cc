#include "tools/io/image_metadata.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>

#include "tools/io/transfer_code.h"

namespace thicklens::io {
namespace {

// Numbers in a file at a known place; zeros beyond the end.
class Bytes {
 public:
  Bytes(const std::string& bytes, bool is_little_endian = false)
      : bytes_(bytes), is_little_endian_(is_little_endian) {}

  std::uint32_t Number(std::size_t at, std::size_t count) const {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t from = is_little_endian_ ? at + count - 1 - i : at + i;
      value = value << 8 | (from < bytes_.size() ? static_cast<std::uint8_t>(bytes_[from]) : 0U);
    }
    return value;
  }
  std::uint32_t Two(std::size_t at) const { return Number(at, 2); }
  std::uint32_t Four(std::size_t at) const { return Number(at, 4); }
  std::string Part(std::size_t at, std::size_t count) const {
    return at >= bytes_.size() ? "" : bytes_.substr(at, count);
  }
  bool Has(std::size_t at, const std::string& text) const {
    return bytes_.compare(std::min(at, bytes_.size()), text.size(), text) == 0;
  }
  std::size_t size() const { return bytes_.size(); }

 private:
  const std::string& bytes_;
  bool is_little_endian_;
};

// One directory of EXIF: tag, and the place of its value.
struct Entry {
  std::uint32_t type = 0, count = 0;
  std::size_t at = 0;
};

std::map<std::uint32_t, Entry> Directory(const Bytes& exif, std::size_t at) {
  std::map<std::uint32_t, Entry> entries;
  constexpr std::size_t kEntryBytes = 12;
  const std::size_t count = exif.Two(at);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t entry_at = at + 2 + i * kEntryBytes;
    if (entry_at + kEntryBytes > exif.size()) break;
    const std::uint32_t type = exif.Two(entry_at + 2), values = exif.Four(entry_at + 4);
    constexpr std::uint32_t kShort = 3, kLong = 4;
    const bool is_inside = (type == kShort && values <= 2) || (type == kLong && values <= 1);
    entries[exif.Two(entry_at)] = {type, values,
                                   is_inside ? entry_at + 8 : exif.Four(entry_at + 8)};
  }
  return entries;
}

std::optional<double> Rational(const Bytes& exif, const std::map<std::uint32_t, Entry>& entries,
                               std::uint32_t tag) {
  const auto found = entries.find(tag);
  constexpr std::uint32_t kRational = 5;
  if (found == entries.end() || found->second.type != kRational) return std::nullopt;
  const double value = static_cast<double>(exif.Four(found->second.at)) /
                       static_cast<double>(exif.Four(found->second.at + 4));
  if (!(value > 0) || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<std::uint32_t> Integer(const Bytes& exif,
                                     const std::map<std::uint32_t, Entry>& entries,
                                     std::uint32_t tag) {
  const auto found = entries.find(tag);
  if (found == entries.end() || found->second.count < 1) return std::nullopt;
  if (found->second.type == 3) return exif.Two(found->second.at);
  if (found->second.type == 4) return exif.Four(found->second.at);
  return std::nullopt;
}

// EXIF is a small TIFF file.
void TakeExif(const std::string& blob, bool with_orientation, ImageFacts* facts) {
  const bool is_little = blob.compare(0, 2, "II") == 0;
  if (!is_little && blob.compare(0, 2, "MM") != 0) return;
  const Bytes exif(blob, is_little);
  constexpr std::uint32_t kOrientation = 0x112, kExifDirectory = 0x8769;
  constexpr std::uint32_t kResolutionX = 0xA20E, kResolutionY = 0xA20F, kResolutionUnit = 0xA210;
  const auto main = Directory(exif, exif.Four(4));
  if (const auto value = Integer(exif, main, kOrientation);
      with_orientation && value && *value >= 1 && *value <= 8) {
    facts->orientation = static_cast<int>(*value);
  }
  const auto directory_at = Integer(exif, main, kExifDirectory);
  if (!directory_at) return;
  const auto photo = Directory(exif, *directory_at);
  const auto x = Rational(exif, photo, kResolutionX), y = Rational(exif, photo, kResolutionY);
  // A larger mismatch is not explained by the rounding of the fractions: no square pixels.
  constexpr double kMaxMismatch = 0.01;
  if (!x || !y || std::abs(*y / *x - 1) > kMaxMismatch) return;
  const std::uint32_t unit = Integer(exif, photo, kResolutionUnit).value_or(2);
  const double unit_mm = unit == 3 ? 10 : unit == 4 ? 1 : unit == 5 ? 1e-3 : 25.4;
  facts->pixel_pitch_mm = unit_mm / *x;
}

constexpr char kExifMark[] = "Exif";  // followed by two zeros
constexpr std::size_t kExifMarkBytes = 6;

void TakeExifOfMark(const std::string& content, ImageFacts* facts) {
  const bool is_marked = content.compare(0, 4, kExifMark) == 0;
  TakeExif(is_marked ? content.substr(std::min(kExifMarkBytes, content.size())) : content, true,
           facts);
}

std::string Inflated(const std::string& compressed) {
  constexpr std::size_t kMaxBytes = 32 << 20;
  std::string text;
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK) return "";
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(compressed.data()));  // NOLINT
  stream.avail_in = static_cast<uInt>(compressed.size());
  int code = Z_OK;
  while (code == Z_OK && text.size() < kMaxBytes) {
    char part[1 << 14];
    stream.next_out = reinterpret_cast<Bytef*>(part);  // NOLINT
    stream.avail_out = sizeof part;
    code = inflate(&stream, Z_NO_FLUSH);
    text.append(part, sizeof part - stream.avail_out);
  }
  inflateEnd(&stream);
  return code == Z_STREAM_END ? text : "";
}

void TakePngTransfer(const Bytes& png, std::size_t at, const std::string& type, ImageFacts* facts) {
  if (type == "gAMA") {
    const double gamma = png.Four(at) / 100000.0;  // light = value^(1/gamma)
    if (!(gamma > 0)) return;
    constexpr double kTolerance = 1e-3;
    facts->gamma = 1 / gamma;
    facts->transfer =
        std::abs(gamma - 1) < kTolerance ? StatedTransfer::kLinear : StatedTransfer::kGamma;
  } else if (type == "cHRM") {
    std::array<double, 8> xy{};  // white first in the file
    for (std::size_t i = 0; i < 8; ++i) xy[(i + 6) % 8] = png.Four(at + 4 * i) / 100000.0;
    facts->chromaticities = xy;
  }
}

// EXIF as ImageMagick and Exiv2 wrote it before PNG had the chunk eXIf: a text of this name with a
// line of its name, its length and hexadecimal digits. Empty: the chunk is another text.
std::string ExifOfText(const std::string& type, const std::string& chunk) {
  const std::size_t name_end = chunk.find('\0');
  if (name_end == std::string::npos) return "";
  const std::string name = chunk.substr(0, name_end);
  if (name != "Raw profile type exif" && name != "Raw profile type APP1") return "";
  const bool is_packed = type == "zTXt";
  if (is_packed && name_end + 2 > chunk.size()) return "";
  const std::string text =
      is_packed ? Inflated(chunk.substr(name_end + 2)) : chunk.substr(name_end + 1);
  // "\nexif\n      38\n45786966.."
  std::size_t at = text.find('\n', 1);
  if (at != std::string::npos) at = text.find('\n', at + 1);
  std::string exif;
  int digits = 0;
  unsigned value = 0;
  for (; at < text.size(); ++at) {
    const auto c = static_cast<unsigned char>(text[at]);
    if (std::isxdigit(c) == 0) continue;
    value = value << 4U | (std::isdigit(c) != 0 ? c - '0' : (c | 0x20U) - 'a' + 10U);
    if (++digits % 2 == 0) exif += static_cast<char>(value & 0xFFU);
  }
  return exif;
}

void TakePng(const std::string& bytes, ImageFacts* facts) {
  const Bytes png(bytes);
  constexpr std::size_t kSignature = 8, kFrame = 12;
  bool has_srgb = false, has_cicp = false;
  const std::uint32_t colour_type = png.Number(25, 1);
  for (std::size_t at = kSignature; at + kFrame <= bytes.size();) {
    const std::size_t length = png.Four(at);
    const std::string type = png.Part(at + 4, 4);
    const std::size_t content = at + 8;
    if (type == "IDAT" || type == "IEND" || length > bytes.size() - at - kFrame) {
      if (type != "IDAT") break;
    } else if (type == "iCCP") {
      const std::string chunk = png.Part(content, length);
      const std::size_t name_end = chunk.find('\0');
      if (name_end != std::string::npos && name_end + 2 < chunk.size())
        facts->icc_profile = Inflated(chunk.substr(name_end + 2));
    } else if (type == "sRGB") {
      has_srgb = true;
    } else if (type == "cICP" && length >= 4) {
      has_cicp = true;
      facts->transfer = TransferOfCode(png.Number(content + 1, 1));
    } else if (type == "sBIT" && length >= 1) {
      std::uint32_t bits = 0;
      const std::size_t colours = colour_type == 2 || colour_type == 3 || colour_type == 6 ? 3 : 1;
      for (std::size_t i = 0; i < std::min(colours, length); ++i)
        bits = std::max(bits, png.Number(content + i, 1));
      if (bits >= 1 && static_cast<int>(bits) <= facts->container_bits)
        facts->significant_bits = static_cast<int>(bits);
    } else if (type == "eXIf") {
      TakeExifOfMark(png.Part(content, length), facts);
    } else if (type == "zTXt" || type == "tEXt") {
      const std::string exif = ExifOfText(type, png.Part(content, length));
      if (!exif.empty()) TakeExifOfMark(exif, facts);
    } else if (!has_cicp) {
      TakePngTransfer(png, content, type, facts);
    }
    at += kFrame + length;
  }
  // cICP precedes iCCP, iCCP precedes sRGB, sRGB precedes gAMA.
  if (has_cicp) facts->icc_profile.clear();
  if (has_srgb && !has_cicp && facts->icc_profile.empty()) facts->transfer = StatedTransfer::kSrgb;
}

void TakeJpeg(const std::string& bytes, ImageFacts* facts) {
  const Bytes jpeg(bytes);
  std::map<std::uint32_t, std::string> profile;  // parts of the profile by number
  std::uint32_t profile_parts = 0;
  for (std::size_t at = 2; at + 4 <= bytes.size();) {
    if (jpeg.Number(at, 1) != 0xFF) {
      ++at;
      continue;
    }
    const std::uint32_t marker = jpeg.Number(at + 1, 1);
    constexpr std::uint32_t kScan = 0xDA, kApp1 = 0xE1, kApp2 = 0xE2, kEnd = 0xD9;
    if (marker == kScan || marker == kEnd) break;
    if (marker == 0xFF) {
      ++at;
      continue;
    }
    if (marker <= 1 || (marker >= 0xD0 && marker <= 0xD8)) {
      at += 2;
      continue;
    }
    const std::size_t length = jpeg.Two(at + 2);
    if (length < 2) break;
    const std::string content = jpeg.Part(at + 4, length - 2);
    using namespace std::string_literals;
    const std::string icc_mark = "ICC_PROFILE\0"s;
    if (marker == kApp1 && content.compare(0, kExifMarkBytes, "Exif\0\0"s) == 0) {
      TakeExifOfMark(content, facts);
    } else if (marker == kApp2 && content.compare(0, icc_mark.size(), icc_mark) == 0 &&
               content.size() > icc_mark.size() + 2) {
      profile[static_cast<std::uint8_t>(content[icc_mark.size()])] =
          content.substr(icc_mark.size() + 2);
      profile_parts = static_cast<std::uint8_t>(content[icc_mark.size() + 1]);
    }
    at += 2 + length;
  }
  if (!profile.empty() && profile.size() == profile_parts) {
    for (const auto& [number, part] : profile) facts->icc_profile += part;
  }
}

void TakeWebp(const std::string& bytes, ImageFacts* facts) {
  const Bytes webp(bytes, true);
  for (std::size_t at = 12; at + 8 <= bytes.size();) {
    const std::size_t length = webp.Four(at + 4);
    if (webp.Has(at, "ICCP")) facts->icc_profile = webp.Part(at + 8, length);
    if (webp.Has(at, "EXIF")) TakeExifOfMark(webp.Part(at + 8, length), facts);
    at += 8 + length + length % 2;
  }
}

std::string FromUtf16(const std::string& text) {
  std::string ascii;
  for (std::size_t i = 0; i + 1 < text.size(); i += 2) {
    if (text[i] == '\0' && text[i + 1] == '\0') break;
    const bool is_ascii = text[i] == '\0' && static_cast<std::uint8_t>(text[i + 1]) < 128;
    ascii += is_ascii ? text[i + 1] : '?';
  }
  return ascii;
}

}  // namespace

// ICC.1:2010: the tag 'desc' is a 'desc' (version 2) or a list of texts in UTF-16, 'mluc'.
std::string IccDescription(const std::string& profile) {
  const Bytes icc(profile);
  constexpr std::size_t kTagsAt = 128;
  constexpr std::uint32_t kMaxTags = 1000, kMaxText = 1000;
  const std::uint32_t tags = std::min(icc.Four(kTagsAt), kMaxTags);
  for (std::size_t i = 0; i < tags; ++i) {
    const std::size_t tag = kTagsAt + 4 + 12 * i;
    if (!icc.Has(tag, "desc")) continue;
    const std::size_t at = icc.Four(tag + 4);
    if (icc.Has(at, "mluc")) {
      return FromUtf16(icc.Part(at + icc.Four(at + 24), std::min(icc.Four(at + 20), kMaxText)));
    }
    std::string text = icc.Part(at + 12, std::min(icc.Four(at + 8), kMaxText));
    return text.substr(0, text.find('\0'));
  }
  return "";
}

void TakeMetadata(const std::string& bytes, ImageFileKind kind, ImageFacts* facts) {
  switch (kind) {
    case ImageFileKind::kPng:
      TakePng(bytes, facts);
      break;
    case ImageFileKind::kJpeg:
      TakeJpeg(bytes, facts);
      break;
    case ImageFileKind::kWebp:
      TakeWebp(bytes, facts);
      break;
    case ImageFileKind::kTiff:
    case ImageFileKind::kRaw:
      TakeExif(bytes, false, facts);
      break;
    default:
      break;
  }
  if (!facts->icc_profile.empty()) facts->icc_description = IccDescription(facts->icc_profile);
}

std::string ColourProfileOf(const std::string& bytes) {
  ImageFacts facts;
  if (const auto kind = KindOfImage(bytes)) TakeMetadata(bytes, *kind, &facts);
  return facts.icc_profile;
}

}  // namespace thicklens::io
