#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <utility>

#include "model/tables/reading_columns.h"
#include "model/tables/reading_number.h"
#include "model/tables/reading_unit.h"
#include "model/tables/table_cells.h"
#include "model/tables/table_text.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "thicklens/model/readings.h"

namespace thicklens::model {
namespace {

namespace fs = std::filesystem;

bool AreDigits(const std::string& text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) {
    return std::isdigit(static_cast<unsigned char>(c)) != 0;
  });
}

// A cell of the column of readings.
struct ReadingCell {
  std::size_t line = 0;
  std::string file, text;
  NumberText number;
};

class Reader {
 public:
  Reader(const std::string& path, const ReadingOptions& options) : path_(path), options_(options) {}

  ReadingSet Read(const std::string& bytes) {
    const TableText text = DecodeTableText(bytes, path_);
    table_ = SplitTable(text.text, path_);
    if (table_.rows.empty()) RefuseEmpty();
    columns_ = FindColumns(table_, path_, options_);
    ReadCells();
    if (cells_.empty()) RefuseEmpty();
    FindMark();
    FindUnitOfCells();
    ReadingSet set;
    set.source = path_;
    set.folder = fs::path(path_).parent_path().string();
    for (const ReadingCell& cell : cells_) set.rows.push_back(RowOf(cell));
    Describe(text.encoding, &set);
    return set;
  }

 private:
  std::string Place(std::size_t line) const { return fmt::format("{}:{}: ", path_, line); }

  [[noreturn]] void RefuseEmpty() const {
    throw Error(
        fmt::format("{}: no row has a file and a reading; at least one is expected", path_));
  }

  void ReadCells() {
    std::map<std::string, std::size_t> line_of;
    for (std::size_t i = columns_.first_row; i < table_.rows.size(); ++i) {
      if (i % 4096 == 0) ThrowIfCancelled();
      const TableRow& row = table_.rows[i];
      RequireWidth(row);
      ReadingCell cell{row.line, row.cells[columns_.file], row.cells[columns_.reading], {}};
      if (cell.file.empty() && cell.text.empty()) continue;  // the end of a sheet
      const auto number = SplitNumber(cell.text);
      if (!number) {
        throw Error(fmt::format("{}the reading of '{}' must be a number, found '{}' in {}",
                                Place(row.line), Shown(cell.file), Shown(cell.text),
                                ColumnText(columns_, columns_.reading)));
      }
      if (cell.file.empty()) throw Error(Place(row.line) + "the name of the file is missing");
      const auto [known, added] = line_of.emplace(cell.file, row.line);
      if (!added) {
        throw Error(fmt::format("{}'{}' already has a reading in line {}", Place(row.line),
                                Shown(cell.file), known->second));
      }
      cell.number = *number;
      TakeUnitOfRow(row, &cell);
      cells_.push_back(std::move(cell));
    }
  }

  // The unit in a column of its own.
  void TakeUnitOfRow(const TableRow& row, ReadingCell* cell) const {
    if (!columns_.unit_column || *columns_.unit_column >= row.cells.size()) return;
    std::string unit = row.cells[*columns_.unit_column];
    unit.erase(0, std::min(unit.find_first_not_of(" \t"), unit.size()));
    unit.erase(unit.find_last_not_of(" \t") + 1);
    if (unit.empty()) return;
    if (!cell->number.unit.empty() && NameOf(cell->number.unit) != NameOf(unit)) {
      throw Error(fmt::format("{}the reading '{}' has {}, but {} states '{}'; state it by --unit",
                              Place(cell->line), Shown(cell->text), UnitText(cell->number.unit),
                              ColumnText(columns_, *columns_.unit_column), Shown(unit)));
    }
    cell->number.unit = unit;
  }

