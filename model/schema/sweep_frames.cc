#include "model/schema/sweep_frames.h"

#include <fmt/format.h>
#include <glob.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <map>
#include <set>
#include <system_error>

#include "model/schema/frame_pairing.h"
#include "model/schema/sweep_video.h"
#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "thicklens/model/readings.h"

namespace thicklens::model {
namespace {

namespace fs = std::filesystem;

// Whether the name begins with a dot: incomplete outputs, and the companion files that some systems
// create for every file ("._frame.png").
bool IsHidden(const fs::path& file) { return file.filename().string().rfind('.', 0) == 0; }

// The folder of the YAML file may have any name. Only the text in the file is a pattern.
std::string EscapedForGlob(const std::string& folder) {
  std::string escaped;
  for (const char c : folder) {
    if (c == '*' || c == '?' || c == '[' || c == '\\') escaped += '\\';
    escaped += c;
  }
  return escaped;
}

std::vector<std::string> FilesMatching(const std::string& folder, const std::string& text) {
  const std::string pattern = (fs::path(EscapedForGlob(folder)) / text).string();
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
    if (entry.is_regular_file(failure) && IsNameOfImage(entry.path().string()))
      here.push_back(entry.path().string());
    if (!entry.is_directory(failure)) continue;
    for (const auto& inner : fs::directory_iterator(entry.path(), failure)) {
      if (!IsHidden(inner.path()) && inner.is_regular_file(failure) &&
          IsNameOfImage(inner.path().string()))
        below.push_back(inner.path().string());
    }
  }
  std::vector<std::string>& files = here.empty() ? below : here;
  std::sort(files.begin(), files.end());
  return files;
}

// The files of `frames_glob`, which is relative to `folder`. Older sweeps wrote it relative to the
// sweep's file.
std::vector<std::string> FilesOfGlob(const YamlNode& pattern, const std::string& folder,
                                     std::vector<std::string>* notices) {
  std::vector<std::string> files = FilesMatching(folder, pattern.Text());
  const std::string home = fs::path(pattern.source()).parent_path().string();
  if (files.empty() && home != folder) {
    files = FilesMatching(home, pattern.Text());
    if (!files.empty() && notices != nullptr) {
      notices->push_back(fmt::format(
          "frames_glob: nothing in {} matches '{}'; the files beside the sweep file that match are "
          "used",
          folder.empty() ? "." : folder, pattern.Text()));
    }
  }
  if (files.empty()) throw pattern.ErrorHere(fmt::format("no file matches '{}'", pattern.Text()));
  return files;
}

constexpr int kMaxPage = 999'999;

// A value of the command line replaces that of the file.
void Replace(const std::string& stated, std::string* value) {
  if (!stated.empty()) *value = stated;
}

constexpr std::array<const char*, 9> kReadingKeys = {
    "readings_unit",      "readings_column",      "readings_file_column",
    "readings_scale_mm",  "readings_decimal",     "readings_from",
    "readings_from_name", "readings_time_column", "readings_time_unit"};

ReadingOptions OptionsOf(const YamlNode& root, const ReadingOptions& replacements) {
  ReadingOptions options;
  if (const auto unit = root.Find("readings_unit"))
    options.unit = unit->OneOf({"mm", "um", "nm", "cm", "m", "in", "dpt", "steps", "counts"});
  if (const auto column = root.Find("readings_column")) options.column = column->Text();
  if (const auto column = root.Find("readings_file_column")) options.file_column = column->Text();
  if (const auto scale = root.Find("readings_scale_mm")) options.scale_mm = scale->Number();
  if (const auto decimal = root.Find("readings_decimal"))
    options.decimal = decimal->OneOf({"comma", "point"});
  if (const auto source = root.Find("readings_from"))
    options.source = source->OneOf({"exif", "sidecar", "ome"});
  if (const auto pattern = root.Find("readings_from_name")) options.name_pattern = pattern->Text();
  if (const auto column = root.Find("readings_time_column")) options.time_column = column->Text();
  if (const auto unit = root.Find("readings_time_unit"))
    options.time_unit = unit->OneOf({"s", "ms", "us", "ns", "min", "h"});
  std::string why;
  if (!options.IsValid(&why)) throw root.ErrorHere("readings: " + why);
  if (replacements.IsWithoutTable()) {
    options.source = replacements.source;
    options.name_pattern = replacements.name_pattern;
  }
  if (!replacements.unit.empty()) options.scale_mm.reset();
  Replace(replacements.unit, &options.unit);
  Replace(replacements.column, &options.column);
  Replace(replacements.file_column, &options.file_column);
  Replace(replacements.decimal, &options.decimal);
  Replace(replacements.time_column, &options.time_column);
  Replace(replacements.time_unit, &options.time_unit);
  if (replacements.scale_mm) options.scale_mm = replacements.scale_mm;
  return options;
}

// The frames of a video are neither images of a folder nor a list.
void RequireNoImages(const YamlNode& root) {
  for (const char* key :
       {"frames", "frames_dir", "frames_glob", "readings_from", "readings_from_name"}) {
    if (const auto extra = root.Find(key)) {
      throw extra->ErrorHere(
          "this key is for images, and 'video' states the frames; one of them is expected");
    }
  }
}

// Only the frames of a video have times.
void RequireNoTimes(const YamlNode& root) {
  for (const char* key : {"readings_time_column", "readings_time_unit"}) {
    if (const auto extra = root.Find(key))
      throw extra->ErrorHere("this key applies only to a 'video'");
  }
}

// A camera may save each photograph as raw and as JPEG. Without a table, nothing says which is
// meant.
void RequireOneKind(const std::vector<std::string>& files) {
  std::map<std::string, std::string> file_of;
  for (const std::string& file : files) {
    const auto [known, added] = file_of.emplace(fs::path(file).replace_extension().string(), file);
    if (added) continue;
    const std::string ending = fs::path(file).extension().string();
    throw Error(fmt::format(
        "{} and {}: one photograph in two files; choose one kind by frames_glob ('*{}') in a sweep "
        "file, or move the others elsewhere",
        known->second, file, ending));
  }
}

void TakeReadings(const SweepReading& reading, const std::string& table,
                  const ReadingOptions& options, const std::vector<std::string>& files,
                  const std::string& folder, SweepFile* sweep, std::vector<std::string>* notices) {
  if (table.empty()) RequireOneKind(files);
  const ReadingReader reader = reading.reader ? reading.reader : ReadTextReadings;
  const ReadingSet readings = reader(table, files, options);
  if (notices != nullptr)
    notices->insert(notices->end(), readings.notices.begin(), readings.notices.end());
  sweep->readings = readings.description;
  sweep->readings_are_focus_distances = readings.in_dioptres;
  sweep->readings_are_counts = readings.in_counts;
  sweep->frames = PairFrames(readings, files, folder, notices);
  if (!table.empty()) return;
  // The order of names ("z10", "z9") means nothing.
  std::stable_sort(
      sweep->frames.begin(), sweep->frames.end(),
      [](const SweepFrame& a, const SweepFrame& b) { return a.reading_mm < b.reading_mm; });
}

// The readings are in the list itself: nothing that says how to read them applies.
void RequireNoOptions(const YamlNode& root, const ReadingOptions& replacements) {
  for (const char* key : kReadingKeys) {
    const auto node = root.Find(key);
    if (!node || (std::string(key) == "readings_unit" && node->Text() == "mm")) continue;
    throw node->ErrorHere(
        "'frames' states reading_mm; this key applies only to 'frames_csv' and to "
        "readings of the files");
  }
  const bool is_any = replacements.IsWithoutTable() || !replacements.column.empty() ||
                      !replacements.file_column.empty() || !replacements.unit.empty() ||
                      !replacements.time_column.empty() || !replacements.time_unit.empty() ||
                      replacements.scale_mm || !replacements.decimal.empty();
  if (is_any) {
    throw root.At("frames").ErrorHere(
        "the list states reading_mm for each image; --column, --file-column, --unit, "
        "--reading-scale, --decimal, --reading-from and --reading-from-name do not apply");
  }
}

void ReadListedFrames(const YamlNode& root, SweepFile* sweep) {
  std::set<std::string> images;
  for (const YamlNode& node : root.At("frames").Elements()) {
    node.RequireKeys({"image", "page", "reading_mm"});
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
    SweepFrame frame{path, node.At("reading_mm").Number()};
    if (const auto page = node.Find("page")) frame.page = page->Integer(0, kMaxPage);
    if (!images.insert(frame.Name()).second) {
      throw image.ErrorHere(
          fmt::format("'{}'{} is listed twice", image.Text(),
                      frame.page ? fmt::format(", page {}", *frame.page) : std::string()));
    }
    sweep->frames.push_back(std::move(frame));
  }
  if (sweep->frames.empty()) throw root.At("frames").ErrorHere("at least one frame is expected");
}

}  // namespace

