#include "tools/io/video/video_kind.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"
#include "tools/io/image_file_kind.h"

namespace thicklens::io {
namespace {

bool HasTextAt(const std::string& bytes, std::size_t at, const std::string& text) {
  return bytes.size() >= at && bytes.compare(at, text.size(), text) == 0;
}

// The ending without its point.
std::string LowerEnding(const std::string& path) {
  std::string ending = std::filesystem::path(path).extension().string();
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return ending.empty() ? ending : ending.substr(1);
}

template <std::size_t kCount>
bool IsOneOf(const std::string& text, const std::array<const char*, kCount>& known) {
  return std::any_of(known.begin(), known.end(), [&](const char* one) { return text == one; });
}

// Each packet of 188 bytes begins with "G".
bool IsTransportStream(const std::string& start) {
  constexpr std::size_t kPacket = 188, kPackets = 4;
  for (std::size_t i = 0; i < kPackets; ++i) {
    if (!HasTextAt(start, i * kPacket, "G")) return false;
  }
  return true;
}

bool IsIsoVideo(const std::string& start) {
  static const std::array<const char*, 6> kBoxes = {"ftyp", "moov", "mdat", "wide", "free", "skip"};
  return start.size() >= 8 && IsOneOf(start.substr(4, 4), kBoxes);
}

// A file that is looked at in a few places: it may be larger than the memory.
class Peek {
 public:
  explicit Peek(const std::string& path) : file_(path, std::ios::binary) {
    file_.seekg(0, std::ios::end);
    const auto end = file_.tellg();
    size_ = end < 0 ? 0 : static_cast<std::uint64_t>(end);
  }
  std::uint64_t size() const { return size_; }

  // Up to `count` bytes from `at`.
  std::string Bytes(std::uint64_t at, std::size_t count) {
    std::string bytes(count, '\0');
    if (at >= size_) return "";
    file_.clear();
    file_.seekg(static_cast<std::streamoff>(at));
    file_.read(bytes.data(), static_cast<std::streamsize>(count));
    bytes.resize(static_cast<std::size_t>(std::max<std::streamsize>(file_.gcount(), 0)));
    return bytes;
  }

