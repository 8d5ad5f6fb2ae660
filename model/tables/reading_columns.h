#ifndef THICKLENS_MODEL_TABLES_READING_COLUMNS_H_
#define THICKLENS_MODEL_TABLES_READING_COLUMNS_H_

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "model/tables/table_cells.h"
#include "thicklens/model/readings.h"

namespace thicklens::model {

// The columns of a table that are used; all indices begin with 0.
struct ReadingColumns {
  std::size_t file = 0, reading = 1;
  TableRow header;                         // without cells: the table has none
  std::size_t first_row = 0;               // of the rows with data
  std::size_t last_skipped_line = 0;       // before the table; 0: none
  std::size_t width = 0;                   // number of columns: of the header, or of the first row
  std::string unit;                        // that the header states; empty: none
  std::optional<std::size_t> unit_column;  // has the unit of each reading
};

// Finds the columns of the file and of the reading by the options, by the names in the header, and
// by the content of the cells. Throws Error, which lists the candidates and the options that
// decide, if several columns may be meant or none.
ReadingColumns FindColumns(const TableCells& table, const std::string& path,
                           const ReadingOptions& options);

// The columns of a table for a video that may have the times of its frames or their numbers.
struct VideoColumns {
  bool has_header = false;
  std::vector<std::size_t> times;  // by their names or, without a header, by their content
  std::vector<std::size_t> files;  // by their names: "frame", "page", "file"
};
VideoColumns FindVideoColumns(const TableCells& table, const std::string& path,
                              const ReadingOptions& options, ReadingColumns* columns);

// A column in messages: "column 2 'z_mm'".
std::string ColumnText(const ReadingColumns& columns, std::size_t column);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_TABLES_READING_COLUMNS_H_
