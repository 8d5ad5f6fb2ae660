#include "tools/io/pnm_pixels.h"

#include <fmt/format.h>

#include <algorithm>
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
#include "thicklens/base/printable_text.h"

namespace thicklens::io {
namespace {

constexpr int kMaxSidePx = 1 << 20;
constexpr int kMaxValue = 65535;

bool IsSpace(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

// The words of a header, without comments.
class Header {
 public:
  Header(const std::string& bytes, std::size_t at) : bytes_(bytes), at_(at) {}

  std::string Word() {
    SkipToWord();
    const std::size_t begin = at_;
    constexpr std::size_t kLongest = 40;
    while (at_ < bytes_.size() && !IsSpace(bytes_[at_]) && bytes_[at_] != '#' &&
           at_ - begin < kLongest) {
      ++at_;
    }
    return bytes_.substr(begin, at_ - begin);
  }
  int Number(const std::string& what, int max) {
    const std::string word = Word();
    int value = 0;
    const auto [rest, status] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (status != std::errc() || rest != word.data() + word.size() || value < 1 || value > max) {
      throw Error(
          fmt::format("{} of 1 to {} is expected, found '{}'", what, max, PrintableUtf8(word)));
    }
    return value;
  }
  // A bit of a PBM file as text: they need no space between them.
  char Digit() {
    SkipToWord();
    return at_ < bytes_.size() ? bytes_[at_++] : '\0';
  }
  void SkipLine() { at_ = std::min(bytes_.find('\n', at_), bytes_.size()); }
  // One white space follows the last word of a header; after CR, LF belongs to it, if asked for.
  void EndHeader(bool takes_crlf) {
    if (at_ >= bytes_.size() || !IsSpace(bytes_[at_])) throw Error("its header has no end");
    const bool is_cr = bytes_[at_] == '\r';
    ++at_;
    if (is_cr && takes_crlf && at_ < bytes_.size() && bytes_[at_] == '\n') ++at_;
  }
  std::size_t at() const { return at_; }

 private:
  void SkipToWord() {
    while (at_ < bytes_.size() && (IsSpace(bytes_[at_]) || bytes_[at_] == '#')) {
      if (bytes_[at_] == '#') {
        at_ = std::min(bytes_.find_first_of("\r\n", at_), bytes_.size());
      } else {
        ++at_;
      }
    }
  }

  const std::string& bytes_;
  std::size_t at_;
};

struct Format {
  int width_px = 0, height_px = 0, channels = 1, max = 1;
  bool has_alpha = false;
};

Format PamFormat(Header* header) {
  Format format;
  for (std::string word = header->Word(); word != "ENDHDR"; word = header->Word()) {
    if (word == "WIDTH") {
      format.width_px = header->Number("a width", kMaxSidePx);
    } else if (word == "HEIGHT") {
      format.height_px = header->Number("a height", kMaxSidePx);
    } else if (word == "DEPTH") {
      format.channels = header->Number("a number of channels", CV_CN_MAX);
    } else if (word == "MAXVAL") {
      format.max = header->Number("a maximum value", kMaxValue);
    } else if (word == "TUPLTYPE") {
      const std::string type = header->Word();
      constexpr char kAlpha[] = "_ALPHA";
      format.has_alpha = type.size() > 6 && type.compare(type.size() - 6, 6, kAlpha) == 0;
      header->SkipLine();
    } else {
      throw Error(fmt::format("a header of PAM ends with ENDHDR, found '{}'", PrintableUtf8(word)));
    }
  }
  if (format.width_px == 0 || format.height_px == 0) throw Error("its header states no size");
  return format;
}

void RequireBytes(std::size_t found, std::size_t expected, const Format& format) {
  if (found >= expected) return;
  throw Error(fmt::format("{} bytes of values are expected for {}x{} px, found {}", expected,
                          format.width_px, format.height_px, found));
}

void ReadBinary(const std::string& bytes, std::size_t at, const Format& format, bool is_bitmap,
                cv::Mat* image) {
  const auto row_values =
      static_cast<std::size_t>(format.width_px) * static_cast<std::size_t>(format.channels);
  const std::size_t row_bytes = is_bitmap ? (row_values + 7) / 8 : row_values * image->elemSize1();
  RequireBytes(bytes.size() - std::min(at, bytes.size()),
               row_bytes * static_cast<std::size_t>(format.height_px), format);
  for (int y = 0; y < image->rows; ++y) {
    ThrowIfCancelled();
    const auto* from = reinterpret_cast<const std::uint8_t*>(bytes.data()) + at +  // NOLINT
                       row_bytes * static_cast<std::size_t>(y);
    if (image->depth() == CV_16U) {
      auto* to = image->ptr<std::uint16_t>(y);
      for (std::size_t i = 0; i < row_values; ++i)
        to[i] = static_cast<std::uint16_t>(from[2 * i] << 8 | from[2 * i + 1]);
    } else if (is_bitmap) {
      for (std::size_t i = 0; i < row_values; ++i)
        image->ptr(y)[i] = static_cast<std::uint8_t>(from[i / 8] >> (7 - i % 8) & 1);
    } else {
      std::memcpy(image->ptr(y), from, row_bytes);
    }
  }
}

void ReadText(Header* header, const Format& format, bool is_bitmap, cv::Mat* image) {
  for (int y = 0; y < image->rows; ++y) {
    ThrowIfCancelled();
    for (int i = 0; i < image->cols * image->channels(); ++i) {
      int value = -1;
      if (is_bitmap) {
        value = header->Digit() - '0';
      } else {
        const std::string word = header->Word();
        const auto [rest, status] = std::from_chars(word.data(), word.data() + word.size(), value);
        if (status != std::errc() || rest != word.data() + word.size()) value = -1;
      }
      if (value < 0 || value > format.max) {
        throw Error(fmt::format("row {}: a value of 0 to {} is expected", y, format.max));
      }
      if (image->depth() == CV_8U) {
        image->ptr(y)[i] = static_cast<std::uint8_t>(value);
      } else {
        image->ptr<std::uint16_t>(y)[i] = static_cast<std::uint16_t>(value);
      }
    }
  }
}

template <typename T>
void SpreadValues(int max, bool is_inverted, bool spreads, cv::Mat* image) {
  const std::uint32_t full = spreads ? (1U << 8 * sizeof(T)) - 1 : static_cast<std::uint32_t>(max);
  const auto from = static_cast<std::uint32_t>(max);
  for (int y = 0; y < image->rows; ++y) {
    T* row = image->ptr<T>(y);
    for (int i = 0; i < image->cols * image->channels(); ++i) {
      if (row[i] > from) {
        throw Error(
            fmt::format("row {}: a value of 0 to {} is expected, found {}", y, max, row[i]));
      }
      const std::uint32_t value = is_inverted ? from - row[i] : row[i];
      row[i] = static_cast<T>(full == from ? value : (value * full + from / 2) / from);
    }
  }
}

}  // namespace

DecodedImage DecodePnm(const std::string& bytes, bool spread_bits) {
  const char digit = bytes.at(1);
  const bool is_bitmap = digit == '1' || digit == '4';
  const bool is_text = digit <= '3';
  Header header(bytes, 2);
  Format format;
  if (digit == '7') {
    format = PamFormat(&header);
  } else {
    format.width_px = header.Number("a width", kMaxSidePx);
    format.height_px = header.Number("a height", kMaxSidePx);
    format.channels = digit == '3' || digit == '6' ? 3 : 1;
    if (!is_bitmap) format.max = header.Number("a maximum value", kMaxValue);
  }
  const int depth = format.max < 256 ? CV_8U : CV_16U;
  const double values = 1.0 * format.width_px * format.height_px * format.channels;
  // Text needs a digit per value, a bitmap a bit.
  if (values > 8.0 * static_cast<double>(bytes.size())) {
    RequireBytes(bytes.size(), static_cast<std::size_t>(values / (is_bitmap ? 8 : 1)), format);
  }
  DecodedImage decoded;
  decoded.pixels.create(format.height_px, format.width_px, CV_MAKETYPE(depth, format.channels));
  if (is_text) {
    ReadText(&header, format, is_bitmap, &decoded.pixels);
  } else {
    header.EndHeader(false);
    ReadBinary(bytes, header.at(), format, is_bitmap, &decoded.pixels);
  }
  if (depth == CV_8U) {
    SpreadValues<std::uint8_t>(format.max, is_bitmap, spread_bits, &decoded.pixels);
  } else {
    SpreadValues<std::uint16_t>(format.max, false, spread_bits, &decoded.pixels);
  }

  ImageFacts& facts = decoded.facts;
  facts.container_bits = depth == CV_8U ? 8 : 16;
  const int full = depth == CV_8U ? 255 : kMaxValue;
  if (format.max != full) {
    facts.significant_bits = static_cast<int>(std::ceil(std::log2(format.max + 1.0)));
    facts.notes.push_back(fmt::format("The file's values end at {}{}.", format.max,
                                      spread_bits ? fmt::format(", which became {}", full) : ""));
  }
  facts.full_scale = spread_bits ? full : format.max;
  facts.sample_type = fmt::format("unsigned {}-bit integers", facts.container_bits);
  const int colours = format.channels >= 3 ? 3 : 1;
  facts.channels =
      colours == 3 ? std::vector<std::string>{"R", "G", "B"} : std::vector<std::string>{"Y"};
  for (int i = colours, other = 1; i < format.channels; ++i) {
    const bool is_alpha = format.has_alpha && i + 1 == format.channels;
    facts.channels.push_back(is_alpha ? "A" : fmt::format("X{}", other++));
    if (is_alpha) facts.alpha = AlphaKind::kStraight;
  }
  return decoded;
}

DecodedImage DecodePfmImage(const std::string& bytes) {
  const int channels = bytes.at(1) == 'F' ? 3 : 1;
  Header header(bytes, 2);
  Format format;
  format.width_px = header.Number("a width", kMaxSidePx);
  format.height_px = header.Number("a height", kMaxSidePx);
  const std::string word = header.Word();
  double scale = 0;
  const auto [rest, status] = std::from_chars(word.data(), word.data() + word.size(), scale);
  if (status != std::errc() || rest != word.data() + word.size() || !std::isfinite(scale) ||
      scale == 0) {
    throw Error(fmt::format("a scale that is not 0 is expected, found '{}'", PrintableUtf8(word)));
  }
  const auto row_values =
      static_cast<std::size_t>(format.width_px) * static_cast<std::size_t>(channels);
  const std::size_t expected =
      row_values * static_cast<std::size_t>(format.height_px) * sizeof(float);
  // The byte behind CR may be a value's first: only the number of bytes shows which.
  header.EndHeader(bytes.size() > header.at() + 1 && bytes.size() - header.at() - 2 == expected);
  const std::size_t at = header.at();
  if (bytes.size() - at != expected) {
    throw Error(fmt::format("{} bytes of values for {}x{} px: {} are expected", bytes.size() - at,
                            format.width_px, format.height_px, expected));
  }
  DecodedImage decoded;
  decoded.pixels.create(format.height_px, format.width_px, CV_32FC(channels));
  for (int y = 0; y < format.height_px; ++y) {
    ThrowIfCancelled();
    const auto* from =
        reinterpret_cast<const std::uint8_t*>(bytes.data()) + at +  // NOLINT
        static_cast<std::size_t>(format.height_px - 1 - y) * row_values * sizeof(float);
    auto* to = decoded.pixels.ptr<float>(y);
    for (std::size_t i = 0; i < row_values; ++i) {
      std::uint32_t bits = 0;
      for (std::size_t k = 0; k < 4; ++k) bits = bits << 8 | from[4 * i + (scale < 0 ? 3 - k : k)];
      std::memcpy(to + i, &bits, sizeof bits);
    }
  }
  ImageFacts& facts = decoded.facts;
  facts.container_bits = 32;
  facts.sample_type = "32-bit floats";
  facts.channels =
      channels == 3 ? std::vector<std::string>{"R", "G", "B"} : std::vector<std::string>{"Y"};
  facts.value_scale = std::abs(scale);
  return decoded;
}

std::string EncodePnm(const cv::Mat& pixels) {
  const int bytes_per_value = static_cast<int>(pixels.elemSize1());
  std::string bytes = fmt::format("P{}\n{} {}\n{}\n", pixels.channels() == 1 ? 5 : 6, pixels.cols,
                                  pixels.rows, bytes_per_value == 1 ? 255 : kMaxValue);
  const auto row_values = static_cast<std::size_t>(pixels.cols * pixels.channels());
  bytes.reserve(bytes.size() +
                row_values * static_cast<std::size_t>(pixels.rows * bytes_per_value));
  for (int y = 0; y < pixels.rows; ++y) {
    ThrowIfCancelled();
    if (bytes_per_value == 1) {
      bytes.append(pixels.ptr<char>(y), row_values);
      continue;
    }
    const auto* row = pixels.ptr<std::uint16_t>(y);
    for (std::size_t i = 0; i < row_values; ++i) {
      bytes += static_cast<char>(static_cast<std::uint8_t>(row[i] >> 8));
      bytes += static_cast<char>(static_cast<std::uint8_t>(row[i] & 255));
    }
  }
  return bytes;
}

std::string EncodePfmImage(const cv::Mat& pixels) {
  std::string bytes = fmt::format("P{}\n{} {}\n-1.0\n", pixels.channels() == 1 ? 'f' : 'F',
                                  pixels.cols, pixels.rows);
  const auto row_values = static_cast<std::size_t>(pixels.cols * pixels.channels());
  bytes.reserve(bytes.size() + row_values * sizeof(float) * static_cast<std::size_t>(pixels.rows));
  for (int y = pixels.rows - 1; y >= 0; --y) {
    ThrowIfCancelled();
    const auto* row = pixels.ptr<float>(y);
    for (std::size_t i = 0; i < row_values; ++i) {
      std::uint32_t bits = 0;
      std::memcpy(&bits, row + i, sizeof bits);
      for (int k = 0; k < 4; ++k) bytes += static_cast<char>(bits >> (8 * k) & 0xFFU);
    }
  }
  return bytes;
}

}  // namespace thicklens::io
