// Tables of readings by time, for the frames of a video.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "model/tables/reading_columns.h"
#include "model/tables/reading_number.h"
#include "model/tables/table_cells.h"
#include "model/tables/table_text.h"
#include "thicklens/base/error.h"
#include "thicklens/model/readings.h"

namespace thicklens::model {
namespace {

constexpr double kSecondsPerDay = 86400;

// Seconds in one unit of time, or nothing for another unit.
std::optional<double> SecondsOfUnit(std::string unit) {
  static const std::array<std::pair<const char*, double>, 17> kUnits = {{{"s", 1},
                                                                         {"sec", 1},
                                                                         {"secs", 1},
                                                                         {"second", 1},
                                                                         {"seconds", 1},
                                                                         {"sekunde", 1},
                                                                         {"sekunden", 1},
                                                                         {"ms", 1e-3},
                                                                         {"msec", 1e-3},
                                                                         {"us", 1e-6},
                                                                         {"\xC2\xB5s", 1e-6},
                                                                         {"ns", 1e-9},
                                                                         {"min", 60},
                                                                         {"minutes", 60},
                                                                         {"h", 3600},
                                                                         {"hr", 3600},
                                                                         {"hours", 3600}}};
  for (char& c : unit) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  for (const auto& [name, seconds] : kUnits) {
    if (unit == name) return seconds;
  }
  return std::nullopt;
}

// Days from 1970-01-01 to a date of the Gregorian calendar (Hinnant, "days_from_civil").
std::int64_t DaysSince1970(std::int64_t year, std::int64_t month, std::int64_t day) {
  year -= month <= 2 ? 1 : 0;
  const std::int64_t era = (year >= 0 ? year : year - 399) / 400;
  const std::int64_t of_era = year - era * 400;
  const std::int64_t of_year = (153 * (month > 2 ? month - 3 : month + 9) + 2) / 5 + day - 1;
  return era * 146097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719468;
}

// A whole number without sign, or nothing.
std::optional<std::int64_t> DigitsIn(const std::string& text) {
  constexpr std::size_t kLongest = 9;
  std::int64_t value = 0;
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool is_digits = status == std::errc() && end == text.data() + text.size() &&
                         text.size() <= kLongest && text[0] != '-';
  if (!is_digits) return std::nullopt;
  return value;
}

// "AM" or "PM" at the end, which is removed; 0 without one.
char TakeHalfOfDay(std::string* clock) {
  std::string end;
  std::size_t at = clock->size();
  while (at > 0 && clock->size() - at < 6 &&
         std::isdigit(static_cast<unsigned char>((*clock)[at - 1])) == 0) {
    const char c = (*clock)[--at];
    if (c != '.' && c != ' ') end += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  }
  if (end != "MA" && end != "MP") return 0;  // from its end
  clock->erase(at);
  return end[1];
}

// "10:20:30.5", "20:30.5" (minutes and seconds), "10:20:30 PM", with a point or a comma.
std::optional<double> SecondsOfClock(std::string text) {
  const char half = TakeHalfOfDay(&text);
  if (half != 0 && std::count(text.begin(), text.end(), ':') == 1) text += ":00";  // "10:20 PM"
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == ':') {
      parts.emplace_back();
    } else {
      parts.back() += c == ',' ? '.' : c;
    }
  }
  if (parts.size() < 2 || parts.size() > 3) return std::nullopt;
  double seconds = 0;
  for (std::size_t i = 0; i + 1 < parts.size(); ++i) {
    const auto whole = DigitsIn(parts[i]);
    if (!whole || (i > 0 && *whole > 59)) return std::nullopt;
    if (half != 0 && i == 0 && (*whole < 1 || *whole > 12)) return std::nullopt;
    const bool is_hour = half != 0 && i == 0;
    const std::int64_t number = !is_hour ? *whole : *whole % 12 + (half == 'P' ? 12 : 0);
    seconds = 60 * (seconds + static_cast<double>(number));
  }
  const std::string& last = parts.back();
  const bool begins_with_digit =
      !last.empty() && std::isdigit(static_cast<unsigned char>(last[0])) != 0;
  const auto rest = begins_with_digit ? ToNumber(last, '.') : std::nullopt;
  if (!rest || *rest >= 60) return std::nullopt;
  return seconds + *rest;
}

