// NPY files of numpy [source: numpy.lib.format, "Format Version 1.0" to "3.0"]: the magic
// "\x93NUMPY", two bytes of version, the length of the header in 2 bytes (version 1) or 4 bytes
// (2, 3), little endian, the header as text of a Python dictionary with descr, fortran_order and
// shape, and the values.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string_view>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"
#include "tools/io/depth/depth_readers.h"

namespace thicklens::io {
namespace {

constexpr char kNpyMagic[] = "\x93NUMPY";
constexpr std::size_t kNpyMagicBytes = 6;
constexpr std::size_t kMaxNpySidePx = 100000;

struct NpyHeader {
  char kind = 'f';  // f, i or u
  std::size_t bytes_per_value = 4;
  bool is_big_endian = false;
  bool is_fortran_order = false;
  std::vector<std::size_t> shape;
};

Error NpyError(const std::string& name, const std::string& what) {
  return Error(fmt::format("{}: broken NPY: {}", name, what));
}

// The text behind 'key': in the dictionary, up to the end of the text.
std::string BehindKey(const std::string& text, const std::string& key, const std::string& name) {
  for (const char quote : {'\'', '"'}) {
    const std::string quoted = quote + key + quote;
    const std::size_t at = text.find(quoted);
    if (at == std::string::npos) continue;
    std::size_t begin = text.find(':', at + quoted.size());
    if (begin == std::string::npos) break;
    begin = text.find_first_not_of(" \t", begin + 1);
    if (begin == std::string::npos) break;
    return text.substr(begin);
  }
  throw NpyError(name, fmt::format("its header has no '{}'", key));
}

void TakeType(const std::string& text, const std::string& name, NpyHeader* header) {
  const std::string expected =
      "numbers f2, f4, f8, i1 to i8 or u1 to u8 of either byte order are expected";
  const char quote = text[0];
  const std::size_t end = text.find(quote, 1);
  if ((quote != '\'' && quote != '"') || end == std::string::npos) {
    throw Error(fmt::format("{}: an NPY file of a structured type; {}", name, expected));
  }
  const std::string type = text.substr(1, end - 1);
  // strchr would find the 0 at the end of its text too.
  const auto is_one_of = [](char letter, std::string_view letters) {
    return letters.find(letter) != std::string_view::npos;
  };
  const bool has_order = !type.empty() && is_one_of(type[0], "<>|=");
  const std::string rest = type.substr(has_order ? 1 : 0);
  const bool is_known =
      rest.size() == 2 && (is_one_of(rest[0], "iu") ? is_one_of(rest[1], "1248")
                                                    : rest[0] == 'f' && is_one_of(rest[1], "248"));
  if (!is_known) {
    throw Error(
        fmt::format("{}: an NPY file of the type '{}'; {}", name, PrintableUtf8(type), expected));
  }
  header->kind = rest[0];
  header->bytes_per_value = static_cast<std::size_t>(rest[1] - '0');
  header->is_big_endian = type[0] == '>';
}

void TakeShape(const std::string& text, const std::string& name, NpyHeader* header) {
  const std::size_t end = text.find(')');
  if (text[0] != '(' || end == std::string::npos) throw NpyError(name, "its shape is no tuple");
  const char* at = text.data() + 1;
  const char* const last = text.data() + end;
  while (at < last) {
    if (*at == ' ' || *at == ',') {
      ++at;
      continue;
    }
    std::size_t side = 0;
    const auto [rest, status] = std::from_chars(at, last, side);
    if (status != std::errc()) {
      throw NpyError(name, fmt::format("its shape is {}", PrintableUtf8(text.substr(0, end + 1))));
    }
    header->shape.push_back(side);
    at = rest;
  }
}

std::uint64_t BitsAt(const char* bytes, std::size_t count, bool is_big_endian) {
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < count; ++i)
    bits = bits << 8 | static_cast<std::uint8_t>(bytes[is_big_endian ? i : count - 1 - i]);
  return bits;
}

double HalfFloat(std::uint64_t bits) {
  const auto fraction = static_cast<double>(bits & 0x3FFU);
  const int exponent = static_cast<int>(bits >> 10 & 0x1FU);
  constexpr int kSpecial = 31, kBias = 15, kFractionBits = 10;
  double value = 0;
  if (exponent == kSpecial) {
    value = fraction == 0 ? INFINITY : NAN;
  } else if (exponent == 0) {
    value = std::ldexp(fraction, 1 - kBias - kFractionBits);
  } else {
    value = std::ldexp(fraction + 1024, exponent - kBias - kFractionBits);
  }
  return (bits & 0x8000U) != 0 ? -value : value;
}

float NpyValue(const char* bytes, const NpyHeader& header) {
  const std::size_t count = header.bytes_per_value;
  const std::uint64_t bits = BitsAt(bytes, count, header.is_big_endian);
  if (header.kind == 'u') return static_cast<float>(bits);
  if (header.kind == 'i') {
    const std::size_t unused = 64 - 8 * count;
    // The shift back keeps the sign.
    return static_cast<float>(static_cast<std::int64_t>(bits << unused) >> unused);
  }
  if (count == 2) return static_cast<float>(HalfFloat(bits));
  if (count == 4) {
    const auto narrow = static_cast<std::uint32_t>(bits);
    float value = 0;
    std::memcpy(&value, &narrow, sizeof value);
    return value;
  }
  double value = 0;
  std::memcpy(&value, &bits, sizeof value);
  return static_cast<float>(value);
}

// Where the values of a map are in the file, in values and not in bytes.
struct NpyLayout {
  std::size_t width = 0, height = 0, channels = 1;
  std::size_t x_step = 0, y_step = 0, channel_step = 0;
};

// The layout of (height, width), or of channels in front of or behind them; none for other shapes.
std::optional<NpyLayout> LayoutOf(const NpyHeader& header) {
  // Axes of length 1 do not change the order of the values: (1, 480, 640), (480, 640, 1).
  std::vector<std::size_t> sides;
  for (const std::size_t side : header.shape) {
    if (side != 1) sides.push_back(side);
  }
  if (sides.size() < 2 && header.shape.size() == 2) sides = header.shape;
  if (sides.size() != 2 && sides.size() != 3) return std::nullopt;
  std::vector<std::size_t> steps(sides.size(), 1);
  for (std::size_t i = 1; i < sides.size(); ++i) {
    if (header.is_fortran_order) {
      steps[i] = steps[i - 1] * sides[i - 1];
    } else {
      const std::size_t axis = sides.size() - 1 - i;
      steps[axis] = steps[axis + 1] * sides[axis + 1];
    }
  }
  if (sides.size() == 2) return NpyLayout{sides[1], sides[0], 1, steps[1], steps[0], 0};
  const auto is_colours = [](std::size_t side) { return side == 3 || side == 4; };
  if (is_colours(sides[2]))
    return NpyLayout{sides[1], sides[0], sides[2], steps[1], steps[0], steps[2]};
  if (is_colours(sides[0]))
    return NpyLayout{sides[2], sides[1], sides[0], steps[2], steps[1], steps[0]};
  return std::nullopt;
}

NpyHeader ReadNpyHeader(const std::string& bytes, const std::string& name, std::size_t* at) {
  const std::size_t length_bytes =
      bytes.size() > kNpyMagicBytes && bytes[kNpyMagicBytes] == '\1' ? 2 : 4;
  *at = kNpyMagicBytes + 2 + length_bytes;
  if (bytes.size() < *at) throw NpyError(name, "it ends in its header");
  const auto length =
      static_cast<std::size_t>(BitsAt(bytes.data() + kNpyMagicBytes + 2, length_bytes, false));
  if (length > bytes.size() - *at) {
    throw NpyError(name, fmt::format("a header of {} bytes in a file of {}", length, bytes.size()));
  }
  const std::string text = bytes.substr(*at, length);
  *at += length;
  NpyHeader header;
  TakeType(BehindKey(text, "descr", name), name, &header);
  TakeShape(BehindKey(text, "shape", name), name, &header);
  header.is_fortran_order = BehindKey(text, "fortran_order", name).compare(0, 4, "True") == 0;
  return header;
}

}  // namespace

