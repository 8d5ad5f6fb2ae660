#include "model/tables/table_text.h"

#include <fmt/format.h>
#include <iconv.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <memory>
#include <optional>
#include <utility>

#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

bool StartsWith(const std::string& text, const std::string& beginning) {
  return text.compare(0, beginning.size(), beginning) == 0;
}

// Converts to another encoding, or returns nothing if the bytes are not in theirs.
std::optional<std::string> Converted(const std::string& bytes, const char* to,
                                     const char* encoding) {
  const iconv_t converter = ::iconv_open(to, encoding);
  // NOLINTNEXTLINE: the value that iconv_open defines for failure
  if (converter == reinterpret_cast<iconv_t>(-1)) return std::nullopt;
  const std::unique_ptr<void, int (*)(iconv_t)> closer(converter, ::iconv_close);
  std::string text;
  std::string input = bytes;  // iconv takes a pointer to non-constant bytes
  char* in = input.data();
  std::size_t in_left = input.size();
  std::array<char, 1 << 16> buffer{};
  while (in_left > 0) {
    char* out = buffer.data();
    std::size_t out_left = buffer.size();
    const bool is_done =
        ::iconv(converter, &in, &in_left, &out, &out_left) != static_cast<std::size_t>(-1);
    text.append(buffer.data(), buffer.size() - out_left);
    if (!is_done && errno != E2BIG) return std::nullopt;
  }
  return text;
}

// UTF-16 without a byte order mark: text of tables is mostly ASCII, of which every second byte is
// 0.
const char* Utf16WithoutMark(const std::string& bytes) {
  if (bytes.size() < 4 || bytes.size() % 2 != 0) return nullptr;
  std::size_t even = 0, odd = 0;
  for (std::size_t i = 0; i < bytes.size(); i += 2) {
    even += bytes[i] == '\0';
    odd += bytes[i + 1] == '\0';
  }
  const std::size_t pairs = bytes.size() / 2;
  constexpr std::size_t kPercent = 100, kHigh = 70, kLow = 2;
  if (odd * kPercent >= kHigh * pairs && even * kPercent <= kLow * pairs) return "UTF-16LE";
  if (even * kPercent >= kHigh * pairs && odd * kPercent <= kLow * pairs) return "UTF-16BE";
  return nullptr;
}

// Files that spreadsheets and cameras write and that are easily given in place of a table.
void RefuseOtherKinds(const std::string& bytes, const std::string& path) {
  static const std::pair<const char*, const char*> kKinds[] = {
      {"PK\x03\x04", "a workbook (xlsx, ods) or another ZIP archive; save the sheet as CSV"},
      {"\xD0\xCF\x11\xE0", "a workbook of Excel (xls); save the sheet as CSV"},
      {"\x89PNG", "a PNG image"},
      {"\xFF\xD8\xFF", "a JPEG image"},
      {"II*", "a TIFF image"},
      {"%PDF", "a PDF document"},
      {"\x89HDF", "an HDF5 file"}};
  for (const auto& [beginning, kind] : kKinds) {
    if (StartsWith(bytes, beginning))
      throw Error(fmt::format("{}: no table of readings, but {}", path, kind));
  }
}

std::size_t LineAt(const std::string& text, std::size_t at) {
  return 1 + static_cast<std::size_t>(
                 std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
}

void RefuseNul(const std::string& text, const std::string& path) {
  const std::size_t nul = text.find('\0');
  if (nul == std::string::npos) return;
  throw Error(fmt::format(
      "{}:{}: a NUL byte, which no text file contains; a table in UTF-8 or UTF-16 is expected",
      path, LineAt(text, nul)));
}

// Names of files may contain control characters, but bytes that are neither UTF-8 nor free of them
// are no text of any encoding.
void RefuseBinary(const std::string& bytes, const std::string& path) {
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const auto byte = static_cast<unsigned char>(bytes[i]);
    const bool is_space = byte == '\t' || byte == '\n' || byte == '\r' || byte == '\f';
    if (byte >= ' ' || is_space || byte == 0x1A) continue;
    throw Error(
        fmt::format("{}:{}: no text: the bytes are no UTF-8, and among them is the control "
                    "character {:#04x}; a "
                    "table of readings is expected",
                    path, LineAt(bytes, i), byte));
  }
}

std::string WithLineFeeds(const std::string& text) {
  std::string lines;
  lines.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '\x1A') continue;
    if (text[i] != '\r') {
      lines += text[i];
    } else if (i + 1 == text.size() || text[i + 1] != '\n') {
      lines += '\n';
    }
  }
  return lines;
}

}  // namespace

std::string Shown(const std::string& text) {
  constexpr std::size_t kMost = 80;
  return text.size() <= kMost ? text : text.substr(0, kMost) + "...";
}

std::optional<std::string> InLatin1(const std::string& text) {
  if (auto bytes = Converted(text, "WINDOWS-1252", "UTF-8")) return bytes;
  return Converted(text, "ISO-8859-1", "UTF-8");
}

TableText DecodeTableText(const std::string& bytes, const std::string& path) {
  RefuseOtherKinds(bytes, path);
  const std::string mark_of_utf32("\xFF\xFE\0\0", 4);
  if (StartsWith(bytes, mark_of_utf32) || StartsWith(bytes, std::string("\0\0\xFE\xFF", 4)))
    throw Error(path + ": the text is UTF-32; save it as UTF-8");
  TableText decoded{bytes, "UTF-8"};
  const char* wide = Utf16WithoutMark(bytes);
  std::size_t mark = 0;
  if (StartsWith(bytes, "\xFF\xFE")) wide = "UTF-16LE", mark = 2;
  if (StartsWith(bytes, "\xFE\xFF")) wide = "UTF-16BE", mark = 2;
  if (wide != nullptr) {
    const auto text = Converted(bytes.substr(mark), "UTF-8", wide);
    if (!text) {
      throw Error(fmt::format(
          "{}: the text is {}, but is cut off or contains half a character; save it as UTF-8", path,
          mark > 0 ? "UTF-16 by its byte order mark" : "UTF-16"));
    }
    decoded = {*text, "UTF-16"};
  } else if (StartsWith(bytes, "\xEF\xBB\xBF")) {
    decoded.text = bytes.substr(3);
  }
  RefuseNul(decoded.text, path);
  if (wide == nullptr && !Converted(decoded.text, "UTF-8", "UTF-8")) {
    RefuseBinary(decoded.text, path);
    // Windows-1252 leaves five bytes undefined; they are control characters in Latin-1.
    auto text = Converted(decoded.text, "UTF-8", "WINDOWS-1252");
    if (!text) text = Converted(decoded.text, "UTF-8", "ISO-8859-1");
    if (!text) throw Error(path + ": the text is in an unknown encoding; save it as UTF-8");
    decoded = {*text, "Latin-1"};
  }
  decoded.text = WithLineFeeds(decoded.text);
  return decoded;
}

}  // namespace thicklens::model
