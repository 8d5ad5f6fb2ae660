#include "model/tables/reading_columns.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "model/tables/column_names.h"
#include "model/tables/reading_number.h"
#include "model/tables/reading_unit.h"
#include "model/tables/table_text.h"
#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

std::string Quoted(const std::string& text) { return "'" + Shown(text) + "'"; }

class Finder {
 public:
  Finder(const TableCells& table, const std::string& path, const ReadingOptions& options)
      : table_(table), path_(path), options_(options) {}

  // The columns that may have the times or the numbers of the frames of a video.
  VideoColumns FindForVideo(ReadingColumns* columns) {
    FindHeader();
    CountCells();
    VideoColumns found;
    found.has_header = HasHeader();
    for (std::size_t column = 0; column < found_.width; ++column) {
      if (HasHeader() ? IsTime(column) : IsContentOfTimes(column)) found.times.push_back(column);
      const auto words = NameOf(CellOf(column)).words;
      const bool is_page = std::find(words.begin(), words.end(), "page") != words.end();
      if (HasHeader() && (HasWord(words, FileWords()) || is_page)) found.files.push_back(column);
    }
    // Without names, only the first column can be distinguished from the readings.
    if (!HasHeader() && !found.times.empty() && found.times.front() != 0) found.times.clear();
    if (!HasHeader() && found.times.size() > 1) found.times.resize(1);
    *columns = found_;
    return found;
  }

  ReadingColumns Find() {
    FindHeader();
    CountCells();
    found_.file = FindFile();
    found_.reading = FindReading();
    if (!found_.header.cells.empty()) found_.unit = NameOf(CellOf(found_.reading)).unit;
    if (found_.unit.empty() && IsLensPosition()) found_.unit = kDioptres;
    found_.unit_column = FindUnitColumn();
    RefuseDoubtfulUnits();
    return found_;
  }

 private:
  // Whether the readings are the LensPosition of libcamera, which is in dioptres. Other programs
  // call the counts of a motor so, which are larger: a lens focuses on nothing nearer than 20 mm.
  bool IsLensPosition() const {
    constexpr double kMaxDioptres = 50;
    if (LowerCase(Trimmed(CellOf(found_.reading))) != "lensposition") return false;
    bool has_fraction = false;
    for (const TableRow& row : table_.rows) {
      if (row.line <= found_.header.line || found_.reading >= row.cells.size()) continue;
      const auto value = ToNumber(row.cells[found_.reading], '.');
      if (!value || !(*value >= 0 && *value <= kMaxDioptres)) return false;
      has_fraction = has_fraction || *value != std::floor(*value);
    }
    return has_fraction;
  }

  bool HasHeader() const { return !found_.header.cells.empty(); }
  const std::string& CellOf(std::size_t column) const {
    static const std::string none;
    return column < found_.header.cells.size() ? found_.header.cells[column] : none;
  }
  std::string Place() const {
    const std::size_t line = HasHeader() ? found_.header.line : table_.rows.front().line;
    return fmt::format("{}:{}: ", path_, line);
  }

  static bool HasFile(const TableRow& row) {
    return std::any_of(row.cells.begin(), row.cells.end(), LooksLikeFile);
  }
  static bool HasNumber(const TableRow& row) {
    return std::any_of(row.cells.begin(), row.cells.end(), LooksLikeNumber);
  }

  // Index of the header or, without one, of the first row with data. Programs of instruments write
  // lines about the recording before it. They name no file, and the table itself begins with the
  // row before the first one that has a file and a number.
  std::size_t FindBeginning() const {
    constexpr std::size_t kMaxPreamble = 200;
    for (std::size_t i = 0; i < std::min(table_.rows.size(), kMaxPreamble); ++i) {
      if (!HasFile(table_.rows[i])) continue;
      if (i == 0 || !HasNumber(table_.rows[i])) return 0;
      const TableRow& before = table_.rows[i - 1];
      // Rows with more cells than the only row before them are reported one by one.
      const bool is_as_wide =
          i == 1 ? before.cells.size() > 1 : before.cells.size() == table_.rows[i].cells.size();
      const bool is_header = is_as_wide && !HasNumber(before);
      return is_header ? i - 1 : i;
    }
    return 0;
  }

