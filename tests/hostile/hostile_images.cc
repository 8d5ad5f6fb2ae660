#include "hostile/hostile_images.h"

#include <zlib.h>

#include <array>
#include <utility>
#include <vector>

namespace thicklens::hostile {
namespace {

std::string BigEndian(std::uint32_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift & 0xFFU);
  return bytes;
}

std::string LittleEndian(std::uint32_t value, int count = 4) {
  std::string bytes;
  for (int i = 0; i < count; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xFFU);
  return bytes;
}

std::string ExrAttribute(const std::string& name, const std::string& type,
                         const std::string& value) {
  return name + '\0' + type + '\0' + LittleEndian(static_cast<std::uint32_t>(value.size())) + value;
}

// Compresses the bytes without the header and the checksum of the stream and leaves the last block
// open, so that several results in a row form one stream.
std::string DeflatedBlocks(const std::string& bytes) {
  z_stream stream{};
  constexpr int kRaw = -15, kMemoryLevel = 8;
  deflateInit2(&stream, Z_BEST_COMPRESSION, Z_DEFLATED, kRaw, kMemoryLevel, Z_DEFAULT_STRATEGY);
  std::string deflated(deflateBound(&stream, static_cast<uLong>(bytes.size())) + 100, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));  // NOLINT: only read
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(deflated.data());
  stream.avail_out = static_cast<uInt>(deflated.size());
  deflate(&stream, Z_FULL_FLUSH);
  deflated.resize(deflated.size() - stream.avail_out);
  deflateEnd(&stream);
  return deflated;
}

std::string Stream(const std::string& blocks, std::uint32_t checksum) {
  const std::string last("\x01\0\0\xFF\xFF", 5);  // an empty block
  return "\x78\xDA" + blocks + last + BigEndian(checksum);
}

}  // namespace

std::string Deflated(const std::string& bytes) {
  const auto checksum =
      adler32(1, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uInt>(bytes.size()));
  return Stream(DeflatedBlocks(bytes), static_cast<std::uint32_t>(checksum));
}

std::string DeflatedZeros(std::size_t count) {
  constexpr std::size_t kPart = 1 << 20;
  const std::string part = DeflatedBlocks(std::string(kPart, '\0'));
  std::string blocks;
  for (std::size_t i = 0; i < count / kPart; ++i) blocks += part;
  blocks += DeflatedBlocks(std::string(count % kPart, '\0'));
  // Adler-32 of zeros: one of its sums stays 1, the other one counts the zeros.
  constexpr std::size_t kModulus = 65521;
  return Stream(blocks, static_cast<std::uint32_t>(count % kModulus) << 16 | 1U);
}

std::string PngChunk(const std::string& type, const std::string& content) {
  const std::string checked = type + content;
  const auto crc =
      crc32(0, reinterpret_cast<const Bytef*>(checked.data()), static_cast<uInt>(checked.size()));
  return BigEndian(static_cast<std::uint32_t>(content.size())) + checked +
         BigEndian(static_cast<std::uint32_t>(crc));
}

std::string PngOf(std::uint32_t width, std::uint32_t height, int bits, int colour_type,
                  const std::string& deflated_rows, const std::string& extra) {
  const std::string header = BigEndian(width) + BigEndian(height) + static_cast<char>(bits) +
                             static_cast<char>(colour_type) + std::string(3, '\0');
  return "\x89PNG\r\n\x1A\n" + PngChunk("IHDR", header) + extra + PngChunk("IDAT", deflated_rows) +
         PngChunk("IEND", "");
}

std::string TiffOf(const TiffParts& parts) {
  constexpr std::uint32_t kShort = 3, kLong = 4, kHeaderBytes = 8;
  const std::uint32_t directory_at =
      kHeaderBytes + static_cast<std::uint32_t>(parts.strip.size() + parts.strip.size() % 2);
  const std::vector<std::array<std::uint32_t, 3>> entries = {
      {256, kLong, parts.width},
      {257, kLong, parts.height},
      {258, kShort, static_cast<std::uint32_t>(parts.bits)},
      {259, kShort, static_cast<std::uint32_t>(parts.compression)},
      {262, kShort, 1},
      {273, kLong, parts.strip_at},
      {277, kShort, 1},
      {278, kLong, parts.height},
      {279, kLong, static_cast<std::uint32_t>(parts.strip.size())},
      {339, kShort, parts.bits == 32 ? 3U : 1U}};
  std::string tiff = std::string("II*\0", 4) + LittleEndian(directory_at) + parts.strip;
  tiff.resize(directory_at);
  tiff += LittleEndian(static_cast<std::uint32_t>(entries.size()), 2);
  for (const auto& [tag, type, value] : entries)
    tiff += LittleEndian(tag, 2) + LittleEndian(type, 2) + LittleEndian(1) + LittleEndian(value);
  return tiff + LittleEndian(parts.next_is_itself ? directory_at : 0);
}

std::string ExrOf(std::int32_t last_index) {
  const std::string last = LittleEndian(static_cast<std::uint32_t>(last_index));
  const std::string window = std::string(8, '\0') + last + last;
  const std::string one("\0\0\x80\x3F", 4);  // 1 as a float
  const std::string channel = std::string("Y\0", 2) + LittleEndian(2) + LittleEndian(0) +
                              LittleEndian(1) + LittleEndian(1) + '\0';
  return std::string("\x76\x2F\x31\x01\x02\0\0\0", 8) +
         ExrAttribute("channels", "chlist", channel) +
         ExrAttribute("compression", "compression", "\x03") +
         ExrAttribute("dataWindow", "box2i", window) +
         ExrAttribute("displayWindow", "box2i", window) +
         ExrAttribute("lineOrder", "lineOrder", std::string(1, '\0')) +
         ExrAttribute("pixelAspectRatio", "float", one) +
         ExrAttribute("screenWindowCenter", "v2f", std::string(8, '\0')) +
         ExrAttribute("screenWindowWidth", "float", one) + std::string(65, '\0');
}

std::string BmpOf(std::int32_t side) {
  const std::string size = LittleEndian(static_cast<std::uint32_t>(side));
  return "BM" + LittleEndian(154) + LittleEndian(0) + LittleEndian(54) + LittleEndian(40) + size +
         size + LittleEndian(1, 2) + LittleEndian(8, 2) + std::string(124, '\0');
}

}  // namespace thicklens::hostile
