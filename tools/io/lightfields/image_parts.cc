// A file with a view in each part: EXR files with several parts, whose names hold the row and the
// column, and, where the option layout says so, the pages of a TIFF file. EXR files of several
// views name them in their attributes: `view` in each part, or `multiView` for the channels of one
// part (openexr.com/en/latest/MultiViewOpenEXR.html); these names are then used.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <memory>
#include <set>

#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/io/image_file.h"
#include "tools/io/image_file_kind.h"
#include "tools/io/lightfields/layout.h"
#include "tools/io/lightfields/view_grid.h"
#include "tools/io/lightfields/view_names.h"
#include "tools/io/lightfields/view_pixels.h"

namespace thicklens::io {
namespace {

constexpr char kStereo[] = "an EXR file of a left and a right view";

// The views that the header of one part of an EXR file names.
struct ExrPart {
  std::string view;                // the view that it is
  std::vector<std::string> views;  // those of its channels, that without a prefix first
  std::vector<std::string> channels;
};

// Reads numbers and texts of a header; what lies beyond the end is empty.
class ExrHeader {
 public:
  explicit ExrHeader(const std::string& bytes) : bytes_(bytes) {}
  std::string Text(std::size_t end) {
    const std::size_t found = std::min(bytes_.find('\0', at_), std::min(end, bytes_.size()));
    const std::string text = at_ < found ? bytes_.substr(at_, found - at_) : "";
    at_ = std::max(at_, found) + 1;
    return text;
  }
  std::string Text() { return Text(bytes_.size()); }
  std::size_t Length() {
    std::size_t value = 0;
    for (std::size_t i = 4; i-- > 0;)
      value =
          value << 8 | (at_ + i < bytes_.size() ? static_cast<unsigned char>(bytes_[at_ + i]) : 0);
    at_ += 4;
    return value;
  }
  std::string Bytes(std::size_t count) {
    const std::string text = at_ < bytes_.size() ? bytes_.substr(at_, count) : "";
    at_ += count;
    return text;
  }
  bool AtEnd() const { return at_ >= bytes_.size(); }
  std::size_t at() const { return at_; }
  void GoTo(std::size_t at) { at_ = at; }