 private:
  std::ifstream file_;
  std::uint64_t size_ = 0;
};

std::uint64_t Big(const std::string& bytes, std::size_t at, std::size_t count) {
  std::uint64_t value = 0;
  for (std::size_t i = at; i < at + count; ++i)
    value = value << 8 | (i < bytes.size() ? static_cast<std::uint8_t>(bytes[i]) : 0U);
  return value;
}

[[noreturn]] void RefuseTruncated(const std::string& path, std::uint64_t size,
                                  const std::string& part, std::uint64_t needed) {
  throw Error(
      fmt::format("{}: the video is truncated: the file has {} bytes, and its part '{}' ends at "
                  "byte {}; copy it again",
                  path, size, PrintableUtf8(part), needed));
}

// ISO/IEC 14496-12: boxes one after the other, each with its size.
void RequireWholeBoxes(const std::string& path) {
  Peek file(path);
  constexpr std::uint64_t kHeader = 8, kLongHeader = 16;
  bool has_index = false;
  std::uint64_t at = 0;
  while (at + kHeader <= file.size()) {
    ThrowIfCancelled();
    const std::string header = file.Bytes(at, kLongHeader);
    const std::string name = header.substr(4, 4);
    std::uint64_t size = Big(header, 0, 4);
    if (size == 1) size = Big(header, 8, 8);
    if (size == 0) size = file.size() - at;  // up to the end
    has_index = has_index || name == "moov";
    // The walk ends at bytes that are no box: some cameras append a text.
    const bool is_box = size >= kHeader && std::all_of(name.begin(), name.end(), [](char c) {
                          return std::isprint(static_cast<unsigned char>(c)) != 0;
                        });
    if (!is_box) break;
    if (size > file.size() - at)
      RefuseTruncated(path, file.size(), name, at + std::min(size, ~std::uint64_t{0} - at));
    at += size;
  }
  if (!has_index) {
    throw Error(fmt::format(
        "{}: the video has no index (no 'moov' in the file): its recording or its copy was not "
        "finished; copy or record it again",
        path));
  }
}

// RIFF: chunks one after the other; large files have several.
void RequireWholeRiff(const std::string& path) {
  Peek file(path);
  const std::string header = file.Bytes(0, 12);
  std::uint64_t size = 0;
  for (std::size_t i = 8; i-- > 4;) size = size << 8 | static_cast<std::uint8_t>(header[i]);
  if (size + 8 > file.size()) RefuseTruncated(path, file.size(), "RIFF", size + 8);
}

constexpr std::size_t kTsPacket = 188;

// The end of an elementary stream in MPEG-TS (ISO/IEC 13818-1).
struct StreamEnd {
  std::uint64_t stated = 0, found = 0;  // bytes of its last PES packet; 0: none is stated
  bool is_filled_up = false;            // its last packet of 188 bytes has stuffing
};

// Whether an adaptation field, given from its length on, has stuffing: it fills up the last packet
// of a frame.
bool HasStuffing(const std::string& field) {
  const std::size_t length = static_cast<std::uint8_t>(field[0]);
  if (length == 0 || field.size() < 2) return true;
  const unsigned flags = static_cast<std::uint8_t>(field[1]);
  std::size_t used = 1;
  if ((flags & 0x10U) != 0) used += 6;          // PCR
  if ((flags & 0x08U) != 0) used += 6;          // OPCR
  if ((flags & 0x04U) != 0) used += 1;          // splice countdown
  for (const unsigned flag : {0x02U, 0x01U}) {  // private data, extension: with their lengths
    if ((flags & flag) != 0 && used + 1 < field.size())
      used += 1U + static_cast<std::uint8_t>(field[used + 1]);
  }
  return used == 1 || length > used;
}

// The ends of the streams of images, by their packet identifiers.
std::map<unsigned, StreamEnd> EndsOfTransportStream(Peek* file) {
  constexpr std::uint64_t kEnd = std::uint64_t{16} << 20;  // a frame is smaller
  const std::uint64_t length = std::min(file->size(), kEnd) / kTsPacket * kTsPacket;
  const std::uint64_t begin = (file->size() - length) / kTsPacket * kTsPacket;
  const std::string bytes = file->Bytes(begin, static_cast<std::size_t>(length));
  std::map<unsigned, StreamEnd> ends;
  for (std::size_t at = 0; at + kTsPacket <= bytes.size(); at += kTsPacket) {
    const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(bytes[at + i]); };
    if (byte(0) != 'G') continue;
    const unsigned id = (byte(1) & 0x1FU) << 8 | byte(2);
    const bool has_fill = (byte(3) & 0x20U) != 0, has_payload = (byte(3) & 0x10U) != 0;
    const std::size_t payload = has_fill ? 5U + byte(4) : 4U;
    if (!has_payload || payload >= kTsPacket) continue;
    const bool begins = (byte(1) & 0x40U) != 0;
    constexpr std::size_t kPesHeader = 6;
    const bool is_video = begins && payload + kPesHeader <= kTsPacket &&
                          Big(bytes, at + payload, 3) == 1 && (byte(payload + 3) & 0xF0U) == 0xE0;
    if (is_video) {
      ends[id] = {};
      const std::uint64_t stated = Big(bytes, at + payload + 4, 2);
      if (stated > 0) ends[id].stated = stated + kPesHeader;
    }
    const auto end = ends.find(id);
    if (end == ends.end()) continue;
    end->second.found += kTsPacket - payload;
    end->second.is_filled_up = has_fill && HasStuffing(bytes.substr(at + 4, payload - 4));
  }
  return ends;
}

void RequireWholeTransportStream(const std::string& path) {
  Peek file(path);
  // Bytes that begin no packet are no part of the video.
  const auto rest = file.size() % kTsPacket;
  if (rest != 0 && file.Bytes(file.size() - rest, 1) == "G") {
    throw Error(fmt::format(
        "{}: the video is truncated: the file has {} bytes, and MPEG-TS has packets of {} bytes; "
        "copy it again",
        path, file.size(), kTsPacket));
  }
  for (const auto& [id, end] : EndsOfTransportStream(&file)) {
    if (end.found >= end.stated) continue;
    throw Error(
        fmt::format("{}: the video is truncated: its last frame has {} bytes, and {} of them are "
                    "there; copy it "
                    "again",
                    path, end.stated, end.found));
  }
}

// A number of EBML: the leading zeros of its first byte say how many bytes follow. `is_size` keeps
// the marker out of the value. Nothing for "unknown".
std::optional<std::uint64_t> EbmlNumber(const std::string& bytes, std::size_t* at, bool is_size) {
  if (*at >= bytes.size()) return std::nullopt;
  const auto first = static_cast<std::uint8_t>(bytes[*at]);
  std::size_t length = 1;
  while (length <= 8 && (first >> (8 - length) & 1) == 0) ++length;
  if (length > 8 || *at + length > bytes.size()) return std::nullopt;
  std::uint64_t value = Big(bytes, *at, length);
  *at += length;
  if (!is_size) return value;
  const std::uint64_t mask = (std::uint64_t{1} << (7 * length)) - 1;
  value &= mask;
  if (value == mask) return std::nullopt;
  return value;
}

// Matroska: a header, then a segment with all other data, whose size a live recording leaves open.
void RequireWholeSegment(const std::string& path) {
  Peek file(path);
  const std::string start = file.Bytes(0, kVideoStart);
  constexpr std::uint64_t kSegment = 0x18538067;
  std::size_t at = 0;
  while (at < start.size()) {
    const auto id = EbmlNumber(start, &at, false);
    const auto size = id ? EbmlNumber(start, &at, true) : std::nullopt;
    if (!size) return;
    if (*size > file.size() - std::min<std::uint64_t>(at, file.size()))
      RefuseTruncated(path, file.size(), *id == kSegment ? "Segment" : "EBML", at + *size);
    if (*id == kSegment) return;
    at += static_cast<std::size_t>(*size);
  }
}

}  // namespace

