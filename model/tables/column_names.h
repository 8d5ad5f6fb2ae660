#ifndef THICKLENS_MODEL_TABLES_COLUMN_NAMES_H_
#define THICKLENS_MODEL_TABLES_COLUMN_NAMES_H_

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "model/tables/reading_unit.h"

// The names of columns: their words in many languages, and the unit that they state.
namespace thicklens::model {

using Words = std::set<std::string>;

// Names of the readings in English, German, French, Spanish, Portuguese, Italian, Dutch, Swedish,
// Danish, Polish, Czech, Russian, Chinese, Japanese and Korean.
const Words& ReadingWords();

// Names of files and of images, in the same languages.
const Words& FileWords();

// Words of columns that are no reading although another word of their names says so, such as
// "focus_score" and "position_index".
const Words& OtherWords();

// Names of times, in the same languages.
const Words& TimeWords();

// In lower case: "s", "sec", "ms".
bool IsUnitOfTime(const std::string& unit);

// Lower case of Latin and Cyrillic letters in UTF-8; other bytes as they are.
std::string LowerCase(const std::string& text);

// The words of a name: "ZPositionUm" and "Z_position um" are z, position, um.
std::vector<std::string> WordsOf(const std::string& name);

// Whether one of the words is among the known ones.
bool HasWord(const std::vector<std::string>& words, const Words& known);

// Without spaces at both ends.
std::string Trimmed(const std::string& text);

// Units that are not read. Any other word in a name is taken for a part of the name.
bool IsUnreadUnit(const std::string& word);

// Whether it is known and a unit of length.
bool HasLength(const std::optional<ReadingUnit>& unit);

// The statements in the name of a column.
struct ColumnName {
  std::vector<std::string> words;    // without the unit
  std::string unit;                  // its text; empty: none
  std::optional<ReadingUnit> known;  // the unit, if it is known
};

// Reads names such as "Position [µm]", "z (mm)", "z / mm" and "z_um".
ColumnName NameOf(const std::string& cell);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_TABLES_COLUMN_NAMES_H_
