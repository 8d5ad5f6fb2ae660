#include "model/schema/sweep_frames.h"

#include <fmt/format.h>
#include <glob.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <set>
#include <system_error>

#include "model/schema/readings_table.h"
#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"

namespace thicklens::model {
namespace {

namespace fs = std::filesystem;

// Whether the name begins with a dot: incomplete outputs, and the companion files that some systems
// create for every file ("._frame.png").
bool IsHidden(const fs::path& file) { return file.filename().string().rfind('.', 0) == 0; }

bool IsImageName(const fs::path& file) {
  static const std::set<std::string> kEndings = {".png", ".jpg", ".jpeg", ".tif", ".tiff",
                                                 ".bmp", ".pgm", ".ppm",  ".pnm"};
  std::string ending = file.extension().string();
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return kEndings.count(ending) > 0;
}

// The folder of the YAML file may have any name. Only the text in the file is a pattern.
std::string EscapedForGlob(const std::string& folder) {
  std::string escaped;
  for (const char c : folder) {
    if (c == '*' || c == '?' || c == '[' || c == '\\') escaped += '\\';
    escaped += c;
  }
  return escaped;
}

std::vector<std::string> FilesMatching(const YamlNode& node) {
  const std::string folder = EscapedForGlob(fs::path(node.source()).parent_path().string());
  const std::string pattern = (fs::path(folder) / node.Text()).string();
  glob_t found{};
  std::vector<std::string> files;
  if (::glob(pattern.c_str(), 0, nullptr, &found) == 0) {
    for (std::size_t i = 0; i < found.gl_pathc; ++i) files.emplace_back(found.gl_pathv[i]);
  }
  ::globfree(&found);
  return files;
}

// The images in the folder itself or, if it contains none, in its direct sub-folders: a user may
// name the folder that contains both the table and "frames/".
std::vector<std::string> ImagesIn(const std::string& folder) {
  std::error_code failure;
  if (!fs::is_directory(folder, failure))
    throw Error(fmt::format("{}: the folder does not exist", folder));
  fs::directory_iterator entries(folder, failure);
  if (failure) throw Error(fmt::format("{}: cannot be read: {}", folder, failure.message()));
  std::vector<std::string> here, below;
  for (const auto& entry : entries) {
    if (IsHidden(entry.path())) continue;
    if (entry.is_regular_file(failure) && IsImageName(entry.path()))
      here.push_back(entry.path().string());
    if (!entry.is_directory(failure)) continue;
    for (const auto& inner : fs::directory_iterator(entry.path(), failure)) {
      if (!IsHidden(inner.path()) && inner.is_regular_file(failure) && IsImageName(inner.path()))
        below.push_back(inner.path().string());
    }
  }
  std::vector<std::string>& files = here.empty() ? below : here;
  std::sort(files.begin(), files.end());
  return files;
}

// Checks a frame early, because frames are read long after their names are known.
void RequireFrame(const std::string& path, const std::string& place) {
  ReportInput(path);
  try {
    RequireRegularFile(path);
  } catch (const Error& error) {
    throw Error(place + error.what());
  }
}

// Pairs table rows and image files by name; each must have its partner.
std::vector<SweepFrame> JoinRowsAndFiles(const std::vector<ReadingRow>& rows,
                                         const std::string& table,
                                         const std::vector<std::string>& files,
                                         const std::string& folder, double mm_per_unit) {
  std::vector<SweepFrame> frames;
  std::set<std::string> used;
  for (const ReadingRow& row : rows) {
    std::string path = (fs::path(folder) / row.file).lexically_normal().string();
    std::error_code failure;
    if (!fs::exists(path, failure)) {
      const auto same_name = [&](const std::string& file) {
        return fs::path(file).filename() == row.file;
      };
      const auto match = std::find_if(files.begin(), files.end(), same_name);
      if (match == files.end()) {
        throw Error(fmt::format("{}:{}: the file '{}' is not in {}", table, row.line, row.file,
                                folder.empty() ? "." : folder));
      }
      const auto other = std::find_if(match + 1, files.end(), same_name);
      if (other != files.end()) {
        throw Error(fmt::format("{}:{}: '{}' may be {} or {}; write the name of its folder, too",
                                table, row.line, row.file, *match, *other));
      }
      path = fs::path(*match).lexically_normal().string();
    }
    RequireFrame(path, fmt::format("{}:{}: ", table, row.line));
    if (!used.insert(path).second) {
      throw Error(
          fmt::format("{}:{}: the file '{}' already has a reading", table, row.line, row.file));
    }
    frames.push_back({path, row.reading * mm_per_unit});
  }
  std::vector<std::string> without_row;
  for (const std::string& file : files) {
    if (used.count(fs::path(file).lexically_normal().string()) == 0) without_row.push_back(file);
  }
  // An image that was left out by mistake costs more than one that has to be moved away.
  if (!without_row.empty()) {
    throw Error(fmt::format(
        "{}: has no row in {} ({} such file{}): add its reading, move it elsewhere, or "
        "choose the files by frames_glob in a sweep file",
        without_row.front(), table, without_row.size(), without_row.size() == 1 ? "" : "s"));
  }
  return frames;
}

}  // namespace

std::vector<SweepFrame> ReadSweepFrames(const YamlNode& root, double mm_per_unit) {
  if (root.Has("frames") == root.Has("frames_csv")) {
    throw root.ErrorHere(
        "either 'frames' (a list of image and reading_mm) or 'frames_csv' (a table) is expected");
  }
  if (const auto table = root.Find("frames_csv")) {
    const std::string csv = table->ResolvePath(table->Text());
    std::string folder = fs::path(csv).parent_path().string();
    if (const auto dir = root.Find("frames_dir")) folder = dir->ResolvePath(dir->Text());
    std::vector<std::string> files;
    if (const auto pattern = root.Find("frames_glob")) {
      files = FilesMatching(*pattern);
      if (files.empty())
        throw pattern->ErrorHere(fmt::format("no file matches '{}'", pattern->Text()));
    } else {
      files = ImagesIn(folder.empty() ? "." : folder);
    }
    return JoinRowsAndFiles(ReadReadingsTable(csv), csv, files, folder, mm_per_unit);
  }
  for (const char* key : {"frames_dir", "frames_glob"}) {
    if (const auto extra = root.Find(key))
      throw extra->ErrorHere(
          "this key applies only to 'frames_csv'; the paths in 'frames' are complete");
  }
  std::vector<SweepFrame> frames;
  std::set<std::string> images;
  for (const YamlNode& node : root.At("frames").Elements()) {
    node.RequireKeys({"image", "reading_mm"});
    const YamlNode image = node.At("image");
    const std::string path = image.ResolvePath(image.Text());
    std::error_code failure;
    if (!fs::exists(path, failure))
      throw image.ErrorHere(fmt::format("the file '{}' does not exist", path));
    try {
      RequireRegularFile(path);
    } catch (const Error& error) {
      throw image.ErrorHere(error.what());
    }
    if (!images.insert(path).second)
      throw image.ErrorHere(fmt::format("'{}' is listed twice", image.Text()));
    frames.push_back({path, node.At("reading_mm").Number()});
  }
  if (frames.empty()) throw root.At("frames").ErrorHere("at least one frame is expected");
  return frames;
}

std::vector<SweepFrame> FramesOfFolder(const std::string& folder, const std::string& readings_csv) {
  return JoinRowsAndFiles(ReadReadingsTable(readings_csv), readings_csv, ImagesIn(folder), folder,
                          1);
}

}  // namespace thicklens::model
