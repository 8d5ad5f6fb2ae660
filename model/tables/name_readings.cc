#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <set>
#include <utility>

#include "model/tables/reading_number.h"
#include "model/tables/reading_unit.h"
#include "model/tables/table_text.h"
#include "thicklens/base/error.h"
#include "thicklens/model/readings.h"

namespace thicklens::model {
namespace {

namespace fs = std::filesystem;

constexpr char kField[] = "{reading}";

bool IsDigit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }
bool IsLetter(char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; }

// A number in a name: sign, digits, and one decimal mark, for which names also have the letter p
// ("0p25"), because a point would begin the ending.
struct NumberInName {
  std::size_t begin = 0, end = 0;
  std::string number;  // with a decimal point
};

std::optional<NumberInName> NumberAt(const std::string& name, std::size_t begin) {
  std::size_t at = begin;
  NumberInName found{begin, begin, ""};
  if (at < name.size() && (name[at] == '-' || name[at] == '+')) found.number += name[at++];
  const std::size_t digits = at;
  while (at < name.size() && IsDigit(name[at])) found.number += name[at++];
  const bool has_whole = at > digits;
  const bool has_mark = at + 1 < name.size() && IsDigit(name[at + 1]) &&
                        (name[at] == '.' || name[at] == ',' || (has_whole && name[at] == 'p'));
  if (has_mark) {
    found.number += '.';
    ++at;
    while (at < name.size() && IsDigit(name[at])) found.number += name[at++];
  }
  if (!has_whole && !has_mark) return std::nullopt;
  found.end = at;
  return found;
}

struct Pattern {
  std::string before, after;
};

Pattern PatternOf(const std::string& text) {
  const std::size_t at = text.find(kField);
  return {text.substr(0, at), text.substr(at + sizeof(kField) - 1)};
}

// The unit that follows the number in the pattern, as in "z{reading}um_".
std::string UnitAfter(const std::string& after) {
  std::size_t begin = 0;
  while (begin < after.size() && (after[begin] == ' ' || after[begin] == '_')) ++begin;
  std::size_t end = begin;
  while (end < after.size() &&
         (IsLetter(after[end]) || static_cast<unsigned char>(after[end]) >= 0x80))
    ++end;
  const std::string word = after.substr(begin, end - begin);
  const auto unit = FindUnit(word);
  if (!unit || unit->kind == ReadingUnit::Kind::kOther) return "";
  return word;
}

// Every number in the name that the pattern surrounds.
std::vector<NumberInName> Matches(const std::string& name, const Pattern& pattern) {
  std::vector<NumberInName> matches;
  for (std::size_t at = name.find(pattern.before); at != std::string::npos;
       at = name.find(pattern.before, at + 1)) {
    const std::size_t begin = at + pattern.before.size();
    // Without text before it, a number begins where no other digit is.
    const bool is_inside =
        pattern.before.empty() && begin > 0 &&
        (IsDigit(name[begin - 1]) || name[begin - 1] == '-' || name[begin - 1] == '.');
    const auto number = NumberAt(name, begin);
    if (number && !is_inside && name.compare(number->end, pattern.after.size(), pattern.after) == 0)
      matches.push_back(*number);
    if (at >= name.size()) break;
  }
  return matches;
}

// The name as text and numbers that alternate; it begins with a text.
std::vector<std::string> Parts(const std::string& name) {
  std::vector<std::string> parts(1);
  for (std::size_t at = 0; at < name.size();) {
    // A sign belongs to the number if no letter or digit is before it: "z-3" may be either, and
    // then the sign is part of the text.
    const auto number = IsDigit(name[at]) ? NumberAt(name, at) : std::nullopt;
    if (!number) {
      parts.back() += name[at++];
      continue;
    }
    parts.push_back(name.substr(at, number->end - at));
    parts.emplace_back();
    at = number->end;
  }
  return parts;
}

// A minus sign that only some of the names have belongs to the number behind it.
std::vector<std::string> WithSigns(std::vector<std::string> parts) {
  for (std::size_t i = 0; i + 1 < parts.size(); i += 2) {
    if (parts[i].empty() || parts[i].back() != '-') continue;
    parts[i].pop_back();
    parts[i + 1].insert(0, "-");
  }
  return parts;
}

// Index of the one part that changes, or nothing.
std::optional<std::size_t> ChangingPart(const std::vector<std::vector<std::string>>& names) {
  std::optional<std::size_t> changing;
  for (std::size_t i = 0; i < names.front().size(); ++i) {
    const bool is_same = std::all_of(names.begin(), names.end(), [&](const auto& parts) {
      return parts[i] == names.front()[i];
    });
    if (is_same) continue;
    if (i % 2 == 0 || changing) return std::nullopt;
    changing = i;
  }
  return changing;
}

}  // namespace

ReadingSet ReadingsOfNames(const std::vector<std::string>& files, const ReadingOptions& options) {
  const Pattern pattern = PatternOf(options.name_pattern);
  const std::string unit = UnitAfter(pattern.after);
  ReadingSet set;
  set.source = fmt::format("the names of the files ('{}')", Shown(options.name_pattern));
  for (const std::string& file : files) {
    const std::string name = fs::path(file).filename().string();
    const std::vector<NumberInName> matches = Matches(name, pattern);
    if (matches.size() != 1) {
      throw Error(fmt::format(
          "{}: the name {} '{}'; a pattern that matches each name once is expected, with "
          "{{reading}} "
          "in place of the number",
          file,
          matches.empty() ? "does not contain" : "contains more than once what is described by",
          Shown(options.name_pattern)));
    }
    const auto value = ToNumber(matches.front().number, '.');
    if (!value) {
      throw Error(
          fmt::format("{}: the reading in the name must be a number of at most 1e30, found "
                      "'{}'",
                      file, Shown(matches.front().number)));
    }
    const std::string place = file + ": ";
    set.rows.push_back({file, ReadingInMmOrCounts(*value, unit, options, place), place});
  }
  const bool is_stated = !unit.empty() || !options.unit.empty() || options.scale_mm;
  set.in_dioptres = ReadingUnitName(unit, options) == kDioptres;
  set.in_counts = AreCountsWithoutLength(unit, options);
  set.description =
      fmt::format("'{}' in the names of {} files, {}{}", Shown(options.name_pattern), files.size(),
                  ReadingUnitName(unit, options), is_stated ? "" : " (no unit is stated)");
  return set;
}

std::optional<std::string> ProposedNamePattern(const std::vector<std::string>& files) {
  if (files.size() < 2) return std::nullopt;
  std::vector<std::vector<std::string>> names;
  for (const std::string& file : files) names.push_back(Parts(fs::path(file).filename().string()));
  const auto is_alike = [&](const auto& parts) { return parts.size() == names.front().size(); };
  if (!std::all_of(names.begin(), names.end(), is_alike)) return std::nullopt;
  std::optional<std::size_t> changing = ChangingPart(names);
  if (!changing) {
    for (auto& parts : names) parts = WithSigns(parts);
    changing = ChangingPart(names);
  }
  if (!changing) return std::nullopt;
  std::set<std::string> values;
  for (const auto& parts : names) {
    if (!values.insert(parts[*changing]).second) return std::nullopt;
  }
  // The text on both sides up to the next number is enough, and the whole name is certain to match.
  std::string pattern;
  for (std::size_t i = 0; i < names.front().size(); ++i)
    pattern += i == *changing ? kField : names.front()[i];
  return pattern;
}

}  // namespace thicklens::model