  void RequireWidth(const TableRow& row) const {
    const std::size_t needed = std::max(columns_.file, columns_.reading) + 1;
    if (row.cells.size() < needed) {
      if (needed == 2) {
        throw Error(fmt::format("{}two columns are expected (file, reading), found {}",
                                Place(row.line), row.cells.size()));
      }
      throw Error(fmt::format("{}{} cells, but {} is the reading and {} the file", Place(row.line),
                              row.cells.size(), ColumnText(columns_, columns_.reading),
                              ColumnText(columns_, columns_.file)));
    }
    for (std::size_t i = columns_.width; i < row.cells.size(); ++i) {
      if (LooksLikeNumber(row.cells[i])) RefuseExtraNumber(row, i);
    }
  }

  // A number beyond the last column: a decimal comma divides a number into two cells, but so does a
  // value whose column has no name.
  [[noreturn]] void RefuseExtraNumber(const TableRow& row, std::size_t extra) const {
    const std::string& whole = row.cells[columns_.reading];
    const bool is_next = columns_.reading + 1 < row.cells.size();
    const std::string fraction = is_next ? row.cells[columns_.reading + 1] : "";
    const std::size_t sign = !whole.empty() && (whole[0] == '-' || whole[0] == '+') ? 1 : 0;
    const bool is_comma = table_.separator == ',' && row.cells.size() == columns_.width + 1 &&
                          AreDigits(whole.substr(sign)) && AreDigits(fraction);
    const std::string count = fmt::format("{}{} cells in a table of {} columns", Place(row.line),
                                          row.cells.size(), columns_.width);
    if (is_comma) {
      throw Error(fmt::format(
          "{}: the reading of '{}' looks like {},{} with a decimal comma, which also separates the "
          "cells; write {}.{} or \"{},{}\", or separate the cells by semicolons (if {} is another "
          "value, its column needs a name in the first line)",
          count, Shown(row.cells[columns_.file]), Shown(whole), Shown(fraction), Shown(whole),
          Shown(fraction), Shown(whole), Shown(fraction), Shown(fraction)));
    }
    throw Error(
        fmt::format("{}: '{}' in column {} belongs to no column; name it in the first line, or "
                    "put a cell that contains the separator in quotation marks",
                    count, Shown(row.cells[extra]), extra + 1));
  }

  void FindMark() {
    if (!options_.decimal.empty()) {
      mark_ = options_.decimal == "comma" ? ',' : '.';
      is_comma_seen_ = mark_ == ',';
      return;
    }
    std::vector<std::string> numbers;
    for (const ReadingCell& cell : cells_) numbers.push_back(cell.number.number);
    const DecimalMark found = FindDecimalMark(numbers, table_.separator == ';');
    const auto cell_at = [&](int index) -> const ReadingCell& {
      return cells_[static_cast<std::size_t>(index)];
    };
    if (found.conflict) {
      const ReadingCell& one = cell_at(*found.example);
      const ReadingCell& other = cell_at(*found.conflict);
      throw Error(fmt::format(
          "{}the reading '{}' and '{}' in line {} have different decimal marks; write all with a "
          "point, or state the mark by --decimal",
          Place(other.line), Shown(other.text), Shown(one.text), one.line));
    }
    if (found.is_ambiguous) {
      const ReadingCell& cell = cell_at(*found.example);
      throw Error(fmt::format(
          "{}the comma in the reading '{}' is a decimal mark or groups digits, and no other row "
          "shows which; state it by --decimal comma or --decimal point",
          Place(cell.line), Shown(cell.text)));
    }
    mark_ = found.mark;
    is_comma_seen_ = found.is_seen && found.mark == ',';
  }

  // The unit behind the numbers must be the same in all rows, and that of the header if both exist.
  // "11 1/2", as tapes in inches have it.
  static bool HasFraction(const std::string& text) {
    const std::size_t slash = text.find('/');
    return slash != std::string::npos && slash > 0 && slash + 1 < text.size() &&
           std::isdigit(static_cast<unsigned char>(text[slash - 1])) != 0 &&
           std::isdigit(static_cast<unsigned char>(text[slash + 1])) != 0;
  }

