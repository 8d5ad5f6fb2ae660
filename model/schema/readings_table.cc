#include "model/schema/readings_table.h"

#include <csv.h>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <map>
#include <optional>

#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"

namespace thicklens::model {
namespace {

struct Table {
  std::vector<std::vector<std::string>> rows;
  std::vector<int> lines;
  std::vector<std::string> row;
  int line = 1;
};

void TakeCell(void* cell, std::size_t length, void* table) {
  static_cast<Table*>(table)->row.emplace_back(static_cast<const char*>(cell), length);
}

void TakeRow(int /*terminator*/, void* data) {
  Table& table = *static_cast<Table*>(data);
  table.rows.push_back(std::move(table.row));
  table.lines.push_back(table.line);
  table.row.clear();
}

char DelimiterOf(const std::string& text) {
  const std::string first_row = text.substr(0, text.find('\n'));
  for (const char delimiter : {'\t', ';'}) {
    if (first_row.find(delimiter) != std::string::npos) return delimiter;
  }
  return ',';
}

std::optional<double> ToNumber(const std::string& cell) {
  const bool has_plus = cell.rfind('+', 0) == 0 && cell.rfind("+-", 0) != 0;
  const char* begin = cell.data() + (has_plus ? 1 : 0);
  const char* end = cell.data() + cell.size();
  double value = 0;
  const auto [rest, status] = std::from_chars(begin, end, value);
  constexpr double kMaxMagnitude = 1e30;  // the limit of numbers in YAML
  const bool is_number = status == std::errc() && rest == end && std::abs(value) <= kMaxMagnitude;
  if (!is_number) return std::nullopt;
  return value;
}

}  // namespace

std::vector<ReadingRow> ReadReadingsTable(const std::string& path) {
  std::string text = ReadTextFile(path);
  if (text.rfind("\xEF\xBB\xBF", 0) == 0) text.erase(0, 3);  // a spreadsheet's byte order mark
  if (const std::size_t nul = text.find('\0'); nul != std::string::npos) {
    const auto end = text.begin() + static_cast<std::ptrdiff_t>(nul);
    throw Error(
        fmt::format("{}:{}: a NUL byte, which no text file contains; a table in UTF-8 is expected",
                    path, 1 + std::count(text.begin(), end, '\n')));
  }
  csv_parser parser;
  if (csv_init(&parser, CSV_STRICT | CSV_STRICT_FINI | CSV_APPEND_NULL) != 0)
    throw Error(path + ": the CSV parser failed to start");
  csv_set_delim(&parser, static_cast<unsigned char>(DelimiterOf(text)));
  Table table;
  // The text is parsed line by line, so that the line of each row is known. A quoted line break
  // continues its row over several lines.
  bool well_formed = true;
  table.line = 0;
  for (std::size_t begin = 0; begin < text.size() && well_formed;) {
    ++table.line;
    std::size_t end = text.find('\n', begin);
    end = end == std::string::npos ? text.size() : end + 1;
    well_formed = csv_parse(&parser, text.data() + begin, end - begin, TakeCell, TakeRow, &table) ==
                  end - begin;
    begin = end;
  }
  well_formed = well_formed && csv_fini(&parser, TakeCell, TakeRow, &table) == 0;
  csv_free(&parser);
  if (!well_formed)
    throw Error(
        fmt::format("{}:{}: not a valid CSV row; check its quotation marks", path, table.line));

  std::vector<ReadingRow> readings;
  std::map<std::string, int> line_of;
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    const std::vector<std::string>& row = table.rows[i];
    const int line = table.lines[i];
    if (row.size() < 2) {
      throw Error(fmt::format("{}:{}: two columns are expected (file, reading), found {}", path,
                              line, row.size()));
    }
    const std::optional<double> reading = ToNumber(row[1]);
    if (!reading) {
      if (i == 0) continue;  // the header
      throw Error(fmt::format("{}:{}: the reading of '{}' must be a number, found '{}'", path, line,
                              row[0], row[1]));
    }
    if (row[0].empty())
      throw Error(fmt::format("{}:{}: the name of the file is missing", path, line));
    const auto [known, added] = line_of.emplace(row[0], line);
    if (!added) {
      throw Error(fmt::format("{}:{}: '{}' already has a reading in line {}", path, line, row[0],
                              known->second));
    }
    readings.push_back({line, row[0], *reading});
  }
  if (readings.empty())
    throw Error(fmt::format("{}: no row has a file and a reading; at least one is expected", path));
  return readings;
}

}  // namespace thicklens::model
