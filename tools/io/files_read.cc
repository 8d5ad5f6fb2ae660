#include "thicklens/io/files_read.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>

#include "thicklens/base/printable_text.h"

namespace thicklens::io {
namespace {

std::string NameOf(const std::string& path) {
  return PrintableUtf8(std::filesystem::path(path).filename().string());
}

// "31 pages of stack.tif: ", "31 files: ", "f007.tif and 2 more: ", or nothing for one file.
std::string FilesText(const FilesRead& group, bool is_first, bool is_only) {
  const std::vector<std::string>& files = group.files;
  const bool are_pages = std::count(files.begin(), files.end(), files.front()) ==
                         static_cast<std::ptrdiff_t>(files.size());
  if (files.size() == 1) return is_only ? "" : NameOf(files.front()) + ": ";
  if (are_pages) {
    return fmt::format("{} {} of {}: ", files.size(), group.facts.video ? "frames" : "pages",
                       NameOf(files.front()));
  }
  if (is_first) return fmt::format("{} files: ", files.size());
  return fmt::format("{} and {} more: ", NameOf(files.front()), files.size() - 1);
}

}  // namespace

std::vector<FilesRead> GroupFilesRead(const std::vector<std::string>& paths,
                                      const std::vector<std::optional<ImageFacts>>& facts) {
  std::vector<FilesRead> groups;
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < paths.size() && i < facts.size(); ++i) {
    if (!facts[i]) continue;
    ImageFacts described = *facts[i];
    described.page = 0;  // frames may be the pages of one file
    const std::string line = described.OneLine();
    const auto known = std::find(lines.begin(), lines.end(), line);
    if (known != lines.end()) {
      groups[static_cast<std::size_t>(known - lines.begin())].files.push_back(paths[i]);
    } else {
      lines.push_back(line);
      groups.push_back({{paths[i]}, *facts[i]});
    }
  }
  std::stable_sort(groups.begin(), groups.end(), [](const FilesRead& a, const FilesRead& b) {
    return a.files.size() > b.files.size();
  });
  return groups;
}

std::string FilesReadLine(const std::vector<FilesRead>& groups) {
  constexpr std::size_t kShown = 3;
  std::string line;
  for (std::size_t i = 0; i < groups.size() && i < kShown; ++i) {
    const FilesRead& group = groups[i];
    if (i > 0) line += "; ";
    line += FilesText(group, i == 0, groups.size() == 1);
    ImageFacts facts = group.facts;
    if (group.files.size() > 1) facts.pages = 1;  // the page is that of the first file only
    line += facts.OneLine();
  }
  if (groups.size() > kShown) line += fmt::format("; and {} more kinds", groups.size() - kShown);
  return line;
}

}  // namespace thicklens::io