  void FindUnitOfCells() {
    const ReadingCell& first = cells_.front();
    for (const ReadingCell& cell : cells_) {
      if (!cell.number.unit.empty() && !FindUnit(cell.number.unit)) {
        if (HasFraction(cell.text)) {
          throw Error(
              fmt::format("{}the reading of '{}' must be a decimal number, found the fraction '{}' "
                          "in {}; write "
                          "11.5 and not 11 1/2",
                          Place(cell.line), Shown(cell.file), Shown(cell.text),
                          ColumnText(columns_, columns_.reading)));
        }
        if (columns_.unit_column) {
          throw Error(fmt::format("{}'{}' in {} is no known unit; state the unit by --unit ({})",
                                  Place(cell.line), Shown(cell.number.unit),
                                  ColumnText(columns_, *columns_.unit_column), kUnitNames));
        }
        throw Error(fmt::format(
            "{}the reading of '{}' must be a number, found '{}' in {}: '{}' is no known unit ({})",
            Place(cell.line), Shown(cell.file), Shown(cell.text),
            ColumnText(columns_, columns_.reading), Shown(cell.number.unit), kUnitNames));
      }
      if (NameOf(cell.number.unit) != NameOf(first.number.unit)) {
        throw Error(
            fmt::format("{}the reading '{}' has {}, but '{}' in line {} has {}; write all in "
                        "one unit",
                        Place(cell.line), Shown(cell.text), UnitText(cell.number.unit),
                        Shown(first.text), first.line, UnitText(first.number.unit)));
      }
    }
    unit_ = columns_.unit;
    if (!unit_.empty() && !first.number.unit.empty() && options_.unit.empty() &&
        NameOf(unit_) != NameOf(first.number.unit)) {
      throw Error(fmt::format(
          "{}the header of {} states '{}', but the reading '{}' has {}; state the unit by --unit",
          Place(first.line), ColumnText(columns_, columns_.reading), Shown(unit_),
          Shown(first.text), UnitText(first.number.unit)));
    }
    if (!first.number.unit.empty()) unit_ = first.number.unit;
    TakeUnitOfOtherLines();
  }

  // Comments and the lines before the table: "# unit: um", "Units,um". What the header says and
  // they contradict is refused.
  void TakeUnitOfOtherLines() {
    if (!options_.unit.empty()) return;
    std::vector<std::pair<std::size_t, std::string>> lines = table_.comments;
    for (const TableRow& row : table_.rows) {
      if (row.line > columns_.last_skipped_line) break;
      std::string line;
      for (const std::string& cell : row.cells) line += (line.empty() ? "" : ",") + cell;
      lines.emplace_back(row.line, line);
    }
    for (const auto& [line, text] : lines) {
      if (columns_.header.line == line) continue;
      const std::string stated = UnitStatedIn(text);
      if (stated.empty() || (!unit_.empty() && HasUnit(stated, NameOf(unit_)))) continue;
      if (!unit_.empty()) {
        throw Error(
            fmt::format("{}this line states the unit '{}', but {} '{}'; state the unit of "
                        "the readings by --unit",
                        Place(line), Shown(stated),
                        unit_place_.empty() ? ColumnText(columns_, columns_.reading) : unit_place_,
                        Shown(unit_)));
      }
      unit_ = stated;
      unit_place_ = fmt::format("line {}", line);
      if (!FindUnit(unit_)) {
        throw Error(
            fmt::format("{}this line states the unit '{}', which is not one of {}; state "
                        "the unit of the readings by --unit",
                        Place(line), Shown(stated), kUnitNames));
      }
    }
  }

  // Whether it is the unit or, of several units, one of them.
  static bool HasUnit(const std::string& units, const std::string& name) {
    if (NameOf(units) == name) return true;
    if (std::isdigit(static_cast<unsigned char>(units.front())) != 0) return false;  // "0.1 mm"
    for (std::size_t begin = 0; begin < units.size();) {
      const std::size_t end = std::min(units.find(' ', begin), units.size());
      if (NameOf(units.substr(begin, end - begin)) == name) return true;
      begin = end + 1;
    }
    return false;
  }