std::optional<VideoKind> KindOfVideo(const std::string& start, const std::string& path) {
  const std::string ending = LowerEnding(path);
  static const std::array<const char*, 2> kMjpeg = {"mjpeg", "mjpg"};
  static const std::array<const char*, 3> kH264 = {"h264", "avc", "264"};
  static const std::array<const char*, 3> kHevc = {"hevc", "h265", "265"};
  if (HasTextAt(start, 0, "\xFF\xD8\xFF") && IsOneOf(ending, kMjpeg)) return VideoKind::kRawMjpeg;
  if (KindOfImage(start)) return std::nullopt;  // HEIF has the boxes of MP4
  if (IsIsoVideo(start)) return VideoKind::kIsoMedia;
  if (HasTextAt(start, 0, "\x1A\x45\xDF\xA3")) return VideoKind::kMatroska;
  if (HasTextAt(start, 0, "RIFF") && HasTextAt(start, 8, "AVI ")) return VideoKind::kAvi;
  if (IsTransportStream(start)) return VideoKind::kTransportStream;
  using namespace std::string_literals;
  if (HasTextAt(start, 0, "\0\0\1"s) || HasTextAt(start, 0, "\0\0\0\1"s)) {
    if (IsOneOf(ending, kH264)) return VideoKind::kRawH264;
    if (IsOneOf(ending, kHevc)) return VideoKind::kRawHevc;
  }
  return std::nullopt;
}

void RequireWholeVideo(const std::string& path, VideoKind kind) {
  if (kind == VideoKind::kIsoMedia) RequireWholeBoxes(path);
  if (kind == VideoKind::kAvi) RequireWholeRiff(path);
  if (kind == VideoKind::kMatroska) RequireWholeSegment(path);
  if (kind == VideoKind::kTransportStream) RequireWholeTransportStream(path);
}

bool MayBeCut(const std::string& path, VideoKind kind) {
  if (kind != VideoKind::kTransportStream) return false;
  Peek file(path);
  const auto ends = EndsOfTransportStream(&file);
  return std::any_of(ends.begin(), ends.end(), [](const auto& end) {
    return end.second.stated == 0 && !end.second.is_filled_up;
  });
}

}  // namespace thicklens::io
