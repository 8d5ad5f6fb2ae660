#ifndef THICKLENS_MODEL_TABLES_TABLE_CELLS_H_
#define THICKLENS_MODEL_TABLES_TABLE_CELLS_H_

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace thicklens::model {

// One row of a table of text.
struct TableRow {
  std::size_t line = 0;  // 1-based, of its end
  std::vector<std::string> cells;
};

// The cells of a table of text, without comments and empty lines.
struct TableCells {
  char separator = ',';  // ' ' stands for any run of spaces and tabs
  std::vector<TableRow> rows;
  // The last comment before the first row, as a row: some programs write the header there.
  TableRow comment;
  // The texts of the first comments, with their lines.
  std::vector<std::pair<std::size_t, std::string>> comments;
};

// The name of a separator for messages: "commas", "semicolons", "tabs" or "spaces".
std::string SeparatorName(char separator);

// Whether the cell ends in a dot and the ending of a file: letters and digits that begin with a
// letter, but not the end of a name such as "z.um" or "file.name".
bool LooksLikeFile(const std::string& cell);

// Splits the text of a table. The separator is the one with which most rows have a file and a
// number, or that a first line "sep=;" states. Lines that begin with #, % or // are comments.
// Throws Error, which names `path` and the line, for quotation marks that are wrong.
TableCells SplitTable(const std::string& text, const std::string& path);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_TABLES_TABLE_CELLS_H_