  // The first row is a header if it has neither a number nor the name of a file.
  void FindHeader() {
    const bool is_first = NamesCell(table_.rows.front(), options_.column) ||
                          NamesCell(table_.rows.front(), options_.file_column) ||
                          NamesCell(table_.rows.front(), options_.time_column);
    const std::size_t beginning = is_first ? 0 : FindBeginning();
    found_.first_row = beginning;
    if (beginning > 0) found_.last_skipped_line = table_.rows[beginning - 1].line;
    const TableRow& first = table_.rows[beginning];
    const bool is_asked_for = NamesCell(first, options_.column) ||
                              NamesCell(first, options_.file_column) ||
                              NamesCell(first, options_.time_column);
    const bool has_data = HasNumber(first) || HasFile(first);
    const auto& comment = table_.comment.cells;
    if (is_asked_for || !has_data) {
      found_.header = first;
      found_.first_row = beginning + 1;
    } else if (comment.size() == first.cells.size() &&
               std::none_of(comment.begin(), comment.end(), LooksLikeNumber)) {
      found_.header = table_.comment;
    }
    found_.width = HasHeader() ? found_.header.cells.size() : first.cells.size();
  }

  static bool NamesCell(const TableRow& row, const std::string& name) {
    return !name.empty() && std::find(row.cells.begin(), row.cells.end(), name) != row.cells.end();
  }

  void CountCells() {
    numbers_.assign(found_.width, 0);
    files_ = texts_ = numbers_;
    for (std::size_t i = found_.first_row; i < table_.rows.size(); ++i) {
      const auto& cells = table_.rows[i].cells;
      for (std::size_t k = 0; k < std::min(cells.size(), found_.width); ++k) {
        if (LooksLikeNumber(cells[k])) {
          ++numbers_[k];
        } else if (!cells[k].empty()) {
          ++texts_[k];
          files_[k] += LooksLikeFile(cells[k]);
        }
      }
    }
  }

  // A few wrong cells do not change what a column is.
  bool IsMost(std::size_t count) const {
    return count > 0 && 2 * count >= table_.rows.size() - found_.first_row;
  }

  std::vector<std::size_t> Select(const std::vector<std::size_t>& among,
                                  const std::function<bool(std::size_t)>& is_meant) const {
    std::vector<std::size_t> selected;
    std::copy_if(among.begin(), among.end(), std::back_inserter(selected), is_meant);
    return selected;
  }
  std::vector<std::size_t> All() const {
    std::vector<std::size_t> all(found_.width);
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
    return all;
  }

  std::string List(const std::vector<std::size_t>& columns) const {
    constexpr std::size_t kMost = 6;
    std::string text;
    for (std::size_t i = 0; i < std::min(columns.size(), kMost); ++i) {
      text += (i == 0 ? "" : ", ") + ColumnText(found_, columns[i]);
    }
    if (columns.size() > kMost) text += fmt::format(" and {} more", columns.size() - kMost);
    return text;
  }

  // The column that an option names.
  std::size_t Named(const std::string& name, const char* option) const {
    const auto matches = [&](const std::function<bool(const std::string&)>& is_same) {
      return Select(All(), [&](std::size_t column) { return is_same(CellOf(column)); });
    };
    std::vector<std::size_t> found;
    if (HasHeader()) {
      found = matches([&](const std::string& cell) { return cell == name; });
      if (found.empty()) {
        found = matches([&](const std::string& cell) {
          return LowerCase(Trimmed(cell)) == LowerCase(Trimmed(name));
        });
      }
      if (found.empty()) {
        const auto words = WordsOf(name);
        found = matches([&](const std::string& cell) {
          return !words.empty() && (NameOf(cell).words == words || WordsOf(cell) == words);
        });
      }
    }
    if (found.empty()) {
      std::size_t number = 0;
      const auto [rest, status] = std::from_chars(name.data(), name.data() + name.size(), number);
      const bool is_number = status == std::errc() && rest == name.data() + name.size();
      if (is_number && number >= 1 && number <= found_.width) return number - 1;
      throw Error(fmt::format("{}{}: the table has no column {}; it has {}", Place(), option,
                              Quoted(name), List(All())));
    }
    if (found.size() > 1) {
      throw Error(fmt::format("{}{}: {} may be {}; give its number", Place(), option, Quoted(name),
                              List(found)));
    }
    return found.front();
  }

  bool IsTime(std::size_t column) const {
    const ColumnName name = NameOf(CellOf(column));
    if (std::find(name.words.begin(), name.words.end(), "exposure") != name.words.end())
      return false;
    // A column of positions may have a name such as "focus_time_avg", but hardly a unit of time.
    if (HasWord(name.words, ReadingWords())) return false;
    return HasWord(name.words, TimeWords()) ||
           (name.words.empty() && IsUnitOfTime(LowerCase(name.unit)));
  }

