#include "model/tables/reading_number.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstddef>

#include "model/tables/reading_unit.h"

namespace thicklens::model {
namespace {

bool IsDigit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

std::string Trimmed(const std::string& text) {
  const std::size_t begin = text.find_first_not_of(" \t\n");
  if (begin == std::string::npos) return "";
  return text.substr(begin, text.find_last_not_of(" \t\n") - begin + 1);
}

// The minus sign and the spaces of typography, which spreadsheets write, become those of ASCII.
std::string WithAsciiMarks(const std::string& text) {
  static const std::pair<std::string, std::string> kMarks[] = {
      {"\xE2\x88\x92", "-"},   // minus sign
      {"\xC2\xA0", " "},       // no-break space
      {"\xE2\x80\xAF", " "},   // narrow no-break space
      {"\xE2\x80\x89", " "},   // thin space
      {"\xE2\x80\x99", "'"}};  // right quotation mark, which groups digits in Switzerland
  const auto is_ascii = [](char c) { return static_cast<unsigned char>(c) < 0x80; };
  if (std::all_of(text.begin(), text.end(), is_ascii)) return text;
  std::string ascii = text;
  for (const auto& [mark, replacement] : kMarks) {
    for (std::size_t at = 0; (at = ascii.find(mark, at)) != std::string::npos; ++at)
      ascii.replace(at, mark.size(), replacement);
  }
  return ascii;
}

// The number without its exponent.
std::string Mantissa(const std::string& number) {
  return number.substr(0, number.find_first_of("eE"));
}

// Whether digits before the decimal mark are alone, or in groups of three behind the first group.
bool HasGroupsOfThree(const std::string& whole) {
  std::size_t begin = 0;
  bool is_first = true;
  while (begin <= whole.size()) {
    std::size_t end = whole.find_first_of(",.' ", begin);
    if (end == std::string::npos) end = whole.size();
    const std::size_t length = end - begin;
    const bool is_only = is_first && end == whole.size();
    if (!is_only && (is_first ? length < 1 || length > 3 : length != 3)) return false;
    is_first = false;
    begin = end + 1;
  }
  return true;
}

enum class Evidence { kNone, kWeak, kSure };

struct Marks {
  Evidence comma = Evidence::kNone, point = Evidence::kNone;  // as decimal marks
};

// One mark with three digits behind it and one to three before it may group digits. Several are
// certain to.
Evidence OfOneMark(const std::string& mantissa, char mark) {
  const std::size_t at = mantissa.find(mark);
  std::string whole = mantissa.substr(0, at);
  whole.erase(std::remove_if(whole.begin(), whole.end(), [](char c) { return !IsDigit(c); }),
              whole.end());
  const std::size_t behind = mantissa.size() - at - 1;
  const bool may_group = behind == 3 && !whole.empty() && whole.size() <= 3 && whole[0] != '0';
  return may_group ? Evidence::kWeak : Evidence::kSure;
}

Marks MarksOf(const std::string& number) {
  const std::string mantissa = Mantissa(number);
  const auto commas = std::count(mantissa.begin(), mantissa.end(), ',');
  const auto points = std::count(mantissa.begin(), mantissa.end(), '.');
  Marks marks;
  if (commas > 0 && points > 0) {  // the last one is the decimal mark
    (mantissa.rfind(',') > mantissa.rfind('.') ? marks.comma : marks.point) = Evidence::kSure;
  } else if (commas > 1) {
    marks.point = Evidence::kSure;  // commas group digits
  } else if (points > 1) {
    marks.comma = Evidence::kSure;
  } else if (commas == 1) {
    marks.comma = OfOneMark(mantissa, ',');
  } else if (points == 1) {
    marks.point = OfOneMark(mantissa, '.');
  }
  return marks;
}

}  // namespace

std::optional<NumberText> SplitNumber(const std::string& cell) {
  const std::string text = Trimmed(WithAsciiMarks(cell));
  std::size_t at = 0;
  if (at < text.size() && (text[at] == '+' || text[at] == '-')) ++at;
  bool has_digit = false;
  while (at < text.size()) {
    const char c = text[at];
    if (IsDigit(c)) {
      has_digit = true;
    } else if (c == ' ' || c == '\'') {  // these only group digits
      const bool is_inside = has_digit && at + 1 < text.size() && IsDigit(text[at + 1]);
      if (!is_inside) break;
    } else if (c != ',' && c != '.') {
      break;
    }
    ++at;
  }
  if (!has_digit) return std::nullopt;
  if (at + 1 < text.size() && (text[at] == 'e' || text[at] == 'E')) {
    std::size_t end = at + 1;
    if (end < text.size() && (text[end] == '+' || text[end] == '-')) ++end;
    const std::size_t digits = end;
    while (end < text.size() && IsDigit(text[end])) ++end;
    if (end > digits) at = end;
  }
  return NumberText{text.substr(0, at), Trimmed(text.substr(at))};
}

bool LooksLikeNumber(const std::string& cell) {
  constexpr std::size_t kLongest = 100;  // of a cell that is worth a look
  if (cell.size() > kLongest || std::none_of(cell.begin(), cell.end(), IsDigit)) return false;
  const auto parts = SplitNumber(cell);
  if (!parts) return false;
  if (!parts->unit.empty() && !FindUnit(parts->unit)) return false;
  return ToNumber(parts->number, '.').has_value() || ToNumber(parts->number, ',').has_value();
}

std::optional<double> ToNumber(const std::string& number, char mark) {
  constexpr std::size_t kLongest = 100;
  if (number.size() > kLongest) return std::nullopt;
  const std::size_t sign = !number.empty() && (number[0] == '+' || number[0] == '-') ? 1 : 0;
  const std::size_t exponent = std::min(number.find_first_of("eE"), number.size());
  const std::size_t decimal = std::min(number.find(mark), exponent);
  const std::string whole = number.substr(sign, decimal - sign);
  const std::string rest = number.substr(decimal, exponent - decimal);
  const auto is_digit_or_mark = [](char c) { return IsDigit(c); };
  const std::size_t from = rest.empty() ? 0 : 1;
  if (!std::all_of(rest.begin() + static_cast<std::ptrdiff_t>(from), rest.end(), is_digit_or_mark))
    return std::nullopt;
  const char other = mark == ',' ? '.' : ',';
  std::string plain = sign == 1 && number[0] == '-' ? "-" : "";
  for (const char c : whole) {
    if (IsDigit(c)) {
      plain += c;
    } else if (c != other && c != '\'' && c != ' ') {
      return std::nullopt;
    }
  }
  if (!HasGroupsOfThree(whole)) return std::nullopt;
  if (!rest.empty()) plain += '.' + rest.substr(1);
  if (exponent < number.size()) {
    std::string power = number.substr(exponent + 1);
    if (!power.empty() && power[0] == '+') power.erase(0, 1);
    plain += 'e' + power;
  }
  double value = 0;
  const auto [end, status] = std::from_chars(plain.data(), plain.data() + plain.size(), value);
  constexpr double kMaxMagnitude = 1e30;  // the limit of numbers in YAML
  const bool is_number = status == std::errc() && end == plain.data() + plain.size() &&
                         std::abs(value) <= kMaxMagnitude;
  if (!is_number) return std::nullopt;
  return value;
}

DecimalMark FindDecimalMark(const std::vector<std::string>& numbers, bool prefers_comma) {
  std::optional<int> sure_comma, sure_point, weak_comma;
  std::optional<int> conflict;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (numbers[i].empty()) continue;
    const Marks marks = MarksOf(numbers[i]);
    const int index = static_cast<int>(i);
    if (marks.comma == Evidence::kSure && !sure_comma) sure_comma = index;
    if (marks.point == Evidence::kSure && !sure_point) sure_point = index;
    if (marks.comma == Evidence::kWeak && !weak_comma) weak_comma = index;
    if (sure_comma && sure_point && !conflict) conflict = index;
  }
  DecimalMark found;
  found.conflict = conflict;
  if (conflict) {
    found.example = std::min(*sure_comma, *sure_point);
  } else if (sure_comma) {
    found.mark = ',';
    found.is_seen = true;
    found.example = sure_comma;
  } else if (sure_point) {
    found.is_seen = true;
    found.example = sure_point;
  } else if (weak_comma) {
    found.mark = ',';
    found.is_seen = true;
    found.is_ambiguous = !prefers_comma;
    found.example = weak_comma;
  }
  return found;
}

}  // namespace thicklens::model
