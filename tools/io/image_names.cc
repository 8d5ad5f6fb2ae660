#include "tools/io/image_names.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <system_error>

#include "thicklens/base/error.h"

namespace thicklens::io {
namespace {

namespace fs = std::filesystem;

// Endings of the image files among which views are looked for. What a file holds is found by its
// content.
constexpr std::array<const char*, 16> kEndings = {
    ".png", ".jpg", ".jpeg", ".tif", ".tiff", ".exr",  ".webp", ".bmp",
    ".ppm", ".pgm", ".pnm",  ".pfm", ".heic", ".avif", ".dng",  ".hif"};

}  // namespace

bool IsImageName(const std::string& name) {
  std::string ending = fs::path(name).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::find(kEndings.begin(), kEndings.end(), ending) != kEndings.end();
}

std::vector<std::string> ImageNames(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code failure;
  for (fs::directory_iterator entry(folder, failure), end; !failure && entry != end;
       entry.increment(failure)) {
    const std::string name = entry->path().filename().string();
    std::error_code ignored;
    if (name.front() != '.' && IsImageName(name) && !entry->is_directory(ignored))
      names.push_back(name);
  }
  if (failure) throw Error(fmt::format("{}: cannot be read: {}", folder, failure.message()));
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace thicklens::io
