// XMP, its extension (Adobe's XMP specification, part 3, 1.1.3.1) and the index of further images
// (CIPA DC-007, 5.2) in the segments of a JPEG file.
#include "tools/io/depth/jpeg_parts.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>

namespace thicklens::io {
namespace {

using namespace std::string_literals;

const std::string kXmpMark = "http://ns.adobe.com/xap/1.0/\0"s;
const std::string kExtensionMark = "http://ns.adobe.com/xmp/extension/\0"s;
const std::string kMpfMark = "MPF\0"s;

// Zeros beyond the end.
std::uint32_t NumberAt(const std::string& bytes, std::size_t at, std::size_t count,
                       bool is_little = false) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t from = is_little ? at + count - 1 - i : at + i;
    value = value << 8 | (from < bytes.size() ? static_cast<std::uint8_t>(bytes[from]) : 0U);
  }
  return value;
}

// Extended packets by their GUID.
struct Extension {
  std::size_t size = 0;
  std::map<std::size_t, std::string> parts;  // by offset
  std::string fault;
};

class JpegScanner {
 public:
  JpegScanner(const std::string& bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  JpegParts Scan() {
    parts_.end = bytes_.size();
    for (std::size_t at = 2; at + 2 <= bytes_.size();) {
      if (bytes_[at] != '\xFF') {  // the compressed data, or what a decoder skips
        ++at;
        continue;
      }
      const std::uint32_t marker = NumberAt(bytes_, at + 1, 1);
      if (marker == 0xFF) {
        ++at;
        continue;
      }
      constexpr std::uint32_t kEnd = 0xD9;
      if (marker == kEnd) {
        parts_.end = at + 2;
        break;
      }
      // 0 is a byte 0xFF of the compressed data; the others have no length.
      if (marker <= 1 || (marker >= 0xD0 && marker <= 0xD8)) {
        at += 2;
        continue;
      }
      const std::size_t length = NumberAt(bytes_, at + 2, 2);
      if (length < 2 || length > bytes_.size() - at - 2) break;
      Take(marker, at + 4, length - 2);
      at += 2 + length;
    }
    JoinExtension();
    return parts_;
  }

 private:
  bool Has(std::size_t at, std::size_t size, const std::string& mark) const {
    return size >= mark.size() && bytes_.compare(at, mark.size(), mark) == 0;
  }

  void Take(std::uint32_t marker, std::size_t at, std::size_t size) {
    constexpr std::uint32_t kApp1 = 0xE1, kApp2 = 0xE2;
    const bool is_frame =
        marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
    if (is_frame && size >= 5 && parts_.width_px == 0) {
      parts_.height_px = static_cast<int>(NumberAt(bytes_, at + 1, 2));
      parts_.width_px = static_cast<int>(NumberAt(bytes_, at + 3, 2));
    }
    if (marker == kApp1 && Has(at, size, kXmpMark) && parts_.xmp.empty()) {
      parts_.xmp = bytes_.substr(at + kXmpMark.size(), size - kXmpMark.size());
    } else if (marker == kApp1 && Has(at, size, kExtensionMark)) {
      TakeExtension(at + kExtensionMark.size(), size - kExtensionMark.size());
    } else if (marker == kApp2 && Has(at, size, kMpfMark) && parts_.images.empty()) {
      TakeIndex(at + kMpfMark.size(), size - kMpfMark.size());
    }
  }

  // A GUID of 32 digits, the length of the whole packet, the offset of this part, the part.
  void TakeExtension(std::size_t at, std::size_t size) {
    constexpr std::size_t kGuid = 32, kHeader = kGuid + 8;
    if (size < kHeader) return;  // it is missing in its packet
    const std::size_t whole = NumberAt(bytes_, at + kGuid, 4);
    const std::size_t offset = NumberAt(bytes_, at + kGuid + 4, 4);
    const std::size_t part = size - kHeader;
    Extension& extension = extensions_[bytes_.substr(at, kGuid)];
    if (extension.parts.empty()) extension.size = whole;
    if (whole != extension.size || whole > bytes_.size() || offset > whole ||
        part > whole - offset) {
      extension.fault = fmt::format(
          "{}: extended XMP: {} bytes at {} of a packet of {} bytes in a file of {}: a part inside "
          "the packet, and a packet inside the file, are expected",
          name_, part, offset, whole, bytes_.size());
    }
    extension.parts.emplace(offset, bytes_.substr(at + kHeader, part));
  }

  // The packet names the GUID of the extension that belongs to it.
  void JoinExtension() {
    if (extensions_.empty()) return;
    auto chosen = extensions_.end();
    for (auto one = extensions_.begin(); one != extensions_.end(); ++one) {
      if (parts_.xmp.find(one->first) != std::string::npos) chosen = one;
    }
    if (chosen == extensions_.end()) return;  // an editor left it behind
    std::string& joined = parts_.extended_xmp;
    std::string& fault = parts_.extended_fault;
    fault = chosen->second.fault;
    for (const auto& [offset, part] : chosen->second.parts) {
      if (offset != joined.size() && fault.empty()) {
        fault = fmt::format("{}: extended XMP: a part at {} where {} is expected", name_, offset,
                            joined.size());
      }
      joined += part;
    }
    if (joined.size() != chosen->second.size && fault.empty()) {
      fault = fmt::format("{}: extended XMP: {} of its {} bytes are in the file", name_,
                          joined.size(), chosen->second.size);
    }
  }

  // A directory as in TIFF; offsets count from its header, and the first image has 0.
  void TakeIndex(std::size_t at, std::size_t size) {
    const bool is_little = bytes_.compare(at, 2, "II") == 0;
    if (size < 8 || (!is_little && bytes_.compare(at, 2, "MM") != 0)) return;
    const auto number = [&](std::size_t from, std::size_t count) {
      return NumberAt(bytes_, at + from, count, is_little);
    };
    const std::size_t directory = number(4, 4);
    constexpr std::size_t kEntry = 12, kImage = 16;
    if (directory > size || 2 > size - directory) return;
    const std::size_t entries = number(directory, 2);
    for (std::size_t i = 0; i < entries; ++i) {
      const std::size_t entry = directory + 2 + i * kEntry;
      if (entry + kEntry > size) return;
      constexpr std::uint32_t kImages = 0xB002;
      if (number(entry, 2) != kImages) continue;
      const std::size_t table = number(entry + 4, 4), begin = number(entry + 8, 4);
      if (begin > size || table > size - begin) return;
      for (std::size_t image = kImage; image + kImage <= table; image += kImage) {
        constexpr std::uint32_t kTypeBits = 0xFFFFFF;
        const MpfImage found{number(begin + image, 4) & kTypeBits,
                             at + number(begin + image + 8, 4), number(begin + image + 4, 4)};
        parts_.images.push_back(found);
      }
      return;  // a directory has one such entry
    }
  }

  const std::string& bytes_;
  const std::string& name_;
  JpegParts parts_;
  std::map<std::string, Extension> extensions_;
};

}  // namespace

JpegParts PartsOfJpeg(const std::string& bytes, const std::string& name) {
  return JpegScanner(bytes, name).Scan();
}

}  // namespace thicklens::io