bool IsZip(const std::string& bytes) { return bytes.compare(0, 4, "PK\x03\x04") == 0; }

std::string WordsOnZip(const std::string& bytes, const std::string& name) {
  constexpr std::size_t kLengthsAt = 28, kHeaderBytes = 46, kMaxShown = 6;
  constexpr std::size_t kDirectoryAt = 16, kEndBytes = 22;
  const std::string ending = ".npy";
  const auto number_at = [&](std::size_t at, std::size_t count) {
    return static_cast<std::size_t>(BitsAt(bytes.data() + at, count, false));
  };
  // The record at the end states where the directory begins. The values in front of it may look
  // like entries.
  std::size_t begin = 0;
  const std::size_t end = bytes.rfind("PK\x05\x06");
  if (end != std::string::npos && end + kEndBytes <= bytes.size()) {
    const std::size_t stated = number_at(end + kDirectoryAt, 4);
    if (stated < end) begin = stated;
  }
  std::vector<std::string> arrays;
  bool is_left_out = false;
  std::size_t next = 0;
  for (std::size_t at = bytes.find("PK\x01\x02", begin); at != std::string::npos;
       at = bytes.find("PK\x01\x02", next)) {
    ThrowIfCancelled();
    if (at + kHeaderBytes > bytes.size()) break;
    const std::size_t length = number_at(at + kLengthsAt, 2);
    const std::size_t behind_name = at + kHeaderBytes + length;
    // Extra fields and a comment follow the name.
    next = behind_name + number_at(at + kLengthsAt + 2, 2) + number_at(at + kLengthsAt + 4, 2);
    if (behind_name > bytes.size()) break;
    if (length <= ending.size() ||
        bytes.compare(behind_name - ending.size(), ending.size(), ending) != 0) {
      continue;
    }
    is_left_out = arrays.size() == kMaxShown;
    if (is_left_out) break;
    arrays.push_back(PrintableUtf8(bytes.substr(at + kHeaderBytes, length - ending.size())));
  }
  if (arrays.empty()) return "a ZIP archive";
  return fmt::format(
      "an NPZ archive of the arrays {}{}: save the depth alone, in Python "
      "numpy.save('depth.npy', numpy.load('{}')['{}'])",
      fmt::join(arrays, ", "), is_left_out ? ", .." : "",
      PrintableUtf8(name.substr(name.find_last_of('/') + 1)), arrays[0]);
}

