#include "thicklens/io/depth_io.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/io/image_file.h"
#include "tools/io/image_file_kind.h"
#include "tools/io/png_check.h"

namespace thicklens::io {
namespace {

constexpr int kMaxImageSizePx = 100000;
constexpr char kPfmHeader[] = "\"Pf\", width, height and a scale that is not 0";

bool StartsWith(const std::string& bytes, const std::string& start) {
  return bytes.compare(0, start.size(), start) == 0;
}

bool IsSpace(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

// Returns the next word of the header; `at` is then behind it.
std::string NextWord(const std::string& bytes, std::size_t* at) {
  constexpr std::size_t kLongest = 40;
  while (*at < bytes.size() && IsSpace(bytes[*at])) ++*at;
  const std::size_t begin = *at;
  while (*at < bytes.size() && !IsSpace(bytes[*at]) && *at - begin < kLongest) ++*at;
  return bytes.substr(begin, *at - begin);
}

template <typename Number>
std::optional<Number> NumberOf(const std::string& word) {
  Number value{};
  const auto [rest, status] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (status != std::errc() || rest != word.data() + word.size()) return std::nullopt;
  return value;
}

Error WrongPfmHeader(const std::string& name, const std::string& word) {
  return Error(fmt::format("{}: broken PFM header: {} are expected, found '{}'", name, kPfmHeader,
                           PrintableUtf8(word)));
}

float FloatFromBytes(const char* bytes, bool little_endian) {
  std::uint32_t bits = 0;
  for (int i = 0; i < 4; ++i) {
    const auto byte = static_cast<std::uint8_t>(bytes[little_endian ? 3 - i : i]);
    bits = bits << 8 | byte;
  }
  float value = 0;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

// The magnitude of the scale is the unit of the image's light; it has no meaning for depth.
model::RawDepthMap DecodePfm(const std::string& bytes, const std::string& name) {
  std::size_t at = 2;  // behind "Pf"
  model::RawDepthMap map;
  for (int* size_px : {&map.width_px, &map.height_px}) {
    const std::string word = NextWord(bytes, &at);
    const auto size = NumberOf<int>(word);
    if (!size || *size < 1 || *size > kMaxImageSizePx) throw WrongPfmHeader(name, word);
    *size_px = *size;
  }
  const std::string word = NextWord(bytes, &at);
  const auto scale = NumberOf<double>(word);
  if (!scale || !std::isfinite(*scale) || *scale == 0 || at == bytes.size())
    throw WrongPfmHeader(name, word);
  ++at;  // one white space, then the values

  const auto width = static_cast<std::size_t>(map.width_px);
  const auto height = static_cast<std::size_t>(map.height_px);
  const std::size_t expected = width * height * sizeof(float);
  if (bytes.size() - at != expected) {
    throw Error(fmt::format("{}: broken PFM: {} bytes of values for {}x{} px: {} are expected",
                            name, bytes.size() - at, map.width_px, map.height_px, expected));
  }
  map.values.resize(width * height);
  for (std::size_t row = 0; row < height; ++row) {
    ThrowIfCancelled();
    const char* stored = bytes.data() + at + (height - 1 - row) * width * sizeof(float);
    for (std::size_t x = 0; x < width; ++x)
      map.values[row * width + x] = FloatFromBytes(stored + x * sizeof(float), *scale < 0);
  }
  return map;
}

std::string TypeName(const cv::Mat& image) {
  static const char* const kNames[] = {"8-bit",         "signed 8-bit",  "16-bit",
                                       "signed 16-bit", "signed 32-bit", "32-bit float",
                                       "64-bit float",  "16-bit float"};
  return fmt::format("{} values in {} channel(s)", kNames[image.depth()], image.channels());
}

constexpr std::array<ImageFileKind, 4> kDepthKinds = {ImageFileKind::kPng, ImageFileKind::kTiff,
                                                      ImageFileKind::kExr, ImageFileKind::kPnm};

std::string ExpectedOf(ImageFileKind kind) {
  if (kind == ImageFileKind::kPng) return "a PNG depth map has 8- or 16-bit values";
  if (kind == ImageFileKind::kTiff) return "a TIFF depth map has integer or float values";
  if (kind == ImageFileKind::kPnm) return "a PGM depth map has 8- or 16-bit values";
  return "an EXR depth map has float values";
}

// Returns the place of the channel that is the depth: the only one, or the one named Z.
std::optional<int> DepthChannel(const std::vector<std::string>& names) {
  if (names.size() == 1) return 0;
  std::optional<int> found;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string last = names[i].substr(names[i].rfind('.') + 1);
    if (last != "Z" && last != "z") continue;
    if (found) return std::nullopt;  // of several layers
    found = static_cast<int>(i);
  }
  return found;
}

}  // namespace

model::RawDepthMap ReadDepthMap(const std::string& path) {
  const std::string bytes = ReadWholeFile(path);
  if (StartsWith(bytes, "PF") && bytes.size() > 2 && IsSpace(bytes[2]))
    throw Error(
        fmt::format("{}: a PFM file with three channels; a depth map has one channel", path));
  if (StartsWith(bytes, "Pf")) return DecodePfm(bytes, path);
  const std::optional<ImageFileKind> kind = KindOfImage(bytes);
  if (!kind || std::find(kDepthKinds.begin(), kDepthKinds.end(), *kind) == kDepthKinds.end()) {
    throw Error(
        fmt::format("{}: not a depth map: a PFM, PNG, PGM, TIFF or EXR file is expected", path));
  }
  ImageReading reading;
  reading.spread_bits = false;
  const DecodedImage decoded = DecodeImageFile(bytes, path, reading);
  const std::optional<int> channel = DepthChannel(decoded.facts.channels);
  // A PNG of fewer bits is more likely a drawing.
  const bool has_few_bits = *kind == ImageFileKind::kPng && PngBits(bytes) < 8;
  if (!channel || has_few_bits) {
    throw Error(fmt::format(
        "{}: {} in one channel, found {}{}", path, ExpectedOf(*kind), TypeName(decoded.pixels),
        *kind == ImageFileKind::kPng
            ? fmt::format(" ({} bits in the file)", PngBits(bytes))
            : fmt::format(" ({})", PrintableUtf8(fmt::format(
                                       "{}", fmt::join(decoded.facts.channels, ", "))))));
  }
  cv::Mat image;
  cv::extractChannel(decoded.pixels, image, *channel);
  const bool is_integer = decoded.facts.sample_type.find("float") == std::string::npos;
  model::RawDepthMap map{image.cols, image.rows, {}, is_integer};
  cv::Mat values;
  image.convertTo(values, CV_32F);  // exact for 16 bits
  map.values.reserve(values.total());
  for (int y = 0; y < values.rows; ++y) {
    ThrowIfCancelled();
    const auto* row = values.ptr<float>(y);
    map.values.insert(map.values.end(), row, row + values.cols);
  }
  return map;
}

std::string EncodePfm(const model::RawDepthMap& map) {
  std::string bytes = fmt::format("Pf\n{} {}\n-1.0\n", map.width_px, map.height_px);
  const auto width = static_cast<std::size_t>(map.width_px);
  bytes.reserve(bytes.size() + map.values.size() * sizeof(float));
  for (int y = map.height_px - 1; y >= 0; --y) {
    for (std::size_t x = 0; x < width; ++x) {
      std::uint32_t bits = 0;
      std::memcpy(&bits, &map.values[static_cast<std::size_t>(y) * width + x], sizeof bits);
      for (int i = 0; i < 4; ++i) bytes += static_cast<char>(bits >> (8 * i) & 0xFFU);
    }
  }
  return bytes;
}

}  // namespace thicklens::io
