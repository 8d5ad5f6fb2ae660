// Any folder whose files' names hold the row and the column, or a number, by the pattern of the
// option name. Without the option, names in which exactly two numbers change are read as row and
// column; the shifts between the views then say whether that was right (view_order.h).
#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "thicklens/base/printable_text.h"
#include "tools/io/image_names.h"
#include "tools/io/lightfields/layout.h"
#include "tools/io/lightfields/view_grid.h"
#include "tools/io/lightfields/view_names.h"
#include "tools/io/lightfields/view_pixels.h"

namespace thicklens::io {

namespace fs = std::filesystem;

namespace {

// The views of a folder whose names fit a pattern.
ViewSource NamedSource(const LayoutInput& input, const NamePattern& pattern, const ViewGrid& grid,
                       const std::vector<std::string>& others) {
  ViewSource source;
  source.kind = fmt::format("a folder of views named '{}'", PrintableUtf8(pattern.text()));
  source.frame = grid.frame;
  source.details.push_back(pattern.HasRowAndColumn()
                               ? "{v} is the row, {u} the column"
                               : fmt::format("{{n}} counts row by row from {}", grid.first_number));
  if (!others.empty()) source.details.push_back(fmt::format("not views: {}", Listed(others)));
  if (!grid.missing.empty())
    source.details.push_back(fmt::format("missing: {}", Listed(grid.missing)));
  source.read = [folder = input.path, grid](int k, int l) {
    return ReadLightOfFile((fs::path(folder) / grid.At(k, l)).string());
  };
  return source;
}

}  // namespace

std::optional<ViewSource> OpenNamedFolder(const LayoutInput& input) {
  const std::vector<std::string> names = ImageNames(input.path);
  std::string text = input.reading->name;
  std::optional<NameProposal> proposal;
  if (text.empty()) {
    proposal = ProposedPattern(names);
    if (proposal && proposal->changing == 2) {
      RequireClear(input.path, *proposal);
      text = proposal->pattern;
    }
    if (text.empty() && !input.is_forced) return std::nullopt;
    if (text.empty()) {
      throw Error(fmt::format(
          "{}: the option name must state how the views are named, e.g. 'view_{{v}}_{{u}}.jpg'; "
          "found {} image(s): {}{}",
          input.path, names.size(), Listed(names),
          proposal ? fmt::format("; '{}' would fit {} of them", PrintableUtf8(proposal->pattern),
                                 proposal->names)
                   : ""));
    }
  }
  const NamePattern pattern(text);
  std::vector<std::string> others;
  const ViewGrid grid = GridOfNames(input.path, pattern, names, *input.reading, &others);
  ViewSource source = NamedSource(input, pattern, grid, others);
  if (grid.may_start_at_one) {
    std::vector<std::string> ignored;
    const ViewGrid from_one = GridOfNames(input.path, pattern, names, *input.reading, &ignored, 1);
    const auto other = std::make_shared<ViewSource>(NamedSource(input, pattern, from_one, others));
    AddWarningsOfNames(input.path, pattern, proposal, others, other.get());
    source.from_one = other;
  }
  if (pattern.HasRowAndColumn() && input.reading->grid > 0)
    source.details.push_back("the option grid is not used, because names have row and column");
  AddWarningsOfNames(input.path, pattern, proposal, others, &source);
  for (const std::string& file : grid.files) {
    if (!file.empty()) ReportInput((fs::path(input.path) / file).string());
  }
  return source;
}

}  // namespace thicklens::io