// The offset of a time zone at the end, "Z" or "+02:00", which is removed; 0 without one.
std::optional<double> TakeZone(std::string* clock) {
  if (!clock->empty() && (clock->back() == 'Z' || clock->back() == 'z')) {
    clock->pop_back();
    return 0;
  }
  const std::size_t sign = clock->find_first_of("+-");
  if (sign == std::string::npos) return 0;
  std::string zone = clock->substr(sign + 1);
  const double way = (*clock)[sign] == '+' ? 1 : -1;
  clock->erase(sign);
  zone.erase(std::remove(zone.begin(), zone.end(), ':'), zone.end());
  const auto number = DigitsIn(zone);
  if (!number || (zone.size() != 2 && zone.size() != 4)) return std::nullopt;
  const std::int64_t hours = zone.size() == 2 ? *number : *number / 100;
  const std::int64_t minutes = zone.size() == 2 ? 0 : *number % 100;
  return way * static_cast<double>(hours * 3600 + minutes * 60);
}

// "27.11.2026 10:20:30,5" with the date as "2026-11-27"; other texts as they are. Between slashes
// the day and the month may be exchanged.
std::string WithIsoDate(const std::string& text) {
  const std::size_t first = text.find('.');
  const std::size_t second = first == std::string::npos ? first : text.find('.', first + 1);
  if (second == std::string::npos || first == 0 || first > 2 || second - first < 2 ||
      second - first > 3 || second + 5 >= text.size() || text[second + 5] != ' ') {
    return text;
  }
  const auto two = [](const std::string& digits) {
    return digits.size() < 2 ? "0" + digits : digits;
  };
  return text.substr(second + 1, 4) + "-" + two(text.substr(first + 1, second - first - 1)) + "-" +
         two(text.substr(0, first)) + text.substr(second + 5);
}

// "2026-11-27T10:20:30.5+01:00", "27.11.2026 10:20:30"
std::optional<double> SecondsOfDate(const std::string& stated) {
  constexpr std::size_t kDate = 10;
  const std::string text = WithIsoDate(stated);
  if (text.size() <= kDate || text[4] != text[7]) return std::nullopt;
  if (text[4] != '-' && text[4] != '/') return std::nullopt;
  if (text[kDate] != 'T' && text[kDate] != ' ' && text[kDate] != 't') return std::nullopt;
  const auto year = DigitsIn(text.substr(0, 4)), month = DigitsIn(text.substr(5, 2)),
             day = DigitsIn(text.substr(8, 2));
  if (!year || !month || !day || *month < 1 || *month > 12 || *day < 1 || *day > 31)
    return std::nullopt;
  std::string clock = text.substr(kDate + 1);
  const auto zone = TakeZone(&clock);
  const auto seconds = SecondsOfClock(clock);
  if (!zone || !seconds) return std::nullopt;
  return static_cast<double>(DaysSince1970(*year, *month, *day)) * kSecondsPerDay + *seconds -
         *zone;
}

// A time of any layout, with the decimal mark and the seconds in one unit of plain numbers.
std::optional<double> Seconds(const std::string& cell, char mark, double seconds_per_unit,
                              bool* is_stated) {
  if (cell.find(':') != std::string::npos) {
    *is_stated = true;
    const auto clock = SecondsOfClock(cell);
    return clock ? clock : SecondsOfDate(cell);
  }
  const auto parts = SplitNumber(cell);
  if (!parts) return std::nullopt;
  const auto value = ToNumber(parts->number, mark);
  if (!value) return std::nullopt;
  if (parts->unit.empty()) return *value * seconds_per_unit;
  const auto unit = SecondsOfUnit(parts->unit);
  if (!unit) return std::nullopt;
  *is_stated = true;
  return *value * *unit;
}

// The reason why a time of a usual layout is not read; empty: none is known.
std::string WhyNoTime(const std::string& cell) {
  const auto count = [&](const char* marks) {
    return std::count_if(cell.begin(), cell.end(),
                         [&](char c) { return std::string(marks).find(c) != std::string::npos; });
  };
  const bool begins_with_digit =
      !cell.empty() && std::isdigit(static_cast<unsigned char>(cell[0])) != 0;
  const std::size_t space = cell.find_first_of(" T");
  if (count(":") == 3 || (count(":") == 2 && count(";") == 1)) {
    return ": a time code counts frames behind its last mark; write seconds with a fraction "
           "(hh:mm:ss.f)";
  }
  const std::string date = cell.substr(0, space);
  const auto dashes =
      std::count(date.begin(), date.end(), '/') + std::count(date.begin(), date.end(), '-');
  if (begins_with_digit && dashes == 2 && date.find_first_of("/-") < 3)
    return ": its day and its month may be exchanged; write the year first (2026-11-27)";
  return "";
}

std::string List(const ReadingColumns& columns, const std::vector<std::size_t>& of) {
  std::string text;
  for (const std::size_t column : of)
    text += (text.empty() ? "" : ", ") + ColumnText(columns, column);
  return text;
}