 private:
  const std::string& bytes_;
  std::size_t at_ = 8;  // after the magic number and the version
};

bool IsExr(const std::string& bytes) { return KindOfImage(bytes) == ImageFileKind::kExr; }

// Whether the version field of an EXR file says that it has several parts (bit 12;
// openexr.com/en/latest/OpenEXRFileLayout.html).
bool IsMultiPartExr(const std::string& bytes) {
  constexpr std::size_t kSecondByteOfFlags = 5;
  constexpr unsigned kMultiPart = 0x10;
  return IsExr(bytes) && bytes.size() > kSecondByteOfFlags &&
         (static_cast<unsigned char>(bytes[kSecondByteOfFlags]) & kMultiPart) != 0;
}

// The headers of an EXR file: attributes of a name, a type, a length and a value.
std::vector<ExrPart> ExrPartsOf(const std::string& bytes) {
  std::vector<ExrPart> parts(1);
  if (!IsExr(bytes)) return parts;
  ExrHeader header(bytes);
  while (!header.AtEnd()) {
    const std::string name = header.Text();
    if (name.empty()) {  // the end of a header; an empty header ends all of them
      if (!IsMultiPartExr(bytes) || header.AtEnd() || bytes[header.at()] == '\0') break;
      parts.emplace_back();
      continue;
    }
    const std::string type = header.Text();
    const std::size_t length = header.Length();
    const std::size_t end = header.at() + length;
    if (end > bytes.size()) break;
    ExrPart& part = parts.back();
    if (name == "view" && type == "string") part.view = header.Bytes(length);
    while (name == "multiView" && type == "stringvector" && header.at() + 4 <= end) {
      const std::size_t letters = header.Length();  // it moves at()
      part.views.push_back(header.Bytes(std::min(letters, end - header.at())));
    }
    while (name == "channels" && type == "chlist" && header.at() + 1 < end) {
      part.channels.push_back(header.Text(end));
      header.Bytes(16);
    }
    header.GoTo(end);
  }
  return parts;
}

// The channels of a view in a part of several: "left.R", or "R" of the first view.
std::vector<std::string> ChannelsOfView(const ExrPart& part, std::size_t view) {
  const std::string prefix = view == 0 ? "" : part.views[view] + ".";
  for (const std::vector<std::string>& wanted :
       {std::vector<std::string>{"R", "G", "B"}, std::vector<std::string>{"Y"}}) {
    std::vector<std::string> names;
    for (const std::string& channel : wanted) {
      if (std::find(part.channels.begin(), part.channels.end(), prefix + channel) !=
          part.channels.end()) {
        names.push_back(prefix + channel);
      }
    }
    if (names.size() == wanted.size()) return names;
  }
  return {};
}

// A left and a right view, which are those of two places in one row; absent: the names are others.
std::optional<ViewGrid> StereoGrid(const std::string& path, const std::vector<std::string>& names,
                                   const LightFieldReading& reading) {
  if (names.size() != 2 || !reading.name.empty()) return std::nullopt;
  std::vector<NumberedView> views;
  for (const std::string& name : names) {
    std::string word = name;
    std::transform(word.begin(), word.end(), word.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    if (word == "left" || word == "right") views.push_back({word == "left" ? 0 : 1, 0, name});
  }
  if (views.size() != 2 || views[0].u == views[1].u) return std::nullopt;
  return GridOfViews(path, views, reading);
}

// The views of a file whose only part has the channels of several.
std::optional<ViewSource> OpenMultiView(const LayoutInput& input, const std::string& bytes,
                                        const ExrPart& part) {
  std::string text = input.reading->name;
  const std::optional<ViewGrid> stereo = StereoGrid(input.path, part.views, *input.reading);
  std::optional<NameProposal> proposal;
  if (text.empty() && !stereo) {
    proposal = ProposedPattern(part.views);
    if (!proposal) {
      // Other views, such as those of two eyes with other names, are no light field.
      if (!input.is_forced) return std::nullopt;
      throw Error(fmt::format(
          "{}: it has {} views: {}; views whose names hold the row and the column are expected, or "
          "the option name states how they are named, e.g. 'view_{{v}}_{{u}}'",
          input.path, part.views.size(), Listed(part.views)));
    }
    RequireClear(input.path, *proposal);
    text = proposal->pattern;
  }
  std::vector<std::string> others;
  const ViewGrid grid =
      stereo ? *stereo
             : GridOfNames(input.path, NamePattern(text), part.views, *input.reading, &others);
  ViewSource source;
  source.kind = stereo ? kStereo
                       : fmt::format("an EXR file of {} views named '{}'",
                                     part.views.size() - others.size(), PrintableUtf8(text));
  source.frame = grid.frame;
  if (!others.empty()) source.details.push_back(fmt::format("not used: {}", Listed(others)));
  if (!stereo) AddWarningsOfNames(input.path, NamePattern(text), proposal, others, &source);
  if (!grid.missing.empty())
    source.details.push_back(fmt::format("missing: {}", Listed(grid.missing)));
  source.read = [file = std::make_shared<const std::string>(bytes), part, grid, path = input.path](
                    int k, int l) {
    const std::string& view = grid.At(k, l);
    const auto at = std::find(part.views.begin(), part.views.end(), view) - part.views.begin();
    const std::string name = fmt::format("{}, view '{}'", path, PrintableUtf8(view));
    ImageReading reading;
    reading.channels = ChannelsOfView(part, static_cast<std::size_t>(at));
    if (reading.channels.empty()) {
      throw Error(fmt::format("{}: it has no channels R, G and B and no channel Y", name));
    }
    const DecodedImage image = DecodeImageFile(*file, name, reading);
    return LightOfPixels(image.pixels, image.facts, name);
  };
  return source;
}

// The names of the parts, or their views if each is another view.
std::vector<std::string> NamesOfParts(const std::vector<DecodedImage>& pages,
                                      const std::vector<ExrPart>& parts) {
  std::set<std::string> views;
  for (const ExrPart& part : parts) views.insert(part.view);
  std::vector<std::string> names;
  const bool has_views =
      parts.size() == pages.size() && views.size() == pages.size() && views.count("") == 0;
  for (std::size_t i = 0; i < pages.size(); ++i) {
    const ImageFacts& facts = pages[i].facts;
    names.push_back(has_views            ? parts[i].view
                    : facts.part.empty() ? fmt::format("page {}", facts.page)
                                         : facts.part);
  }
  return names;
}

}  // namespace

std::optional<ViewSource> OpenImageParts(const LayoutInput& input) {
  const std::string bytes = ReadWholeFile(input.path);
  const std::vector<ExrPart> parts = ExrPartsOf(bytes);
  if (parts.size() == 1 && parts[0].views.size() > 1) {
    return OpenMultiView(input, bytes, parts[0]);
  }
  if (!input.is_forced && !IsMultiPartExr(bytes)) {
    // Other kinds of files have a main image, such as HEIF, or are animations.
    if (KindOfImage(bytes) != ImageFileKind::kTiff) return std::nullopt;
    const int pages = PagesOfImage(bytes, input.path);
    if (pages < 2) return std::nullopt;
    const auto edge = static_cast<int>(std::lround(std::sqrt(pages)));
    throw Error(fmt::format(
        "{}: it has {} pages; if they are views, row by row, the option layout states it: parts:{}",
        input.path, pages, edge * edge == pages ? fmt::format("{}x{}", edge, edge) : "UxV"));
  }
  const auto pages =
      std::make_shared<const std::vector<DecodedImage>>(DecodeImagePages(bytes, input.path));
  const std::vector<std::string> names = NamesOfParts(*pages, parts);
  if (std::set<std::string>(names.begin(), names.end()).size() != names.size()) {
    throw Error(fmt::format("{}: two parts have one name: {}", input.path, Listed(names)));
  }
  std::string text = input.reading->name;
  const std::optional<ViewGrid> stereo = StereoGrid(input.path, names, *input.reading);
  std::optional<NameProposal> proposal;
  if (text.empty() && !stereo) {
    proposal = ProposedPattern(names);
    if (!proposal) {
      throw Error(fmt::format(
          "{}: it has {} part(s): {}; parts whose names hold the row and the column are expected, "
          "or the option name states how they are named, e.g. 'view_{{v}}_{{u}}'",
          input.path, names.size(), Listed(names)));
    }
    RequireClear(input.path, *proposal);
    text = proposal->pattern;
  }
  std::vector<std::string> others;
  const ViewGrid grid =
      stereo ? *stereo : GridOfNames(input.path, NamePattern(text), names, *input.reading, &others);
  ViewSource source;
  source.kind = stereo ? kStereo
                       : fmt::format("a file of {} parts named '{}'", names.size() - others.size(),
                                     PrintableUtf8(text));
  source.frame = grid.frame;
  if (!others.empty()) source.details.push_back(fmt::format("not views: {}", Listed(others)));
  if (!stereo) AddWarningsOfNames(input.path, NamePattern(text), proposal, others, &source);
  if (!grid.missing.empty())
    source.details.push_back(fmt::format("missing: {}", Listed(grid.missing)));
  source.read = [pages, names, grid, path = input.path](int k, int l) {
    const auto at = std::find(names.begin(), names.end(), grid.At(k, l)) - names.begin();
    const DecodedImage& page = (*pages)[static_cast<std::size_t>(at)];
    return LightOfPixels(page.pixels, page.facts,
                         fmt::format("{}, part '{}'", path, PrintableUtf8(grid.At(k, l))));
  };
  return source;
}

}  // namespace thicklens::io
