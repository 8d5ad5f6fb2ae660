// Functions that the forms of embedded depth have in common.
#include "tools/io/depth/embedded_parts.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <cstdint>
#include <system_error>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"
#include "tools/io/depth/depth_readers.h"
#include "tools/io/image_file_kind.h"

namespace thicklens::io {
namespace {

// The value of a digit of base64; -1: it is none.
int Base64Digit(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  if (c == '+') return 62;
  return c == '/' ? 63 : -1;
}

bool IsWhite(char c) { return c == ' ' || c == '\n' || c == '\r' || c == '\t'; }

std::string Shortened(const std::string& text) {
  constexpr std::size_t kMost = 40;
  return PrintableUtf8(text.size() <= kMost ? text : text.substr(0, kMost) + "...");
}

}  // namespace

double XmpNumberOf(const XmpNode& xmp, const XmpField& field, const std::string& meaning,
                   const std::string& name) {
  const std::optional<std::string> text = xmp.Text(field.space, field.name);
  if (!text) throw Error(fmt::format("{}: {} is missing: {}", name, field.Shown(), meaning));
  double value = 0;
  const char* const end = text->data() + text->size();
  const auto [rest, status] = std::from_chars(text->data(), end, value);
  if (status != std::errc() || rest != end || !std::isfinite(value)) {
    throw Error(fmt::format("{}: {} is '{}': {} is expected, a finite number", name, field.Shown(),
                            Shortened(*text), meaning));
  }
  return value;
}

std::string DecodeBase64(const std::string& text, const std::string& name) {
  std::string bytes;
  bytes.reserve(text.size() / 4 * 3);
  std::uint32_t bits = 0;
  std::size_t digits = 0, padding = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (IsWhite(c)) continue;
    const int digit = Base64Digit(c);
    if (c == '=') {
      ++padding;
      continue;
    }
    if (digit < 0 || padding > 0) {
      throw Error(fmt::format("{}: character {} is '{}': base64 is expected", name, i + 1,
                              PrintableUtf8(std::string(1, c))));
    }
    bits = bits << 6 | static_cast<std::uint32_t>(digit);
    if (++digits % 4 != 0) continue;
    for (const unsigned shift : {16U, 8U, 0U}) bytes += static_cast<char>(bits >> shift & 0xFFU);
    bits = 0;
  }
  const std::size_t rest = digits % 4;
  if (rest == 1 || padding > 2) {
    throw Error(fmt::format("{}: {} digits of base64 with {} '=' at the end: the text was cut",
                            name, digits, padding));
  }
  if (rest >= 2) bytes += static_cast<char>(bits >> (6 * rest - 8) & 0xFFU);
  if (rest == 3) bytes += static_cast<char>(bits >> 2 & 0xFFU);
  return bytes;
}

EmbeddedDepth OfStoredImage(const std::string& bytes, const std::string& mime,
                            const std::string& name) {
  const std::optional<ImageFileKind> kind = KindOfImage(bytes);
  const bool is_jpeg = kind == ImageFileKind::kJpeg;
  if (!is_jpeg && kind != ImageFileKind::kPng) {
    throw Error(fmt::format("{}: {} bytes that are {}: a PNG or JPEG image is expected", name,
                            bytes.size(), kind ? "a " + NameOf(*kind) + " file" : "no image"));
  }
  DepthFile file = DecodeImageDepth(bytes, name, {});
  EmbeddedDepth depth;
  depth.map = std::move(file.map);
  depth.description =
      fmt::format("{}, {} x {} px, numbers to {:g}", NameOf(*kind), depth.map.width_px,
                  depth.map.height_px, depth.map.largest_of_type.value_or(1));
  depth.notes = std::move(file.notes);
  if (is_jpeg) {
    depth.warnings.emplace_back(
        "The depth map is stored as JPEG: compression blurs its edges and changes its values by "
        "some levels.");
  } else {
    depth.warnings = std::move(file.warnings);
  }
  const std::string expected = is_jpeg ? "image/jpeg" : "image/png";
  if (!mime.empty() && mime != expected) {
    depth.notes.push_back(fmt::format("Its Mime states {}, the data are {}.", Shortened(mime),
                                      is_jpeg ? "JPEG" : "PNG"));
  }
  return depth;
}

}  // namespace thicklens::io
