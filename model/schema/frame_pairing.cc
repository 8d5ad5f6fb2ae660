#include "model/schema/frame_pairing.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <system_error>

#include "model/tables/table_text.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"

namespace thicklens::model {
namespace {

namespace fs = std::filesystem;

std::string Shortened(const std::string& text) {
  constexpr std::size_t kMost = 200;
  return text.size() <= kMost ? text : text.substr(0, kMost) + "...";
}

// With ASCII letters in lower case.
std::string LowerCase(std::string text) {
  for (char& c : text) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return text;
}

// The last part of a path of any system.
std::string NameIn(const std::string& path) {
  const std::size_t slash = path.find_last_of("/\\");
  return slash == std::string::npos ? path : path.substr(slash + 1);
}

std::optional<int> WholeNumber(const std::string& text) {
  int value = 0;
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (status != std::errc() || end != text.data() + text.size() || value < 0) return std::nullopt;
  return value;
}

bool HasOtherCapitals(const std::string& name, const std::string& image) {
  const fs::path file = fs::path(image).filename();
  return name != file.string() && name != file.stem().string();
}

class Images {
 public:
  Images(const std::vector<std::string>& files, const std::string& folder)
      : files_(files), folder_(folder), here_(fs::current_path()) {
    for (std::size_t i = 0; i < files.size(); ++i) {
      by_path_.emplace(Key(files[i]), i);
      const fs::path name = fs::path(files[i]).filename();
      by_name_[name.string()].push_back(i);
      by_stem_[name.stem().string()].push_back(i);
      by_lower_name_[LowerCase(name.string())].push_back(i);
      by_lower_stem_[LowerCase(name.stem().string())].push_back(i);
    }
  }

  // Returns the image of the row. `is_by_name` is set if the row has a path that leads nowhere, and
  // only its last part names an image, also with capitals and small letters exchanged.
  std::string Find(const FileReading& row, const std::string& table_folder, bool* is_by_name) {
    std::vector<std::string> paths = {(fs::path(table_folder) / row.file).string()};
    if (table_folder != folder_) paths.push_back((fs::path(folder_) / row.file).string());
    for (const std::string& path : paths) {
      const auto found = by_path_.find(Key(path));
      if (found != by_path_.end()) return Normal(files_[found->second]);
    }
    for (const std::string& path : paths) {
      std::error_code failure;
      if (!fs::exists(path, failure)) continue;
      const auto same = SameFile(path);
      return Normal(same ? files_[*same] : path);
    }
    try {
      return FindByName(row, is_by_name);
    } catch (const Error&) {
      // The names on the disk may have the bytes of the table, which was converted from Latin-1.
      FileReading other = row;
      const auto bytes = InLatin1(row.file);
      if (!bytes || *bytes == row.file) throw;
      other.file = *bytes;
      if (by_name_.count(NameIn(*bytes)) == 0) throw;
      return FindByName(other, is_by_name);
    }
  }

 private:
  static std::string Normal(const std::string& path) {
    return fs::path(path).lexically_normal().string();
  }
  std::string Key(const std::string& path) const {
    return (here_ / path).lexically_normal().string();
  }

  // The image that the path leads to by links.
  std::optional<std::size_t> SameFile(const std::string& path) {
    std::error_code failure;
    if (canonical_.empty()) {
      for (std::size_t i = 0; i < files_.size(); ++i)
        canonical_.emplace(fs::canonical(files_[i], failure).string(), i);
    }
    const auto found = canonical_.find(fs::canonical(path, failure).string());
    if (failure || found == canonical_.end()) return std::nullopt;
    return found->second;
  }

  std::string FindByName(const FileReading& row, bool* is_by_name) const {
    const std::string name = NameIn(row.file);
    const std::vector<std::size_t>* found = nullptr;
    if (const auto same = by_name_.find(name); same != by_name_.end()) {
      found = &same->second;
    } else if (const auto stem = by_stem_.find(name); stem != by_stem_.end()) {
      found = &stem->second;  // the table leaves out the ending
    } else if (const auto lower = by_lower_name_.find(LowerCase(name));
               lower != by_lower_name_.end()) {
      found = &lower->second;
    } else if (const auto lower_stem = by_lower_stem_.find(LowerCase(name));
               lower_stem != by_lower_stem_.end()) {
      found = &lower_stem->second;
    }
    if (found == nullptr && WholeNumber(row.file)) {
      throw Error(fmt::format(
          "{}'{}' names no file in {}: numbers of frames are for a video or for the pages of one "
          "file; the frames of a folder need the names of their files, in a column that "
          "--file-column selects",
          row.place, Shortened(row.file), folder_.empty() ? "." : folder_));
    }
    if (found == nullptr) {
      throw Error(fmt::format("{}the file '{}' is not in {}", row.place, Shortened(row.file),
                              folder_.empty() ? "." : folder_));
    }
    if (found->size() > 1) {
      const std::string &one = files_[(*found)[0]], &other = files_[(*found)[1]];
      const bool is_one_folder = fs::path(one).parent_path() == fs::path(other).parent_path();
      const bool differs_by_case =
          is_one_folder && LowerCase(NameIn(one)) == LowerCase(NameIn(other));
      throw Error(fmt::format("{}'{}' may be {} or {}; write {}", row.place, Shortened(row.file),
                              one, other,
                              differs_by_case ? "its name with the capitals of the file"
                              : is_one_folder ? "its ending, too"
                                              : "the name of its folder, too"));
    }
    *is_by_name = name != row.file || HasOtherCapitals(name, files_[found->front()]);
    return Normal(files_[found->front()]);
  }

