#include "model/tables/table_cells.h"

#include <csv.h>
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <optional>
#include <utility>

#include "model/tables/reading_number.h"
#include "model/tables/reading_unit.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

// More cells would take gigabytes of memory.
constexpr std::size_t kMaxCells = 4'000'000;
// Rows by which the separator is recognised.
constexpr std::size_t kSampleRows = 100;

bool IsBlank(char c) { return c == ' ' || c == '\t'; }

struct Parse {
  TableCells* table = nullptr;
  TableRow row;
  std::size_t line = 0, cells = 0;
};

void TakeCell(void* cell, std::size_t length, void* parse) {
  Parse& into = *static_cast<Parse*>(parse);
  if (++into.cells > kMaxCells) return;  // reported after the line
  into.row.cells.emplace_back(static_cast<const char*>(cell), length);
}

void TakeRow(int /*terminator*/, void* data) {
  Parse& into = *static_cast<Parse*>(data);
  into.row.line = into.line;
  into.table->rows.push_back(std::move(into.row));
  into.row = {};
}

// Whether a line of the text is a comment; `begin` is its beginning.
bool IsComment(const std::string& text, std::size_t begin, std::size_t end) {
  while (begin < end && IsBlank(text[begin])) ++begin;
  if (begin == end) return false;
  return text[begin] == '#' || text[begin] == '%' || text.compare(begin, 2, "//") == 0;
}

// Runs of spaces and tabs outside of quotation marks become one tab.
std::string WithTabs(const std::string& line, bool* is_quoted) {
  std::string tabbed;
  bool is_gap = false;
  for (const char c : line) {
    if (!*is_quoted && IsBlank(c)) {
      is_gap = !tabbed.empty();
      continue;
    }
    if (is_gap && c != '\n') tabbed += '\t';
    is_gap = false;
    if (c == '"') *is_quoted = !*is_quoted;
    tabbed += c;
  }
  return tabbed;
}

class Parser {
 public:
  Parser(char separator, TableCells* table) {
    parse_.table = table;
    if (csv_init(&parser_, CSV_STRICT | CSV_STRICT_FINI | CSV_APPEND_NULL) != 0)
      throw Error("the CSV parser failed to start");
    csv_set_delim(&parser_, static_cast<unsigned char>(separator == ' ' ? '\t' : separator));
  }
  ~Parser() { csv_free(&parser_); }
  Parser(const Parser&) = delete;
  Parser& operator=(const Parser&) = delete;

  // Returns whether the line is valid so far.
  bool TakeLine(const std::string& text, std::size_t number) {
    parse_.line = number;
    return csv_parse(&parser_, text.data(), text.size(), TakeCell, TakeRow, &parse_) == text.size();
  }
  bool Finish() { return csv_fini(&parser_, TakeCell, TakeRow, &parse_) == 0; }
  bool is_too_large() const { return parse_.cells > kMaxCells; }

 private:
  csv_parser parser_{};
  Parse parse_;
};

// Returns the line of the error; 0: none. Reads at most `most_rows`.
std::size_t ParseWith(char separator, const std::string& text, std::size_t begin,
                      std::size_t number, std::size_t most_rows, TableCells* table) {
  table->separator = separator;
  Parser parser(separator, table);
  bool is_quoted = false;
  bool is_whole = true;
  while (begin < text.size()) {
    if (table->rows.size() >= most_rows) {
      is_whole = false;
      break;
    }
    ++number;
    if (number % 4096 == 0) ThrowIfCancelled();
    std::size_t end = text.find('\n', begin);
    end = end == std::string::npos ? text.size() : end + 1;
    std::string line = text.substr(begin, end - begin);
    begin = end;
    if (!is_quoted && IsComment(line, 0, line.size())) {
      constexpr std::size_t kMaxComments = 1000;
      if (table->comments.size() < kMaxComments) table->comments.emplace_back(number, line);
      if (table->rows.empty()) {
        const std::size_t words = line.find_first_not_of("#%/ \t");
        TableCells comment;
        if (words != std::string::npos &&
            ParseWith(separator, line.substr(words), 0, number, 1, &comment) == 0 &&
            !comment.rows.empty()) {
          table->comment = {number, std::move(comment.rows.front().cells)};
        }
      }
      continue;
    }
    if (separator == ' ') {
      line = WithTabs(line, &is_quoted);
    } else if (std::count(line.begin(), line.end(), '"') % 2 != 0) {
      is_quoted = !is_quoted;
    }
    if (!parser.TakeLine(line, number)) return number;
    if (parser.is_too_large()) {
      throw Error(
          fmt::format("{}: more than {} cells, which no table of readings has", number, kMaxCells));
    }
  }
  if (is_whole && !parser.Finish()) return number;
  return 0;
}