  static std::string NameOf(const std::string& unit) {
    const auto known = FindUnit(unit);
    return known ? known->name : unit;
  }
  static std::string UnitText(const std::string& unit) {
    return unit.empty() ? "no unit" : fmt::format("the unit '{}'", Shown(unit));
  }

  FileReading RowOf(const ReadingCell& cell) const {
    const auto value = ToNumber(cell.number.number, mark_);
    if (!value) {
      throw Error(fmt::format("{}the reading of '{}' must be a number{}, found '{}' in {}",
                              Place(cell.line), Shown(cell.file),
                              mark_ == ',' ? " with a decimal comma" : "", Shown(cell.text),
                              ColumnText(columns_, columns_.reading)));
    }
    const std::string place = Place(cell.line);
    const std::string column = place + ColumnText(columns_, columns_.reading) + ": ";
    // The frames of a video lie between those of the table, which needs a length.
    return {cell.file,
            options_.time_column.empty() ? ReadingInMmOrCounts(*value, unit_, options_, column)
                                         : ReadingInMm(*value, unit_, options_, column),
            place};
  }

  void Describe(const std::string& encoding, ReadingSet* set) const {
    const std::string name = ReadingUnitName(unit_, options_);
    set->in_dioptres = name == kDioptres;
    set->in_counts = AreCountsWithoutLength(unit_, options_);
    std::string unit = name;
    if (!unit_place_.empty()) unit += fmt::format(" (as {} states)", unit_place_);
    const bool is_stated = !unit_.empty() || !options_.unit.empty() || options_.scale_mm;
    if (!is_stated) unit += " (no unit is stated)";
    if (options_.scale_mm) unit += fmt::format(" of {} mm", *options_.scale_mm);
    set->description = fmt::format(
        "{} of {}, {}, {} row{}; {} from {}", ColumnText(columns_, columns_.reading),
        fs::path(path_).filename().string(), unit, set->rows.size(),
        set->rows.size() == 1 ? "" : "s", options_.time_column.empty() ? "files" : "times",
        ColumnText(columns_, columns_.file));
    if (table_.separator != ',') set->description += "; " + SeparatorName(table_.separator);
    if (is_comma_seen_) set->description += "; decimal comma";
    if (encoding != "UTF-8") set->description += "; " + encoding;
    if (columns_.last_skipped_line > 0) {
      set->notices.push_back(fmt::format("{}: the lines up to {}, before the table, are not read",
                                         path_, columns_.last_skipped_line));
    }
    if (!columns_.unit.empty() && !options_.unit.empty() &&
        NameOf(columns_.unit) != NameOf(options_.unit)) {
      set->notices.push_back(
          fmt::format("{}: {} states '{}'; the readings are taken as {}, as "
                      "stated elsewhere",
                      path_, ColumnText(columns_, columns_.reading), Shown(columns_.unit), name));
    }
  }

  const std::string& path_;
  const ReadingOptions& options_;
  TableCells table_;
  ReadingColumns columns_;
  std::vector<ReadingCell> cells_;
  std::string unit_;        // that the table states
  std::string unit_place_;  // the line that states it; empty: a header or the cells
  char mark_ = '.';
  bool is_comma_seen_ = false;
};

}  // namespace

ReadingSet ReadingsOfTable(const std::string& bytes, const std::string& path,
                           const ReadingOptions& options) {
  return Reader(path, options).Read(bytes);
}

ReadingSet ReadTextReadings(const std::string& table, const std::vector<std::string>& files,
                            const ReadingOptions& options) {
  if (!options.source.empty()) {
    throw Error(fmt::format(
        "readings from '{}' are read from the content of the files, by thicklens::io only",
        options.source));
  }
  if (!options.name_pattern.empty()) return ReadingsOfNames(files, options);
  return ReadingsOfTable(ReadTextFile(table), table, options);
}

}  // namespace thicklens::model
