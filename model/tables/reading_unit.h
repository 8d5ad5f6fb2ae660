#ifndef THICKLENS_MODEL_TABLES_READING_UNIT_H_
#define THICKLENS_MODEL_TABLES_READING_UNIT_H_

#include <optional>
#include <string>

#include "thicklens/model/readings.h"

namespace thicklens::model {

// A unit that a table of readings may state.
struct ReadingUnit {
  enum class Kind {
    kLength,   // mm_per_unit is set
    kDioptre,  // 1/m
    kScaled,   // steps or counts of a drive, whose length the user states
    kOther     // seconds, degrees, volts ...: no reading of a bench
  };
  std::string name;  // as ReadingOptions::unit has it
  Kind kind = Kind::kOther;
  double mm_per_unit = 0;
};

// The unit with this name or a usual spelling of it ("µm", "Microns", "inch"), or nothing.
std::optional<ReadingUnit> FindUnit(const std::string& text);

// The unit that a line of text states by a word for it: "Unit: um", "# units = um", "z unit,um".
// Units of no reading (seconds, degrees) are none. A text behind "unit" alone is returned even if
// it is no known unit. Several are joined by a space, which is no unit. Empty: the line states
// none.
std::string UnitStatedIn(const std::string& line);

// Whether the readings are steps, counts or turns of a length that is not stated. They are allowed
// where the lens or the sensor moves (SweepFile::readings_are_counts).
bool AreCountsWithoutLength(const std::string& stated, const ReadingOptions& options);
// ReadingInMm, or the count itself where its length is not stated.
double ReadingInMmOrCounts(double value, const std::string& stated, const ReadingOptions& options,
                           const std::string& place);

// The units that ReadingOptions::unit may name, for messages.
extern const char kUnitNames[];

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_TABLES_READING_UNIT_H_
