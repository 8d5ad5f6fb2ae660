// A file with a view in each part: EXR files with several parts, whose names hold the row and the
// column, and, where the option layout says so, the pages of a TIFF file.
#include <fmt/format.h>

#include <algorithm>
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

// Whether the version field of an EXR file says that it has several parts (bit 12;
// openexr.com/en/latest/OpenEXRFileLayout.html).
bool IsMultiPartExr(const std::string& bytes) {
  constexpr std::size_t kSecondByteOfFlags = 5;
  constexpr unsigned kMultiPart = 0x10;
  return KindOfImage(bytes) == ImageFileKind::kExr && bytes.size() > kSecondByteOfFlags &&
         (static_cast<unsigned char>(bytes[kSecondByteOfFlags]) & kMultiPart) != 0;
}

}  // namespace

std::optional<ViewSource> OpenImageParts(const LayoutInput& input) {
  const std::string bytes = ReadWholeFile(input.path);
  if (!input.is_forced && !IsMultiPartExr(bytes)) return std::nullopt;
  const auto pages =
      std::make_shared<const std::vector<DecodedImage>>(DecodeImagePages(bytes, input.path));
  std::vector<std::string> names;
  for (const DecodedImage& page : *pages) {
    names.push_back(page.facts.part.empty() ? fmt::format("page {}", page.facts.page)
                                            : page.facts.part);
  }
  if (std::set<std::string>(names.begin(), names.end()).size() != names.size()) {
    throw Error(fmt::format("{}: two parts have one name: {}", input.path, Listed(names)));
  }
  std::string text = input.reading->name;
  if (text.empty()) {
    const std::optional<NameProposal> proposal = ProposedPattern(names);
    if (!proposal) {
      throw Error(fmt::format(
          "{}: it has {} part(s): {}; parts whose names hold the row and the column are expected, "
          "or the option name states how they are named, e.g. 'view_{{v}}_{{u}}'",
          input.path, names.size(), Listed(names)));
    }
    text = proposal->pattern;
  }
  const NamePattern pattern(text);
  std::vector<std::string> others;
  const ViewGrid grid = GridOfNames(input.path, pattern, names, *input.reading, &others);
  ViewSource source;
  source.kind = fmt::format("a file of {} parts named '{}'", names.size() - others.size(),
                            PrintableUtf8(text));
  source.frame = grid.frame;
  if (!others.empty()) source.details.push_back(fmt::format("not views: {}", Listed(others)));
  source.read = [pages, names, grid, path = input.path](int k, int l) {
    const auto at = std::find(names.begin(), names.end(), grid.At(k, l)) - names.begin();
    const DecodedImage& page = (*pages)[static_cast<std::size_t>(at)];
    return LightOfPixels(page.pixels, page.facts,
                         fmt::format("{}, part '{}'", path, PrintableUtf8(grid.At(k, l))));
  };
  return source;
}

}  // namespace thicklens::io
