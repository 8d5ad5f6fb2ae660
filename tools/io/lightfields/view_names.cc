#include "tools/io/lightfields/view_names.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <map>
#include <set>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"

namespace thicklens::io {
namespace {

// Digits of a row, a column or a number, which may be negative: an int holds them.
constexpr std::size_t kMaxDigits = 8;
constexpr char kWhole[] = "([-+]?[0-9]{1,8})";
constexpr char kReal[] = "([-+]?[0-9]{1,12}(?:\\.[0-9]{0,18})?)";
// A number with any sign, or with letters that may stand for one.
constexpr char kAnySign[] = "(?:[-+mnpMNP]|neg|pos|minus|plus)?[0-9]{1,8}";
// Longer names than file systems have are not matched: the time of a match grows with the length.
constexpr std::size_t kMaxName = 255;

bool IsDigit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

std::size_t CountOf(const std::string& text, char c) {
  return static_cast<std::size_t>(std::count(text.begin(), text.end(), c));
}

bool IsLetter(char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; }

// The meaning of a '-' or a '+' before a number in names of one kind.
enum class SignRule {
  kNotAfterDigit,   // a sign; between digits it separates two numbers
  kAlsoAfterDigit,  // a sign also there: names of "%+d%+d"
  kAfterDash        // a sign only behind a '-' that separates: names of "img-%d-%d", "img--2-1.png"
};

// Whether the character is the sign of a number.
bool IsSign(const std::string& name, std::size_t i, SignRule rule) {
  if ((name[i] != '-' && name[i] != '+') || i + 1 >= name.size() || !IsDigit(name[i + 1]))
    return false;
  if (rule == SignRule::kAfterDash) return i > 0 && name[i - 1] == '-';
  return i == 0 || !IsDigit(name[i - 1]) || rule == SignRule::kAlsoAfterDigit;
}
bool IsSigned(const std::string& number) { return number.front() == '-' || number.front() == '+'; }

// Whether a '+' is between digits of a name, as in "cam-2+1.png": names of "%+d%+d".
bool HasSignAfterDigit(const std::string& name) {
  for (std::size_t i = 1; i + 1 < name.size(); ++i) {
    if (name[i] == '+' && IsDigit(name[i - 1]) && IsDigit(name[i + 1])) return true;
  }
  return false;
}

// Whether two dashes are before a number, as in "img--2-1.png": the first separates.
bool HasDashBeforeSign(const std::string& name) {
  for (std::size_t i = 0; i + 2 < name.size(); ++i) {
    if (name[i] == '-' && name[i + 1] == '-' && IsDigit(name[i + 2])) return true;
  }
  return false;
}

// The name with a mark for each number and each sign: names of one kind have one template.
std::string TemplateOf(const std::string& name) {
  std::string text;
  for (std::size_t i = 0; i < name.size(); ++i) {
    if (IsDigit(name[i])) {
      if (i == 0 || !IsDigit(name[i - 1])) text += '0';
    } else {
      text += name[i] == '+' ? '-' : name[i];
    }
  }
  return text;
}

// A name as text and numbers in turn: text[0] number[0] text[1] ...
struct SplitName {
  std::vector<std::string> text, numbers;
};

SplitName Split(const std::string& name, SignRule rule) {
  SplitName split;
  split.text.emplace_back();
  for (std::size_t i = 0; i < name.size();) {
    if (!IsDigit(name[i]) && !IsSign(name, i, rule)) {
      split.text.back() += name[i++];
      continue;
    }
    std::string number(1, name[i++]);
    while (i < name.size() && IsDigit(name[i])) number += name[i++];
    split.numbers.push_back(number);
    split.text.emplace_back();
  }
  return split;
}

// Names of one kind by the texts between their numbers.
using NameGroups = std::map<std::vector<std::string>, std::vector<SplitName>>;

NameGroups::const_iterator LargestOf(const NameGroups& groups) {
  return std::max_element(groups.begin(), groups.end(), [](const auto& a, const auto& b) {
    return a.second.size() < b.second.size();
  });
}

// The name with a mark for each number, and without the dashes and signs before it.
std::string KindOf(const std::string& name) {
  std::string kind;
  for (std::size_t i = 0; i < name.size(); ++i) {
    if (IsDigit(name[i])) {
      while (!kind.empty() && (kind.back() == '-' || kind.back() == '+')) kind.pop_back();
      if (i == 0 || !IsDigit(name[i - 1])) kind += '0';
    } else {
      kind += name[i];
    }
  }
  return kind;
}

// Two dashes before a number are a text and a sign both in names of "img-%d-%d" and of "img%d-%d";
// in the former, one dash is a text. The meaning is the one by which more names of that kind are
// alike.
NameGroups GroupsOf(const std::vector<std::string>& names) {
  std::map<std::string, std::vector<std::string>> kinds;
  for (const std::string& name : names) kinds[KindOf(name)].push_back(name);
  // A '+' between digits of another image says nothing of these.
  std::set<std::string> with_sign_after_digit;
  for (const std::string& name : names) {
    if (HasSignAfterDigit(name)) with_sign_after_digit.insert(TemplateOf(name));
  }
  NameGroups groups;
  for (const auto& [kind, of_kind] : kinds) {
    NameGroups found;
    for (const std::string& name : of_kind) {
      const SplitName split =
          Split(name, with_sign_after_digit.count(TemplateOf(name)) > 0 ? SignRule::kAlsoAfterDigit
                                                                        : SignRule::kNotAfterDigit);
      found[split.text].push_back(split);
    }
    if (std::any_of(of_kind.begin(), of_kind.end(), HasDashBeforeSign)) {
      NameGroups behind_dashes;
      for (const std::string& name : of_kind) {
        const SplitName split = Split(name, SignRule::kAfterDash);
        behind_dashes[split.text].push_back(split);
      }
      if (LargestOf(behind_dashes)->second.size() > LargestOf(found)->second.size())
        found = std::move(behind_dashes);
    }
    for (const auto& [text, group] : found) {
      std::vector<SplitName>& all = groups[text];
      all.insert(all.end(), group.begin(), group.end());
    }
  }
  return groups;
}

// The meaning of the '-' or '+' before the numbers at one place of the names.
enum class Dash {
  kSign,   // numbers differ in it
  kText,   // there is none, or all have a '+', or a '-' that follows a letter as in "IMG-1"
  kEither  // all numbers have it after a separator: they count down, or it separates too
};
Dash DashAt(const std::vector<SplitName>& group, std::size_t place) {
  const auto count_of = [&](char sign) {
    return static_cast<std::size_t>(
        std::count_if(group.begin(), group.end(),
                      [&](const SplitName& name) { return name.numbers[place].front() == sign; }));
  };
  const std::size_t minus = count_of('-'), plus = count_of('+');
  if (minus == 0 && (plus == 0 || plus == group.size())) return Dash::kText;
  if (minus < group.size()) return Dash::kSign;
  const std::string& before = group.front().text[place];
  const bool is_after_letter =
      !before.empty() && std::isalnum(static_cast<unsigned char>(before.back())) != 0;
  return is_after_letter ? Dash::kText : Dash::kEither;
}

// Places of the numbers that are not equal in all names.
std::vector<std::size_t> ChangingPlaces(const std::vector<SplitName>& group) {
  std::vector<std::size_t> changing;
  for (std::size_t i = 0; i < group.front().numbers.size(); ++i) {
    if (std::any_of(group.begin(), group.end(), [&](const SplitName& name) {
          return name.numbers[i] != group.front().numbers[i];
        })) {
      changing.push_back(i);
    }
  }
  return changing;
}

// Whether one or two numbers change. The times of photographs, for example, are too long for Match.
bool MayBePlaces(const std::vector<SplitName>& group, const std::vector<std::size_t>& changing) {
  if (changing.empty() || changing.size() > 2) return false;
  for (const SplitName& name : group) {
    for (const std::size_t i : changing) {
      if (name.numbers[i].size() - (IsSigned(name.numbers[i]) ? 1 : 0) > kMaxDigits) return false;
    }
  }
  return true;
}

// Whether two numbers change and every row has every column.
bool IsFullGrid(const std::vector<SplitName>& group, const std::vector<std::size_t>& changing) {
  if (changing.size() != 2) return false;
  std::set<int> rows, columns;
  std::set<std::pair<int, int>> places;
  for (const SplitName& name : group) {
    const int row = std::atoi(name.numbers[changing[0]].c_str());
    const int column = std::atoi(name.numbers[changing[1]].c_str());
    rows.insert(row);
    columns.insert(column);
    places.emplace(row, column);
  }
  return rows.size() > 1 && columns.size() > 1 && places.size() == group.size() &&
         rows.size() * columns.size() == group.size();
}

// The axis that the letters before a number name: 'u' for columns, 'v' for rows, or 0.
char AxisInText(const std::string& text) {
  std::size_t end = text.size();
  while (end > 0 && !IsLetter(text[end - 1])) --end;
  std::string word;
  for (std::size_t i = end; i > 0 && IsLetter(text[i - 1]); --i) {
    word.insert(word.begin(),
                static_cast<char>(std::tolower(static_cast<unsigned char>(text[i - 1]))));
  }
  for (const char* column : {"u", "x", "c", "col", "column"}) {
    if (word == column) return 'u';
  }
  for (const char* row : {"v", "y", "r", "row"}) {
    if (word == row) return 'v';
  }
  return 0;
}

// The pattern of a group of names with these texts between the numbers. Rows come before columns
// unless letters before both numbers say otherwise, as in "x0y1".
NameProposal ProposalOf(const std::vector<std::string>& text, const std::vector<SplitName>& group,
                        const std::vector<std::size_t>& changing) {
  NameProposal proposal;
  proposal.changing = static_cast<int>(changing.size());
  proposal.names = group.size();
  const bool is_column_first = changing.size() == 2 && AxisInText(text[changing[0]]) == 'u' &&
                               AxisInText(text[changing[1]]) == 'v';
  const char* const places[] = {proposal.changing == 1 ? "{n}"
                                : is_column_first      ? "{u}"
                                                       : "{v}",
                                is_column_first ? "{v}" : "{u}"};
  std::string with_signs;
  for (std::size_t i = 0; i < text.size(); ++i) {
    proposal.pattern += text[i];
    with_signs += text[i];
    if (i >= group.front().numbers.size()) break;
    const std::string& first = group.front().numbers[i];
    const auto place = std::find(changing.begin(), changing.end(), i);
    std::string number = first;
    if (place != changing.end()) {
      const Dash dash = DashAt(group, i);
      number = places[place - changing.begin()];
      const std::string with_text = IsSigned(first) ? first.substr(0, 1) + number : number;
      with_signs += dash == Dash::kText ? with_text : number;
      if (dash == Dash::kEither) proposal.is_sign_unclear = true;
      if (dash != Dash::kSign) number = with_text;
    } else {
      with_signs += number;
    }
    proposal.pattern += number;
  }
  if (proposal.is_sign_unclear) proposal.other_pattern = with_signs;
  return proposal;
}

// Names that fit the pattern but for signs.
std::vector<std::string> OfOtherSigns(const NamePattern& pattern,
                                      const std::vector<std::string>& names) {
  std::vector<std::string> found;
  for (const std::string& name : names) {
    if (!pattern.Match(name) && pattern.MatchesUpToSigns(name)) found.push_back(name);
  }
  return found;
}

// Appends text to a regular expression.
void AppendText(const std::string& text, std::string* expression) {
  for (const char c : text) {
    if (std::string("\\^$.|?+()[]{}/").find(c) != std::string::npos) *expression += '\\';
    *expression += c;
  }
}

// Takes a sign, or letters that may stand for one, off the end of the text before a number.
std::string WithoutSign(const std::string& text) {
  for (const char* sign : {"minus", "plus", "neg", "pos", "m", "n", "p", "M", "N", "P", "-", "+"}) {
    const std::string word = sign;
    if (text.size() < word.size() ||
        text.compare(text.size() - word.size(), word.size(), word) != 0) {
      continue;
    }
    const std::string rest = text.substr(0, text.size() - word.size());
    // "cam1" has no sign.
    if (!IsLetter(word.front()) || rest.empty() || !IsLetter(rest.back())) return rest;
  }
  return text;
}

}  // namespace

NamePattern::NamePattern(const std::string& pattern) : text_(pattern) {
  std::string expression, any_signs, text;  // `text` is what follows the last place or star
  const auto end_text = [&](const std::string& kept) {
    AppendText(text, &expression);
    AppendText(kept, &any_signs);
    text.clear();
  };
  for (std::size_t i = 0; i < pattern.size(); ++i) {
    const char c = pattern[i];
    if (c == '{' && i + 2 < pattern.size() && pattern[i + 2] == '}') {
      const char place = pattern[i + 1];
      if (std::string("uvnxy").find(place) == std::string::npos) {
        throw Error(fmt::format(
            "the option name: {{v}} (row), {{u}} (column), {{n}} (number, row by row), {{x}} and "
            "{{y}} (position) are expected, found {{{}}} in '{}'",
            PrintableUtf8(std::string(1, place)), PrintableUtf8(pattern)));
      }
      if (place == 'x' || place == 'y') {
        end_text(text);
        any_signs += kReal;
      } else {
        // A '-' alone between two numbers separates them too.
        const std::string without = WithoutSign(text);
        const bool separates = without.empty() && !places_.empty();
        end_text(separates ? text : without);
        any_signs += kAnySign;
      }
      expression += place == 'x' || place == 'y' ? kReal : kWhole;
      places_ += place;
      i += 2;
    } else if (c == '*') {
      end_text(text);
      expression += ".*";
      any_signs += ".*";
    } else {
      text += c;
    }
  }
  end_text(text);
  for (const char place : places_) {
    if (CountOf(places_, place) > 1) {
      throw Error(fmt::format("the option name: {{{}}} is expected once, found {} times in '{}'",
                              place, CountOf(places_, place), PrintableUtf8(pattern)));
    }
  }
  has_row_and_column_ = CountOf(places_, 'u') == 1 && CountOf(places_, 'v') == 1;
  const bool has_number = CountOf(places_, 'n') == 1;
  const bool has_half = !has_row_and_column_ && CountOf(places_, 'u') + CountOf(places_, 'v') > 0;
  if (has_half || has_row_and_column_ == has_number || pattern.size() > kMaxName) {
    throw Error(fmt::format(
        "the option name: a pattern of at most {} letters with {{v}} (row) and {{u}} (column), or "
        "with {{n}} (number, row by row) is expected, e.g. 'view_{{v}}_{{u}}.jpg', found '{}'",
        kMaxName, PrintableUtf8(pattern)));
  }
  try {
    expression_ = std::regex(expression);
    any_signs_ = std::regex(any_signs);
  } catch (const std::regex_error&) {
    throw Error(fmt::format("the option name: '{}' is too complicated", PrintableUtf8(pattern)));
  }
}

std::optional<NameNumbers> NamePattern::Match(const std::string& name) const {
  std::smatch found;
  try {
    if (name.size() > kMaxName || !std::regex_match(name, found, expression_)) return std::nullopt;
  } catch (const std::regex_error&) {
    return std::nullopt;
  }
  NameNumbers numbers;
  for (std::size_t i = 0; i < places_.size(); ++i) {
    const std::string text = found[i + 1].str();
    switch (places_[i]) {
      case 'u':
        numbers.u = std::atoi(text.c_str());
        break;
      case 'v':
        numbers.v = std::atoi(text.c_str());
        break;
      case 'n':
        numbers.n = std::atoi(text.c_str());
        break;
      case 'x':
        numbers.x = std::atof(text.c_str());
        break;
      default:
        numbers.y = std::atof(text.c_str());
    }
  }
  return numbers;
}

bool NamePattern::MatchesUpToSigns(const std::string& name) const {
  try {
    return name.size() <= kMaxName && std::regex_match(name, any_signs_);
  } catch (const std::regex_error&) {
    return false;
  }
}

std::optional<NameProposal> ProposedPattern(const std::vector<std::string>& names) {
  const NameGroups groups = GroupsOf(names);
  const auto largest = LargestOf(groups);
  if (largest == groups.end() || largest->second.size() < 2) return std::nullopt;
  const std::vector<SplitName>& group = largest->second;
  const std::vector<std::size_t> changing = ChangingPlaces(group);
  if (!MayBePlaces(group, changing)) return std::nullopt;
  NameProposal proposal = ProposalOf(largest->first, group, changing);
  try {
    proposal.other_signs = OfOtherSigns(NamePattern(proposal.pattern), names);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error&) {
    // A name with braces of its own: whoever reads the views says so.
  }
  for (const auto& [text, others] : groups) {
    if (text == largest->first || others.size() < 2) continue;
    const std::vector<std::size_t> places = ChangingPlaces(others);
    if (places.size() != changing.size() || !MayBePlaces(others, places)) continue;
    const std::string pattern = ProposalOf(text, others, places).pattern;
    const bool is_large = 2 * others.size() >= group.size();
    // Masks of some views are no second light field beside a full one.
    const bool is_clear = IsFullGrid(group, changing) && !IsFullGrid(others, places);
    if (is_large && !is_clear) {
      proposal.other_patterns.push_back(pattern);
    } else if (is_large || IsFullGrid(others, places)) {
      proposal.smaller_patterns.push_back(pattern);
    }
  }
  return proposal;
}

void RequireClear(const std::string& path, const NameProposal& proposal) {
  // A single name may be that of anything: it is reported (AddWarningsOfNames).
  if (proposal.other_signs.size() > 1) {
    throw Error(fmt::format(
        "{}: names fit '{}' but for what stands before their numbers, which may be signs: {}; '-' "
        "and '+' are read as signs, letters are not: rename the images, or the option name must "
        "state which of them are the views: '{}'",
        path, PrintableUtf8(proposal.pattern), Listed(proposal.other_signs),
        PrintableUtf8(proposal.pattern)));
  }
  if (!proposal.other_patterns.empty()) {
    std::vector<std::string> patterns;
    for (const std::string& pattern : proposal.other_patterns)
      patterns.push_back(fmt::format("'{}'", pattern));
    throw Error(fmt::format(
        "{}: images of several kinds have names with rows and columns: the option name must state "
        "which of them are the views: '{}' or {}",
        path, PrintableUtf8(proposal.pattern), Listed(patterns)));
  }
  if (proposal.is_sign_unclear) {
    throw Error(fmt::format(
        "{}: all numbers at one place of the names follow a '-', which may be a minus sign or "
        "separate them: the option name must state it: '{}' (the views count up) or '{}' (minus "
        "signs)",
        path, PrintableUtf8(proposal.pattern), PrintableUtf8(proposal.other_pattern)));
  }
}

ViewGrid GridOfNames(const std::string& path, const NamePattern& pattern,
                     const std::vector<std::string>& names, const LightFieldReading& reading,
                     std::vector<std::string>* others, std::optional<int> first) {
  std::vector<NumberedView> views;
  for (const std::string& name : names) {
    const std::optional<NameNumbers> numbers = pattern.Match(name);
    if (!numbers) {
      others->push_back(name);
    } else if (pattern.HasRowAndColumn()) {
      views.push_back({*numbers->u, *numbers->v, name});
    } else {
      views.push_back({*numbers->n, 0, name});
    }
  }
  if (views.empty()) {
    const std::optional<NameProposal> proposal = ProposedPattern(names);
    throw Error(fmt::format("{}: no name fits '{}'; found {} image(s): {}{}", path,
                            PrintableUtf8(pattern.text()), names.size(), Listed(names),
                            proposal
                                ? fmt::format("; '{}' would fit {} of them",
                                              PrintableUtf8(proposal->pattern), proposal->names)
                                : ""));
  }
  return pattern.HasRowAndColumn() ? GridOfViews(path, views, reading)
                                   : GridOfNumbers(path, views, reading, first);
}

void AddWarningsOfNames(const std::string& path, const NamePattern& pattern,
                        const std::optional<NameProposal>& proposal,
                        const std::vector<std::string>& others, ViewSource* source) {
  if (proposal && !proposal->smaller_patterns.empty()) {
    source->notices.push_back(fmt::format(
        "{}: other images have names with rows and columns too and are not read: {}; the option "
        "name states which of them are the views",
        path, Listed(proposal->smaller_patterns)));
  }
  const std::vector<std::string> other_signs = OfOtherSigns(pattern, others);
  if (!other_signs.empty()) {
    source->notices.push_back(fmt::format(
        "{}: {} image(s) are not read whose names fit '{}' but for signs, or letters that may "
        "stand for signs: {}",
        path, other_signs.size(), PrintableUtf8(pattern.text()), Listed(other_signs)));
  }
}

}  // namespace thicklens::io
