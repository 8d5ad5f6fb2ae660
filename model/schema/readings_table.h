#ifndef THICKLENS_MODEL_SCHEMA_READINGS_TABLE_H_
#define THICKLENS_MODEL_SCHEMA_READINGS_TABLE_H_

#include <string>
#include <vector>

namespace thicklens::model {

// One row of a table of bench readings.
struct ReadingRow {
  int line = 0;  // 1-based, for messages
  std::string file;
  double reading = 0;  // in the unit of the table
};

// Reads a CSV table: column 1 is the file, column 2 the reading; further columns are ignored. The
// first row is a header if its second cell is no number. The delimiter is the comma, semicolon or
// tab that the first row contains. Throws Error, which names file and line, for an invalid row and
// for a file that is named twice.
std::vector<ReadingRow> ReadReadingsTable(const std::string& path);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SCHEMA_READINGS_TABLE_H_