// How well the separator explains the rows: a row with two cells counts once, one with a file and a
// number three times.
std::size_t ScoreOf(const TableCells& table) {
  std::size_t score = 0;
  for (const TableRow& row : table.rows) {
    if (row.cells.size() < 2) continue;
    ++score;
    bool has_file = false, has_number = false;
    for (std::size_t i = 0; i < std::min<std::size_t>(row.cells.size(), 64); ++i) {
      has_file = has_file || LooksLikeFile(row.cells[i]);
      has_number = has_number || LooksLikeNumber(row.cells[i]);
    }
    if (has_file && has_number) score += 2;
  }
  return score;
}

// "sep=;" in the first line, as Excel writes and reads it.
std::optional<char> StatedSeparator(const std::string& text) {
  if (text.size() < 6 || text.compare(0, 4, "sep=") != 0 || text[5] != '\n') return std::nullopt;
  return text[4];
}

std::string QuotationText(std::size_t line) {
  return fmt::format(
      "{}: not a valid CSV row: a quotation mark is inside a cell or has no partner; write \"\" "
      "for one inside of a quoted cell",
      line);
}

char BestSeparator(const std::string& text) {
  char best = ',';
  std::size_t best_score = 0;
  for (const char separator : {'\t', ';', ',', ' '}) {
    TableCells sample;
    ParseWith(separator, text, 0, 0, kSampleRows, &sample);
    const std::size_t score = ScoreOf(sample);
    if (score > best_score) {
      best = separator;
      best_score = score;
    }
  }
  return best;
}

}  // namespace

std::string SeparatorName(char separator) {
  switch (separator) {
    case ';':
      return "semicolons";
    case '\t':
      return "tabs";
    case ' ':
      return "spaces";
    case ',':
      return "commas";
    default:
      return fmt::format("'{}'", separator);
  }
}

bool LooksLikeFile(const std::string& cell) {
  const std::size_t dot = cell.rfind('.');
  constexpr std::size_t kLongest = 5;
  if (dot == std::string::npos || dot == 0 || dot + 1 == cell.size()) return false;
  if (cell.size() - dot - 1 > kLongest) return false;
  if (std::isalpha(static_cast<unsigned char>(cell[dot + 1])) == 0) return false;
  const std::string ending = cell.substr(dot + 1);
  if (ending == "name" || FindUnit(ending)) return false;  // R's "file.name" and "z.um"
  return std::all_of(ending.begin(), ending.end(),
                     [](char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0; });
}

TableCells SplitTable(const std::string& text, const std::string& path) {
  const std::optional<char> stated = StatedSeparator(text);
  const std::size_t begin = stated ? 6 : 0;
  const std::size_t lines_before = stated ? 1 : 0;
  char best = stated.value_or(',');
  try {
    if (!stated) best = BestSeparator(text);
    TableCells table;
    const std::size_t wrong_line =
        ParseWith(best, text, begin, lines_before, text.size() + 1, &table);
    if (wrong_line == 0) return table;
    throw Error(QuotationText(wrong_line));
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {
    throw Error(fmt::format("{}:{}", path, error.what()));
  }
}

}  // namespace thicklens::model
