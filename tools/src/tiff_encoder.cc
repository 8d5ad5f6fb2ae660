#include "tiff_encoder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include "thicklens/error.h"

namespace thicklens::tools {
namespace {

enum Tag : std::uint16_t {
  kImageWidth = 256,
  kImageLength = 257,
  kBitsPerSample = 258,
  kCompression = 259,
  kPhotometric = 262,
  kStripOffsets = 273,
  kSamplesPerPixel = 277,
  kRowsPerStrip = 278,
  kStripByteCounts = 279,
  kPlanarConfiguration = 284,
  kSampleFormat = 339,
};
enum Type : std::uint16_t { kShort = 3, kLong = 4 };

constexpr std::size_t kHeaderBytes = 8, kEntryBytes = 12;
constexpr std::size_t kStripBytes = 1 << 18;

// Numbers in the order of bytes of this machine, which the header tells.
template <typename Number>
void Append(Number number, std::string* to) {
  char bytes[sizeof number];
  std::memcpy(bytes, &number, sizeof number);
  to->append(bytes, sizeof number);
}

const char* ByteOrder() {
  const std::uint16_t one = 1;
  char first = 0;
  std::memcpy(&first, &one, 1);
  return first == 1 ? "II" : "MM";
}

// The directory of the file: entries in the order of their tags, and behind them what does not fit
// in an entry.
class Directory {
 public:
  Directory(std::size_t offset, std::size_t entries)
      : count_(entries), extra_offset_(offset + 2 + entries * kEntryBytes + 4) {}

  void Add(Tag tag, Type type, const std::vector<std::uint32_t>& values) {
    Append<std::uint16_t>(tag, &entries_);
    Append<std::uint16_t>(type, &entries_);
    Append(static_cast<std::uint32_t>(values.size()), &entries_);
    std::string bytes;
    for (const std::uint32_t value : values) {
      if (type == kShort) {
        Append(static_cast<std::uint16_t>(value), &bytes);
      } else {
        Append(value, &bytes);
      }
    }
    if (bytes.size() > 4) {
      Append(static_cast<std::uint32_t>(extra_offset_ + extra_.size()), &entries_);
      extra_ += bytes;
      if (extra_.size() % 2 != 0) extra_ += '\0';
    } else {
      bytes.resize(4, '\0');
      entries_ += bytes;
    }
  }

  std::string Bytes() const {
    std::string bytes;
    Append(static_cast<std::uint16_t>(count_), &bytes);
    bytes += entries_;
    Append<std::uint32_t>(0, &bytes);  // no other picture
    return bytes + extra_;
  }

 private:
  const std::size_t count_, extra_offset_;
  std::string entries_, extra_;
};

}  // namespace

std::string EncodeFloatTiff(const model::LinearPicture& picture) {
  const auto width = static_cast<std::size_t>(picture.width_px);
  const auto height = static_cast<std::size_t>(picture.height_px);
  const auto channels = static_cast<std::size_t>(picture.channels);
  const std::size_t row_bytes = width * channels * sizeof(float);
  const std::size_t strip_rows = std::clamp<std::size_t>(kStripBytes / row_bytes, 1, height);
  const std::size_t data_bytes = row_bytes * height;
  constexpr std::size_t kRoomForDirectory = 1 << 20;
  if (data_bytes > std::numeric_limits<std::uint32_t>::max() - kRoomForDirectory) {
    throw Error(fmt::format(
        "a view of {}x{} px takes {} bytes: a TIFF file holds at most 4 GiB; --format png is "
        "smaller",
        width, height, data_bytes));
  }
  std::vector<std::uint32_t> offsets, counts;
  for (std::size_t y = 0; y < height; y += strip_rows) {
    offsets.push_back(static_cast<std::uint32_t>(kHeaderBytes + y * row_bytes));
    counts.push_back(static_cast<std::uint32_t>(std::min(strip_rows, height - y) * row_bytes));
  }
  const std::size_t directory_offset = kHeaderBytes + data_bytes;
  Directory directory(directory_offset, 11);
  directory.Add(kImageWidth, kLong, {static_cast<std::uint32_t>(width)});
  directory.Add(kImageLength, kLong, {static_cast<std::uint32_t>(height)});
  directory.Add(kBitsPerSample, kShort, std::vector<std::uint32_t>(channels, 32));
  directory.Add(kCompression, kShort, {1});                        // none
  directory.Add(kPhotometric, kShort, {channels == 1 ? 1U : 2U});  // grey, 0 black; RGB
  directory.Add(kStripOffsets, kLong, offsets);
  directory.Add(kSamplesPerPixel, kShort, {static_cast<std::uint32_t>(channels)});
  directory.Add(kRowsPerStrip, kLong, {static_cast<std::uint32_t>(strip_rows)});
  directory.Add(kStripByteCounts, kLong, counts);
  directory.Add(kPlanarConfiguration, kShort, {1});  // channels interleaved
  directory.Add(kSampleFormat, kShort, std::vector<std::uint32_t>(channels, 3));  // IEEE floats

  const std::string end = directory.Bytes();
  std::string file;
  file.reserve(directory_offset + end.size());
  file += ByteOrder();
  Append<std::uint16_t>(42, &file);
  Append(static_cast<std::uint32_t>(directory_offset), &file);
  file.append(reinterpret_cast<const char*>(picture.values.data()), data_bytes);
  file += end;
  return file;
}

}  // namespace thicklens::tools
