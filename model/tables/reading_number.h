#ifndef THICKLENS_MODEL_TABLES_READING_NUMBER_H_
#define THICKLENS_MODEL_TABLES_READING_NUMBER_H_

#include <optional>
#include <string>
#include <vector>

namespace thicklens::model {

// A number as a cell contains it.
struct NumberText {
  std::string number;  // sign, digits, marks and exponent
  std::string unit;    // the text after it; empty: none
};

// The parts of a cell that begins with a number, or nothing if it does not.
std::optional<NumberText> SplitNumber(const std::string& cell);

// Whether the cell is a finite number with any decimal mark, alone or with a known unit.
bool LooksLikeNumber(const std::string& cell);

// The value with the decimal mark ',' or '.', where the other mark, apostrophes and spaces group
// digits by three. Nothing if the text is no number or if its size is above 1e30.
std::optional<double> ToNumber(const std::string& number, char mark);

// The decimal mark of a column, or the reason why it is unknown.
struct DecimalMark {
  char mark = '.';
  bool is_seen = false;         // whether a number has it
  bool is_ambiguous = false;    // 1,234 may be 1.234 or 1234
  std::optional<int> conflict;  // index of a number that contradicts the ones before it
  std::optional<int> example;   // index of a number that shows the mark, or that is ambiguous
};

// Compares all numbers of a column; elements without a number are not used. In a table with
// semicolons (`prefers_comma`) a comma that may be either is a decimal mark.
DecimalMark FindDecimalMark(const std::vector<std::string>& numbers, bool prefers_comma);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_TABLES_READING_NUMBER_H_
