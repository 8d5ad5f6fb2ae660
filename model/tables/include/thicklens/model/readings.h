#ifndef THICKLENS_MODEL_READINGS_H_
#define THICKLENS_MODEL_READINGS_H_

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"

namespace thicklens::model {

// Name of the unit of readings in dioptres.
inline constexpr char kDioptres[] = "dpt";

// Which readings are read, and in which unit. An empty or absent value: found from the names of the
// columns, from the units in the table, and from the numbers.
struct ReadingOptions {
  std::string column;       // column of the readings: its name, or its number from 1
  std::string file_column;  // column of the files, likewise
  // Unit of the readings: mm, um, nm, pm, angstrom, cm, dm, m, mil, in, ft, yd, dpt (dioptres: the
  // reading is 1000 mm over it), or steps, counts or turns, which need a scale. It replaces a unit
  // that the table states.
  std::string unit;
  std::optional<double> scale_mm;  // mm per step, count or turn; finite, not 0
  std::string decimal;             // decimal mark of the readings: "comma" or "point"
  // The reading in the names of the files, for example "z{reading}um"; instead of a table.
  std::string name_pattern;
  // "exif": the metadata of the files (EXIF, XMP). "sidecar": a JSON file beside each file. "ome":
  // the OME-XML in each file. All instead of a table.
  std::string source;
  // The column of times, likewise, in a table for the frames of a video; excludes `file_column`.
  std::string time_column;
  // Unit of the times: s, ms, us, ns, min or h. It replaces a unit that the table states.
  std::string time_unit;

  // Returns whether the values are possible and do not contradict each other. Otherwise `why`, if
  // not null, gets the field, the value and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
  // Whether the readings come from the files themselves, not from a table.
  bool IsWithoutTable() const { return !name_pattern.empty() || !source.empty(); }
};

// The reading of one file.
struct FileReading {
  std::string file;  // as the table writes it
  double reading_mm = 0;
  std::string place;  // for messages: "table.csv:3: "
};

// The readings of a sweep.
struct ReadingSet {
  std::vector<FileReading> rows;
  // Describes what was read, in one line: "column 3 'z_um' of table.csv, um, 31 rows".
  std::string description;
  std::string source;  // what the rows are in, for messages: "table.csv"
  std::string folder;  // the folder that names are relative to; empty: the current one
  std::vector<std::string> notices;  // assumptions, one line each
  // True: the readings are stated in dioptres, the unit of the focus scale of a lens.
  bool in_dioptres = false;
  // True: the readings are steps or counts of a drive whose length nothing states.
  bool in_counts = false;
};

// The reading at one time.
struct TimedReading {
  double time_s = 0;  // on the clock of the table
  double reading_mm = 0;
  std::string place;  // for messages: "table.csv:3: "
};

// The readings of a sweep by time.
struct TimedReadingSet {
  std::vector<TimedReading> rows;  // in rising order of time
  // Whether the table, or an option, states the unit of the times; otherwise they are seconds.
  bool is_time_unit_stated = false;
  std::string description;           // as in ReadingSet
  std::string source;                // likewise
  std::vector<std::string> notices;  // assumptions, one line each
};

// Reads the readings of a sweep. `table` is empty if they come from the files themselves; `files`
// are the images of the sweep. Throws Error that names the place.
using ReadingReader = std::function<ReadingSet(
    const std::string& table, const std::vector<std::string>& files, const ReadingOptions&)>;

// Reads text: a table, or the names of the files. Throws Error for `options.source`, which needs
// thicklens::io.
THICKLENS_EXPORT ReadingSet ReadTextReadings(const std::string& table,
                                             const std::vector<std::string>& files,
                                             const ReadingOptions& options);

// Reads a table from the bytes of a file: comma, semicolon, tab or spaces between the cells; UTF-8,
// UTF-16 or Latin-1; with or without header. `path` is for messages. Throws Error that names file,
// line, column and value.
THICKLENS_EXPORT ReadingSet ReadingsOfTable(const std::string& bytes, const std::string& path,
                                            const ReadingOptions& options);

// Whether a table for a video has times, and not the numbers of frames: `options.time_column` or
// the names of the columns say it or, without a header, numbers that are not whole. Throws Error if
// it has both, or several columns of times, and no option selects one.
THICKLENS_EXPORT bool HasTimes(const std::string& bytes, const std::string& path,
                               const ReadingOptions& options);
// Reads a table of times and readings. A time is a number, "mm:ss.f", "hh:mm:ss.f" (also with AM or
// PM), or a date and a time ("2026-11-27T10:20:30.5", "27.11.2026 10:20:30,5"), which becomes
// seconds since 1970. Throws Error as ReadingsOfTable does, also for times that do not rise or fall
// from row to row.
THICKLENS_EXPORT TimedReadingSet TimedReadingsOfTable(const std::string& bytes,
                                                      const std::string& path,
                                                      const ReadingOptions& options);
// The seconds of one such time with a decimal point, in s unless a unit follows it ("12 ms"), or
// nothing if it is none.
THICKLENS_EXPORT std::optional<double> SecondsOfTime(const std::string& text);

// Reads `options.name_pattern` in the name of each file. The unit is the one that follows
// "{reading}" in the pattern, if there is one. Throws Error that names the file.
THICKLENS_EXPORT ReadingSet ReadingsOfNames(const std::vector<std::string>& files,
                                            const ReadingOptions& options);
// Returns the pattern of the names if they contain exactly one number that changes from file to
// file, without a repeat; otherwise nothing.
THICKLENS_EXPORT std::optional<std::string> ProposedNamePattern(
    const std::vector<std::string>& files);

// The unit in the name of a value that means the position of a bench or focus drive, in a usual
// language: "um" for "z_um", empty for "Position". Nothing for any other name.
THICKLENS_EXPORT std::optional<std::string> UnitOfReadingName(const std::string& name);
// Whether the name of a value means a file: "file", "Bildname".
THICKLENS_EXPORT bool IsNameOfFiles(const std::string& name);

// Converts a number with the unit of `options` or, if it has none, with `stated` (a name of a unit;
// empty: mm). Throws Error that begins with `place`.
THICKLENS_EXPORT double ReadingInMm(double value, const std::string& stated,
                                    const ReadingOptions& options, const std::string& place);
// The unit that ReadingInMm takes: that of the options, the stated one, or "mm".
THICKLENS_EXPORT std::string ReadingUnitName(const std::string& stated,
                                             const ReadingOptions& options);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_READINGS_H_