  // Whether the cells are "00:01:02" or numbers that are not whole.
  bool IsContentOfTimes(std::size_t column) const {
    bool has_fraction = false;
    for (std::size_t i = found_.first_row; i < table_.rows.size(); ++i) {
      const auto& cells = table_.rows[i].cells;
      if (column >= cells.size()) continue;
      const std::string& cell = cells[column];
      if (cell.find(':') != std::string::npos) return true;
      if (LooksLikeNumber(cell) && cell.find_first_of(".,") != std::string::npos)
        has_fraction = true;
    }
    return has_fraction;
  }

  std::size_t FindFile() const {
    if (!options_.time_column.empty()) return Named(options_.time_column, "--time-column");
    if (!options_.file_column.empty()) return Named(options_.file_column, "--file-column");
    const auto has_file_name = [&](std::size_t column) {
      return HasWord(NameOf(CellOf(column)).words, FileWords());
    };
    const auto files = Select(All(), [&](std::size_t column) { return IsMost(files_[column]); });
    if (files.size() == 1) return files.front();
    if (files.size() > 1) {
      const auto named = Select(files, has_file_name);
      if (named.size() == 1) return named.front();
      throw Error(fmt::format("{}several columns name files: {}; --file-column selects one",
                              Place(), List(named.empty() ? files : named)));
    }
    const auto texts = Select(
        All(), [&](std::size_t column) { return IsMost(texts_[column]) && !IsUnits(column); });
    auto named = Select(texts, has_file_name);
    if (named.size() == 1) return named.front();
    if (texts.size() == 1 && named.empty()) return texts.front();
    // Names without an ending may be numbers.
    named = Select(All(), has_file_name);
    if (named.size() == 1) return named.front();
    if (found_.width <= 2) return 0;
    throw Error(fmt::format(
        "{}no column names the files of the images; the table has {}; {}", Place(), List(All()),
        texts.empty()
            ? "a column with their names is needed (a table by time, or by the numbers of "
              "frames, is for a video)"
            : "--file-column selects one of them"));
  }

  // How likely the column is the reading: 0 the least likely.
  int RankOf(std::size_t column) const {
    const ColumnName name = NameOf(CellOf(column));
    if (name.known && name.known->kind == ReadingUnit::Kind::kOther) return 0;
    if (HasWord(name.words, OtherWords())) {
      // "x, y, z" in one name, as in "stage_z_x", is not meant by any known program.
      return 0;
    }
    if (HasWord(name.words, ReadingWords())) return 3;
    return name.known ? 2 : 1;
  }

  std::size_t FindReading() const {
    if (!options_.column.empty()) return RequireOther(Named(options_.column, "--column"));
    const auto others = Select(All(), [&](std::size_t column) { return column != found_.file; });
    const auto numbers =
        Select(others, [&](std::size_t column) { return IsMost(numbers_[column]); });
    std::vector<std::size_t> candidates;
    int best = 0;
    for (const std::size_t column : numbers) {
      const int rank = HasHeader() ? RankOf(column) : 1;
      if (rank > best) candidates.clear();
      if (rank > 0 && rank >= best) candidates.push_back(column);
      best = std::max(best, rank);
    }
    if (candidates.size() == 1) {
      if (IsCount(candidates.front())) RefuseCount(candidates.front(), numbers);
      return candidates.front();
    }
    if (candidates.size() > 1) RefuseSeveral(candidates);
    if (!numbers.empty()) {
      throw Error(fmt::format(
          "{}no column is named as a position or has a unit of length; the numbers are in {}; "
          "--column selects one, and --unit states its unit",
          Place(), List(numbers)));
    }
    // No column of numbers: the message about the first wrong cell says more.
    const auto named = Select(others, [&](std::size_t column) { return RankOf(column) == 3; });
    if (named.size() == 1) return named.front();
    if (found_.width <= 2) return others.empty() ? 1 : others.front();
    throw Error(fmt::format("{}no column has numbers in most rows; the table has {}", Place(),
                            List(All())));
  }

