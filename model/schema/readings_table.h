#ifndef THICKLENS_MODEL_SCHEMA_READINGS_TABLE_H_
#define THICKLENS_MODEL_SCHEMA_READINGS_TABLE_H_

#include <string>
#include <vector>

namespace thicklens::model {

// One row of a table of bench readings.
struct ReadingRow {
  int line = 0;  // 1-based, for messages
  std::string file;
  double reading = 0;  // in the table's own unit
};

// A CSV table: column 1 the file, column 2 the reading; further columns are ignored. The first row
// is a header if its second cell is no number. Comma, semicolon or tab, whichever the first row
// has. Throws Error naming file and line for anything that is no such row, or a file named twice.
std::vector<ReadingRow> ReadReadingsTable(const std::string& path);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SCHEMA_READINGS_TABLE_H_
