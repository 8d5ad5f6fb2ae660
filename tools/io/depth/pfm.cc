// PFM files of one channel.
#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"
#include "tools/io/depth/depth_readers.h"

namespace thicklens::io {
namespace {

constexpr int kMaxImageSizePx = 100000;
constexpr char kPfmHeader[] = "\"Pf\", width, height and a scale that is not 0";

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

// Whether the values are multiplied by the magnitude of the scale; `file` gets a note if it is
// not 1.
bool AppliesScale(double magnitude, PfmScale scale, DepthFile* file) {
  if (magnitude == 1) return false;
  // Headers round 1/255 to few digits.
  constexpr double kMiddlebury = 1.0 / 255, kRounding = 0.01;
  const bool is_middlebury = std::abs(magnitude / kMiddlebury - 1) <= kRounding;
  const bool is_applied =
      scale == PfmScale::kApplied || (scale == PfmScale::kByRule && !is_middlebury);
  file->notes.push_back(fmt::format(
      "The header's scale {:g} is {}.", magnitude,
      is_applied ? "applied to the values"
      : scale == PfmScale::kByRule
          ? "about 1/255, as in the Middlebury benchmark, whose values are px without it, and is "
            "not applied"
          : "not applied"));
  return is_applied;
}

}  // namespace

DepthFile DecodePfmDepth(const std::string& bytes, const std::string& name, PfmScale scale_use) {
  std::size_t at = 2;  // behind "Pf"
  DepthFile file;
  model::RawDepthMap& map = file.map;
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
  const auto width = static_cast<std::size_t>(map.width_px);
  const auto height = static_cast<std::size_t>(map.height_px);
  const std::size_t expected = width * height * sizeof(float);
  // One white space, then the values. A line that ends with CR LF has two: the number of bytes
  // shows whether LF is the first byte of a value.
  const bool is_crlf = bytes[at] == '\r' && at + 1 < bytes.size() && bytes[at + 1] == '\n' &&
                       bytes.size() - at - 2 == expected;
  at += is_crlf ? 2 : 1;
  if (bytes.size() - at != expected) {
    throw Error(fmt::format("{}: broken PFM: {} bytes of values for {}x{} px: {} are expected",
                            name, bytes.size() - at, map.width_px, map.height_px, expected));
  }
  const double magnitude = std::abs(*scale);
  const double factor = AppliesScale(magnitude, scale_use, &file) ? magnitude : 1;
  map.values.resize(width * height);
  for (std::size_t row = 0; row < height; ++row) {
    ThrowIfCancelled();
    const char* stored = bytes.data() + at + (height - 1 - row) * width * sizeof(float);
    for (std::size_t x = 0; x < width; ++x) {
      const float value = FloatFromBytes(stored + x * sizeof(float), *scale < 0);
      // The product would change the bits of a NaN.
      map.values[row * width + x] = factor == 1 ? value : static_cast<float>(factor * value);
    }
  }
  file.description = fmt::format("PFM, {} x {} px, 32-bit floats, {} endian{}", map.width_px,
                                 map.height_px, *scale < 0 ? "little" : "big",
                                 is_crlf ? ", lines of the header end with CR LF" : "");
  return file;
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