  // Whether a column only counts the rows: by its name, and by whole numbers one after the other.
  bool IsCount(std::size_t column) const {
    static const Words counts = {"frame",  "frames", "slice",  "slices", "index", "idx",  "id",
                                 "row",    "rows",   "line",   "n",      "i",     "no",   "nr",
                                 "number", "num",    "nummer", "image",  "img",   "bild", "page",
                                 "shot",   "photo",  "sample", "record", "count"};
    if (!HasHeader() || !options_.unit.empty() || options_.scale_mm) return false;
    const ColumnName name = NameOf(CellOf(column));
    const bool is_of_pandas = !name.words.empty() && name.words.front() == "unnamed";
    const bool may_count =
        name.words.empty() || is_of_pandas || counts.count(name.words.back()) > 0;
    if (!name.unit.empty() || !may_count) return false;
    std::optional<double> before;
    for (std::size_t i = found_.first_row; i < table_.rows.size(); ++i) {
      const auto& cells = table_.rows[i].cells;
      if (column >= cells.size() || cells[column].empty()) continue;
      const auto value = ToNumber(Trimmed(cells[column]), '.');
      if (!value || (before && *value != *before + 1)) return false;
      // Without a name, readings in steps of 1 mm are as likely.
      if (!before && Trimmed(CellOf(column)).empty() && *value != 0 && *value != 1) return false;
      before = value;
    }
    return before && *before == std::floor(*before);
  }

  [[noreturn]] void RefuseCount(std::size_t column, const std::vector<std::size_t>& numbers) const {
    throw Error(fmt::format(
        "{}{} only counts the rows, and no other column is named as a position or has a unit of "
        "length; the numbers are in {}; --column selects the readings by name or number, and "
        "--unit states their unit",
        Place(), ColumnText(found_, column), List(numbers)));
  }

  // The column that states the unit of the readings in each row. One that is named so belongs to
  // the column that it also names ("z unit"), or to the numbers before it.
  std::optional<std::size_t> FindUnitColumn() const {
    std::optional<std::size_t> found;
    for (std::size_t column = 0; column < found_.width; ++column) {
      if (column == found_.file || column == found_.reading || !IsUnits(column)) continue;
      if (OwnerOf(column) != found_.reading) continue;
      if (found) {
        throw Error(fmt::format("{}{} and {} may be the unit of {}; state it by --unit", Place(),
                                ColumnText(found_, *found), ColumnText(found_, column),
                                ColumnText(found_, found_.reading)));
      }
      found = column;
    }
    return options_.unit.empty() ? found : std::nullopt;
  }

  static bool IsUnitWord(const std::string& word) {
    static const Words words = {
        "unit",     "units",    "einheit", "einheiten", "unité",   "unite", "unités",
        "unidad",   "unidades", "unidade", "unità",     "eenheid", "enhet", "jednostka",
        "jednotka", "единица",  "единицы", "单位",      "單位",    "単位",  "단위"};
    return words.count(word) > 0;
  }

  // Whether the cells are units: by the name of the column or, without a header, by all of them.
  bool IsUnits(std::size_t column) const {
    const std::vector<std::string> words = WordsOf(CellOf(column));
    if (std::any_of(words.begin(), words.end(), IsUnitWord)) {
      return IsMost(texts_[column]) && (HasOnlyUnits(column) || MayBeUnits(column, words));
    }
    if (HasHeader() && !words.empty()) return false;
    return HasOnlyUnits(column);
  }

  // A "unit" may be a device, too: "lens unit", or "cam A" before the readings.
  bool MayBeUnits(std::size_t column, std::vector<std::string> words) const {
    words.erase(std::remove_if(words.begin(), words.end(), IsUnitWord), words.end());
    const auto all = All();
    const bool names_column = std::any_of(all.begin(), all.end(), [&](std::size_t other) {
      return other != column && !words.empty() && NameOf(CellOf(other)).words == words;
    });
    if (names_column) return true;
    if (!words.empty() && !HasWord(words, ReadingWords())) return false;
    const bool is_behind_numbers = words.empty() && column > 0 && IsMost(numbers_[column - 1]) &&
                                   !HasWord(WordsOf(CellOf(column - 1)), FileWords());
    if (is_behind_numbers) return true;
    for (std::size_t i = found_.first_row; i < table_.rows.size(); ++i) {
      const auto& cells = table_.rows[i].cells;
      if (column >= cells.size()) continue;
      const auto unit = FindUnit(cells[column]);
      const bool is_letter = cells[column].size() == 1;  // "A", "C", and "V" name devices
      if (HasLength(unit) || (unit && !is_letter) || IsUnreadUnit(LowerCase(cells[column])))
        return true;
    }
    return false;
  }