// The column of times: its name or, without a header, its number; empty: the table has none.
std::string TimeColumn(const TableCells& table, const std::string& path,
                       const ReadingOptions& options) {
  if (!options.time_column.empty()) return options.time_column;
  if (!options.file_column.empty() || table.rows.empty()) return "";
  ReadingColumns columns;
  const VideoColumns found = FindVideoColumns(table, path, options, &columns);
  if (found.times.empty()) return "";
  if (!found.files.empty()) {
    throw Error(fmt::format(
        "{}: it has times ({}) and numbers of frames ({}): --time-column or --file-column selects "
        "what places its rows in the video",
        path, List(columns, found.times), List(columns, found.files)));
  }
  if (found.times.size() > 1) {
    throw Error(fmt::format("{}: several columns have times: {}; --time-column selects one", path,
                            List(columns, found.times)));
  }
  return std::to_string(found.times.front() + 1);
}

// The unit in the header of the column, or an empty text.
std::string UnitOfTimes(const TableCells& table, const std::string& path,
                        const ReadingOptions& options) {
  const ReadingColumns columns = FindColumns(table, path, options);
  if (columns.header.cells.empty()) return "";
  const std::string& name = columns.header.cells[columns.file];
  std::string word;
  std::vector<std::string> words;
  for (const char c : name + " ") {
    const bool is_letter =
        std::isalpha(static_cast<unsigned char>(c)) != 0 || static_cast<unsigned char>(c) >= 0x80;
    if (is_letter) {
      word += c;
    } else if (!word.empty()) {
      words.push_back(std::exchange(word, ""));
    }
  }
  return !words.empty() && SecondsOfUnit(words.back()) ? words.back() : "";
}

}  // namespace

std::optional<double> SecondsOfTime(const std::string& text) {
  bool ignored = false;
  return Seconds(text, '.', 1, &ignored);
}

bool HasTimes(const std::string& bytes, const std::string& path, const ReadingOptions& options) {
  return !TimeColumn(SplitTable(DecodeTableText(bytes, path).text, path), path, options).empty();
}

TimedReadingSet TimedReadingsOfTable(const std::string& bytes, const std::string& path,
                                     const ReadingOptions& options) {
  const TableCells table = SplitTable(DecodeTableText(bytes, path).text, path);
  ReadingOptions by_time = options;
  by_time.time_column = TimeColumn(table, path, options);
  if (by_time.time_column.empty()) {
    throw Error(fmt::format("{}: no column is named as a time; --time-column selects one", path));
  }
  const ReadingSet rows = ReadingsOfTable(bytes, path, by_time);
  const std::string in_header = UnitOfTimes(table, path, by_time);
  const std::string& unit = options.time_unit.empty() ? in_header : options.time_unit;
  std::vector<std::string> numbers;
  for (const FileReading& row : rows.rows) {
    const auto parts = SplitNumber(row.file);
    const bool is_plain = parts && row.file.find(':') == std::string::npos;
    numbers.push_back(is_plain ? parts->number : "");
  }
  const DecimalMark mark = FindDecimalMark(numbers, true);
  TimedReadingSet set{{}, !unit.empty(), rows.description, rows.source, rows.notices};
  for (const FileReading& row : rows.rows) {
    const auto seconds = Seconds(row.file, mark.mark, unit.empty() ? 1 : *SecondsOfUnit(unit),
                                 &set.is_time_unit_stated);
    if (!seconds) {
      throw Error(fmt::format(
          "{}a time is expected (a number, mm:ss.f, hh:mm:ss.f, or a date and a time such as "
          "2026-11-27T10:20:30.5), found '{}'{}",
          row.place, Shown(row.file), WhyNoTime(row.file)));
    }
    set.rows.push_back({*seconds, row.reading_mm, row.place});
  }
  if (set.rows.size() > 1 && set.rows.back().time_s < set.rows.front().time_s)
    std::reverse(set.rows.begin(), set.rows.end());
  for (std::size_t i = 1; i < set.rows.size(); ++i) {
    if (set.rows[i].time_s > set.rows[i - 1].time_s) continue;
    throw Error(
        fmt::format("{}the time {:.6g} s does not follow that of the row before, {:.6g} s; "
                    "sort the rows by time, and keep one row for each time",
                    set.rows[i].place, set.rows[i].time_s, set.rows[i - 1].time_s));
  }
  set.description += unit.empty() && !set.is_time_unit_stated ? ", s (no unit is stated)"
                     : unit.empty()                           ? ""
                                                              : ", " + unit;
  return set;
}

}  // namespace thicklens::model
