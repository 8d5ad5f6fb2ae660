#include "thicklens/io/readings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>

#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "tools/io/tables/reading_sources.h"

namespace thicklens::io {
namespace {

// The first character that is neither a byte order mark nor white space.
char FirstCharacter(const std::string& text) {
  const std::size_t begin = text.compare(0, 3, "\xEF\xBB\xBF") == 0 ? 3 : 0;
  const std::size_t at = text.find_first_not_of(" \t\r\n", begin);
  return at == std::string::npos ? '\0' : text[at];
}

}  // namespace

void FinishMetadata(const std::string& what, const std::string& stated_unit, bool is_focus_distance,
                    const model::ReadingOptions& options, model::ReadingSet* set) {
  const auto is_first = [set](const model::FileReading& row) {
    return row.reading_mm == set->rows.front().reading_mm;
  };
  if (set->rows.size() > 1 && std::all_of(set->rows.begin(), set->rows.end(), is_first)) {
    throw Error(
        fmt::format("{}{} is the same in all {} files: it does not say where the target or the "
                    "lens was; give a "
                    "table by --readings, or the numbers in the names by --reading-from-name",
                    set->rows.front().place, what, set->rows.size()));
  }
  const bool is_stated = !stated_unit.empty() || !options.unit.empty() || options.scale_mm;
  set->in_dioptres = model::ReadingUnitName(stated_unit, options) == model::kDioptres;
  set->description =
      fmt::format("{}, {}{}, {} files", what, model::ReadingUnitName(stated_unit, options),
                  is_stated ? "" : " (no unit is stated)", set->rows.size());
  if (is_focus_distance) {
    set->notices.push_back(fmt::format(
        "{} is the distance that the lens was focused at, in steps of its drive, not the position "
        "of the target; the law of a bench holds for a lens that does not move",
        what));
  }
}

model::ReadingSet ReadReadings(const std::string& table, const std::vector<std::string>& files,
                               const model::ReadingOptions& options) {
  if (options.source == "exif") return ReadingsOfExif(files, options);
  if (options.source == "sidecar") return ReadingsOfSidecars(files, options);
  if (options.source == "ome") return ReadingsOfOmeFiles(files, options);
  if (!options.name_pattern.empty()) return model::ReadingsOfNames(files, options);
  const std::string text = ReadTextFile(table);
  const char first = FirstCharacter(text);
  if (first == '{' || first == '[') return ReadingsOfJson(text, table, options);
  if (first == '<') return ReadingsOfOmeCompanion(text, table, options);
  return model::ReadingsOfTable(text, table, options);
}

}  // namespace thicklens::io