bool IsNpy(const std::string& bytes) { return bytes.compare(0, kNpyMagicBytes, kNpyMagic) == 0; }

DepthFile DecodeNpyDepth(const std::string& bytes, const std::string& name) {
  std::size_t at = 0;
  const NpyHeader header = ReadNpyHeader(bytes, name, &at);
  const std::optional<NpyLayout> layout = LayoutOf(header);
  if (!layout) {
    throw Error(fmt::format(
        "{}: an NPY file of the shape ({}); (height, width) is expected, one value per pixel", name,
        fmt::join(header.shape, ", ")));
  }
  const std::size_t width = layout->width, height = layout->height;
  if (height < 1 || width < 1 || height > kMaxNpySidePx || width > kMaxNpySidePx) {
    throw NpyError(name, fmt::format("its shape is ({}, {})", height, width));
  }
  const std::size_t expected = width * height * layout->channels * header.bytes_per_value;
  if (bytes.size() - at != expected) {
    throw NpyError(
        name,
        fmt::format("{} bytes of values for {}x{} px{}: {} are expected", bytes.size() - at, width,
                    height,
                    layout->channels == 1 ? "" : fmt::format(" in {} channels", layout->channels),
                    expected));
  }
  DepthFile file;
  file.map.width_px = static_cast<int>(width);
  file.map.height_px = static_cast<int>(height);
  file.map.integer = header.kind != 'f';
  const auto bits = static_cast<int>(8 * header.bytes_per_value);
  if (file.map.integer)
    file.map.largest_of_type = std::ldexp(1.0, header.kind == 'i' ? bits - 1 : bits) - 1;
  file.map.values.reserve(width * height);
  const std::size_t colours = std::min<std::size_t>(layout->channels, 3);
  for (std::size_t y = 0; y < height; ++y) {
    ThrowIfCancelled();
    for (std::size_t x = 0; x < width; ++x) {
      const auto value_of = [&](std::size_t channel) {
        const std::size_t place =
            y * layout->y_step + x * layout->x_step + channel * layout->channel_step;
        return NpyValue(bytes.data() + at + place * header.bytes_per_value, header);
      };
      const float value = value_of(0);
      for (std::size_t channel = 1; channel < colours; ++channel) {
        const float other = value_of(channel);
        if (other == value || (std::isnan(other) && std::isnan(value))) continue;
        throw Error(fmt::format(
            "{}: an NPY file of the shape ({}) whose channels differ: {} and {} at pixel ({}, {}); "
            "(height, width) is expected, or equal channels: save one of them",
            name, fmt::join(header.shape, ", "), value, other, x, y));
      }
      file.map.values.push_back(value);
    }
  }
  if (layout->channels > 1) {
    file.notes.push_back(fmt::format("Its {} channels are equal: they are one map.{}", colours,
                                     layout->channels == 4 ? " The fourth one is ignored." : ""));
  }
  file.description = fmt::format(
      "NPY, {} x {} px, {}", width, height,
      header.kind == 'f'
          ? fmt::format("{}-bit floats", bits)
          : fmt::format("{} {}-bit integers", header.kind == 'i' ? "signed" : "unsigned", bits));
  return file;
}

}  // namespace thicklens::io