  bool HasOnlyUnits(std::size_t column) const {
    if (!IsMost(texts_[column]) || numbers_[column] > 0) return false;
    for (std::size_t i = found_.first_row; i < table_.rows.size(); ++i) {
      const auto& cells = table_.rows[i].cells;
      if (column >= cells.size() || cells[column].empty()) continue;
      const auto unit = FindUnit(cells[column]);
      if (!unit || unit->kind == ReadingUnit::Kind::kOther) return false;
    }
    return true;
  }

  // A column of another name with nothing but units may be theirs, or may mean anything ("in").
  void RefuseDoubtfulUnits() const {
    if (!options_.unit.empty() || !found_.unit.empty() || found_.unit_column) return;
    for (std::size_t column = 0; column < found_.width; ++column) {
      if (column == found_.file || column == found_.reading || !HasOnlyUnits(column)) continue;
      if (OwnerOf(column) != found_.reading) continue;
      throw Error(
          fmt::format("{}{} has nothing but units, and {} states none: name that column 'unit' if "
                      "it is theirs, "
                      "or state the unit of the readings by --unit",
                      Place(), ColumnText(found_, column), ColumnText(found_, found_.reading)));
    }
  }

  std::size_t OwnerOf(std::size_t column) const {
    std::vector<std::string> words = WordsOf(CellOf(column));
    words.erase(std::remove_if(words.begin(), words.end(), IsUnitWord), words.end());
    for (std::size_t other = 0; other < found_.width && !words.empty(); ++other) {
      if (other != column && NameOf(CellOf(other)).words == words) return other;
    }
    for (std::size_t other = column; other-- > 0;) {
      const bool is_name = other == found_.file && options_.time_column.empty();
      if (IsMost(numbers_[other]) && !is_name) return other;
    }
    for (std::size_t other = column + 1; other < found_.width; ++other) {
      if (IsMost(numbers_[other]) && other != found_.file) return other;
    }
    return column;
  }

  std::size_t RequireOther(std::size_t column) const {
    if (column == found_.file && found_.width > 1) {
      throw Error(fmt::format("{}--column: {} has the {}; name the column of the readings", Place(),
                              ColumnText(found_, column),
                              options_.time_column.empty() ? "files" : "times"));
    }
    return column;
  }

  [[noreturn]] void RefuseSeveral(const std::vector<std::size_t>& candidates) const {
    std::string comma;
    const bool may_be_comma = table_.separator == ',' && candidates.size() == 2 &&
                              candidates[1] == candidates[0] + 1 && AreDigits(candidates[1]);
    if (may_be_comma && !HasHeader()) {
      comma = fmt::format(
          " (or one number with a decimal comma, which a table with commas must have in quotation "
          "marks)");
    }
    throw Error(fmt::format("{}which column is the reading, {}{}? --column selects it by its {}",
                            Place(), List(candidates), comma,
                            HasHeader() ? "name or number" : "number"));
  }

  bool AreDigits(std::size_t column) const {
    return std::all_of(table_.rows.begin() + static_cast<std::ptrdiff_t>(found_.first_row),
                       table_.rows.end(), [&](const TableRow& row) {
                         if (column >= row.cells.size()) return true;
                         const std::string& cell = row.cells[column];
                         return std::all_of(cell.begin(), cell.end(), [](char c) {
                           return std::isdigit(static_cast<unsigned char>(c)) != 0;
                         });
                       });
  }

  const TableCells& table_;
  const std::string& path_;
  const ReadingOptions& options_;
  ReadingColumns found_;
  std::vector<std::size_t> numbers_, files_, texts_;  // how many cells of each column are such
};

}  // namespace

std::string ColumnText(const ReadingColumns& columns, std::size_t column) {
  const std::string number = fmt::format("column {}", column + 1);
  if (column >= columns.header.cells.size() || columns.header.cells[column].empty()) return number;
  return number + " " + Quoted(columns.header.cells[column]);
}

VideoColumns FindVideoColumns(const TableCells& table, const std::string& path,
                              const ReadingOptions& options, ReadingColumns* columns) {
  return Finder(table, path, options).FindForVideo(columns);
}

ReadingColumns FindColumns(const TableCells& table, const std::string& path,
                           const ReadingOptions& options) {
  return Finder(table, path, options).Find();
}

}  // namespace thicklens::model