  const std::vector<std::string>& files_;
  const std::string& folder_;
  fs::path here_;
  std::map<std::string, std::size_t> by_path_, canonical_;
  std::map<std::string, std::vector<std::size_t>> by_name_, by_stem_;
  std::map<std::string, std::vector<std::size_t>> by_lower_name_, by_lower_stem_;
};

// The path without its ending.
std::string StemOf(const std::string& path) { return fs::path(path).replace_extension().string(); }

// The page of a row, or a number that counts from 0 or from 1.
struct RowPage {
  int number = 0;
  bool is_index = false;  // "stack.tif[3]"
};

// Nothing if the row names no page of the file `name`.
std::optional<RowPage> FindPageOfRow(const FileReading& row, const std::string& name) {
  if (const auto number = WholeNumber(row.file)) return RowPage{*number, false};
  const std::size_t bracket = row.file.rfind('[');
  if (bracket != std::string::npos && row.file.back() == ']') {
    const std::string file = NameIn(row.file.substr(0, bracket));
    const auto page = WholeNumber(row.file.substr(bracket + 1, row.file.size() - bracket - 2));
    if (page && (file.empty() || file == name)) return RowPage{*page, true};
  }
  return std::nullopt;
}

RowPage PageOfRow(const FileReading& row, const std::string& name, int pages) {
  if (const auto page = FindPageOfRow(row, name)) return *page;
  throw Error(fmt::format(
      "{}{} has {} pages, and '{}' is none of them: a row for each page is expected, '{}[0]' to "
      "'{}[{}]' or its number, or no table if the file has OME-XML with positions",
      row.place, name, pages, Shortened(row.file), name, name, pages - 1));
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

}  // namespace

std::vector<SweepFrame> PairFrames(const ReadingSet& readings,
                                   const std::vector<std::string>& files, const std::string& folder,
                                   std::vector<std::string>* notices) {
  Images images(files, folder);
  std::vector<SweepFrame> frames;
  std::map<std::string, const FileReading*> row_of;
  std::size_t by_name = 0;
  const FileReading* first_by_name = nullptr;
  std::string first_image;
  for (const FileReading& row : readings.rows) {
    if (frames.size() % 4096 == 0) ThrowIfCancelled();
    bool is_by_name = false;
    const std::string path = images.Find(row, readings.folder, &is_by_name);
    RequireFrame(path, row.place);
    const auto [known, added] = row_of.emplace(path, &row);
    if (!added) {
      throw Error(fmt::format("{}the file '{}' already has a reading, at {}", row.place,
                              Shortened(row.file),
                              known->second->place.substr(0, known->second->place.size() - 2)));
    }
    if (is_by_name && by_name++ == 0) {
      first_by_name = &row;
      first_image = path;
    }
    frames.push_back({path, row.reading_mm});
  }
  std::set<std::string> stems;
  for (const auto& [path, row] : row_of) stems.insert(StemOf(path));
  std::vector<std::string> without_row, of_other_kind;
  for (const std::string& file : files) {
    const std::string path = fs::path(file).lexically_normal().string();
    if (row_of.count(path) > 0) continue;
    // A camera that saves each photograph as raw and as JPEG.
    (stems.count(StemOf(path)) > 0 ? of_other_kind : without_row).push_back(file);
  }
  // An image that was left out by mistake costs more than one that has to be moved away.
  if (!without_row.empty()) {
    throw Error(
        fmt::format("{}: has no row in {} ({} such file{}): add its reading, move it elsewhere, or "
                    "choose the files by frames_glob in a sweep file",
                    without_row.front(), readings.source, without_row.size(),
                    without_row.size() == 1 ? "" : "s"));
  }
  if (by_name > 0 && notices != nullptr) {
    notices->push_back(fmt::format(
        "{}'{}' does not exist{}; the image of the same name{} in {} is used", first_by_name->place,
        Shortened(first_by_name->file),
        by_name > 1 ? fmt::format(", nor do the paths of {} more rows", by_name - 1) : "",
        HasOtherCapitals(NameIn(first_by_name->file), first_image) ? " with other capitals" : "",
        folder.empty() ? "." : folder));
  }
  if (!of_other_kind.empty() && notices != nullptr) {
    notices->push_back(fmt::format(
        "{}{}: not used, because the table names the same photograph with another ending",
        of_other_kind.front(),
        of_other_kind.size() > 1 ? fmt::format(" and {} more", of_other_kind.size() - 1) : ""));
  }
  return frames;
}

std::vector<std::string> ImagesOfRows(const ReadingSet& readings,
                                      const std::vector<std::string>& files,
                                      const std::string& folder) {
  Images images(files, folder);
  std::set<std::string> known;
  for (const std::string& file : files) known.insert(fs::path(file).lexically_normal().string());
  std::vector<std::string> found;
  for (const FileReading& row : readings.rows) {
    bool is_by_name = false;
    std::string path;
    try {
      path = images.Find(row, readings.folder, &is_by_name);
    } catch (const Error&) {
      path.clear();  // it names no image of these
    }
    found.push_back(known.count(path) > 0 ? path : "");
  }
  return found;
}

std::map<int, const FileReading*> RowsOfFrames(const ReadingSet& readings, const std::string& path,
                                               int frames, std::vector<std::string>* notices) {
  const std::string name = fs::path(path).filename().string();
  std::vector<RowPage> places;
  bool has_zero = false, has_index = false;
  int highest = 0;
  for (const FileReading& row : readings.rows) {
    const auto place = FindPageOfRow(row, name);
    if (!place) {
      throw Error(fmt::format(
          "{}{} has {} frames, and '{}' is none of them: the number of a frame is expected, or "
          "'{}[12]', which counts from 0; a column of times is named by --time-column",
          row.place, name, frames, Shortened(row.file), name));
    }
    places.push_back(*place);
    has_zero = has_zero || place->number == 0;
    has_index = has_index || place->is_index;
    highest = std::max(highest, place->number);
  }
  const bool counts_from_one = !has_zero && !has_index && highest == frames;
  if (!counts_from_one && !has_zero && !has_index && notices != nullptr) {
    notices->push_back(fmt::format(
        "{}: the numbers of frames are taken to count from 0, as no row has 0 or {}, the number of "
        "all frames",
        readings.source, frames));
  }
  std::map<int, const FileReading*> row_of;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const FileReading& row = readings.rows[i];
    const int number = places[i].number - (counts_from_one ? 1 : 0);
    if (number >= frames) {
      throw Error(fmt::format("{}'{}' is not a frame of {}, which has {}, counted from 0",
                              row.place, Shortened(row.file), name, frames));
    }
    const auto [known, added] = row_of.emplace(number, &row);
    if (!added) {
      throw Error(fmt::format("{}the frame '{}' already has a reading, at {}", row.place,
                              Shortened(row.file),
                              known->second->place.substr(0, known->second->place.size() - 2)));
    }
  }
  return row_of;
}

std::vector<SweepFrame> PairPages(const ReadingSet& readings, const std::string& path, int pages) {
  const std::string name = fs::path(path).filename().string();
  std::vector<RowPage> places;
  bool counts_from_one = true;
  for (const FileReading& row : readings.rows) {
    places.push_back(PageOfRow(row, name, pages));
    counts_from_one = counts_from_one && !places.back().is_index && places.back().number > 0;
  }
  std::vector<SweepFrame> frames;
  std::map<int, const FileReading*> row_of;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const FileReading& row = readings.rows[i];
    const int page = places[i].number - (counts_from_one ? 1 : 0);
    if (page >= pages) {
      throw Error(fmt::format("{}'{}' is not a page of {}, which has {}", row.place,
                              Shortened(row.file), name, pages));
    }
    const auto [known, added] = row_of.emplace(page, &row);
    if (!added) {
      throw Error(fmt::format("{}the page '{}' already has a reading, at {}", row.place,
                              Shortened(row.file),
                              known->second->place.substr(0, known->second->place.size() - 2)));
    }
    frames.push_back({path, row.reading_mm, page});
  }
  for (int page = 0; page < pages; ++page) {
    if (row_of.count(page) > 0) continue;
    throw Error(
        fmt::format("{}: page {} (counted from 0) has no row in {}; it has {} pages, and {} "
                    "rows are there",
                    path, page, readings.source, pages, readings.rows.size()));
  }
  return frames;
}

}  // namespace thicklens::model