bool IsNameOfImage(const std::string& path) {
  static const std::set<std::string> kEndings = {
      ".png", ".jpg", ".jpeg", ".tif",  ".tiff", ".bmp",  ".pgm", ".ppm", ".pnm",
      ".dng", ".nef", ".cr2",  ".cr3",  ".arw",  ".raf",  ".rw2", ".orf", ".pef",
      ".srw", ".nrw", ".webp", ".heic", ".heif", ".avif", ".dcm"};
  std::string ending = fs::path(path).extension().string();
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return kEndings.count(ending) > 0;
}

void ReadSweepFrames(const YamlNode& root, const SweepReading& reading, SweepFile* sweep,
                     std::vector<std::string>* notices) {
  if (const auto video = root.Find("video")) {
    RequireNoImages(root);
    ReadSweepVideo(root, *video, OptionsOf(root, reading.readings), reading, sweep, notices);
    return;
  }
  const bool is_from_files = root.Has("readings_from") || root.Has("readings_from_name");
  if (root.Has("frames") + (root.Has("frames_csv") || is_from_files) != 1 ||
      (root.Has("frames_csv") && is_from_files)) {
    throw root.ErrorHere(
        "either 'frames' (a list of image and reading_mm), 'frames_csv' (a table), 'video', or "
        "'readings_from' or 'readings_from_name' (the files themselves) is expected");
  }
  if (root.Has("frames")) {
    for (const char* key : {"frames_dir", "frames_glob"}) {
      if (const auto extra = root.Find(key))
        throw extra->ErrorHere(
            "this key applies only to 'frames_csv'; the paths in 'frames' are complete");
    }
    RequireNoOptions(root, reading.readings);
    ReadListedFrames(root, sweep);
    return;
  }
  RequireNoTimes(root);
  const ReadingOptions options = OptionsOf(root, reading.readings);
  std::string table;
  std::string folder = fs::path(root.source()).parent_path().string();
  if (const auto csv = root.Find("frames_csv"); csv && !options.IsWithoutTable()) {
    table = csv->ResolvePath(csv->Text());
    folder = fs::path(table).parent_path().string();
  }
  if (const auto dir = root.Find("frames_dir")) folder = dir->ResolvePath(dir->Text());
  const auto pattern = root.Find("frames_glob");
  const std::vector<std::string> files =
      pattern ? FilesOfGlob(*pattern, folder, notices) : ImagesIn(folder.empty() ? "." : folder);
  TakeReadings(reading, table, options, files, folder, sweep, notices);
}

void ReadFramesOfFolder(const std::string& folder, const std::string& table,
                        const SweepReading& reading, SweepFile* sweep,
                        std::vector<std::string>* notices) {
  TakeReadings(reading, table, reading.readings, ImagesIn(folder), folder, sweep, notices);
}

std::vector<std::string> ImagesOfFolder(const std::string& folder) { return ImagesIn(folder); }

}  // namespace thicklens::model
