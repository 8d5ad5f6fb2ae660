#include "tools/io/lightfields/view_names.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <map>

#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"

namespace thicklens::io {
namespace {

// Digits of a row, a column or a number, which may be negative: an int holds them.
constexpr std::size_t kMaxDigits = 8;
constexpr char kWhole[] = "(-?[0-9]{1,8})";
constexpr char kReal[] = "([-+]?[0-9]{1,12}(?:\\.[0-9]{0,18})?)";
// Longer names than file systems have are not matched: the time of a match grows with the length.
constexpr std::size_t kMaxName = 255;

bool IsDigit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

std::size_t CountOf(const std::string& text, char c) {
  return static_cast<std::size_t>(std::count(text.begin(), text.end(), c));
}

// Whether the character begins a number: a '-' before digits may be its sign, but between digits it
// separates two numbers.
bool IsSign(const std::string& name, std::size_t i) {
  return name[i] == '-' && i + 1 < name.size() && IsDigit(name[i + 1]) &&
         (i == 0 || !IsDigit(name[i - 1]));
}
bool IsSigned(const std::string& number) { return number.front() == '-'; }

// A name as text and numbers in turn: text[0] number[0] text[1] ...
struct SplitName {
  std::vector<std::string> text, numbers;
};

SplitName Split(const std::string& name) {
  SplitName split;
  split.text.emplace_back();
  for (std::size_t i = 0; i < name.size();) {
    if (!IsDigit(name[i]) && !IsSign(name, i)) {
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

// The meaning of the '-' before the numbers at one place of the names.
enum class Dash {
  kSign,   // some numbers have it and others do not
  kText,   // there is none, or it follows a letter as in "IMG-1"
  kEither  // all numbers have it after a separator: they count down, or it separates too
};
Dash DashAt(const std::vector<SplitName>& group, std::size_t place) {
  const auto count = static_cast<std::size_t>(
      std::count_if(group.begin(), group.end(),
                    [&](const SplitName& name) { return IsSigned(name.numbers[place]); }));
  if (count == 0) return Dash::kText;
  if (count < group.size()) return Dash::kSign;
  const std::string& before = group.front().text[place];
  const bool is_after_letter =
      !before.empty() && std::isalnum(static_cast<unsigned char>(before.back())) != 0;
  return is_after_letter ? Dash::kText : Dash::kEither;
}

// The group of names whose texts are these except the ending of the file, if there is one of at
// least half the size.
std::string OtherEnding(const std::map<std::vector<std::string>, std::vector<SplitName>>& groups,
                        const std::vector<std::string>& text, std::size_t size) {
  const auto without_ending = [](std::vector<std::string> texts) {
    texts.back() = texts.back().substr(0, texts.back().rfind('.'));
    return texts;
  };
  for (const auto& [other, names] : groups) {
    if (other != text && other.back().find('.') != std::string::npos && 2 * names.size() >= size &&
        without_ending(other) == without_ending(text)) {
      return other.back();
    }
  }
  return "";
}

}  // namespace

NamePattern::NamePattern(const std::string& pattern) : text_(pattern) {
  std::string expression;
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
      expression += place == 'x' || place == 'y' ? kReal : kWhole;
      places_ += place;
      i += 2;
    } else if (c == '*') {
      expression += ".*";
    } else {
      if (std::string("\\^$.|?+()[]{}/").find(c) != std::string::npos) expression += '\\';
      expression += c;
    }
  }
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

std::optional<NameProposal> ProposedPattern(const std::vector<std::string>& names) {
  std::map<std::vector<std::string>, std::vector<SplitName>> groups;
  for (const std::string& name : names) {
    SplitName split = Split(name);
    groups[split.text].push_back(split);
  }
  const auto largest = std::max_element(
      groups.begin(), groups.end(),
      [](const auto& a, const auto& b) { return a.second.size() < b.second.size(); });
  if (largest == groups.end() || largest->second.size() < 2) return std::nullopt;
  const std::vector<SplitName>& group = largest->second;
  std::vector<std::size_t> changing;
  for (std::size_t i = 0; i < group.front().numbers.size(); ++i) {
    if (std::any_of(group.begin(), group.end(), [&](const SplitName& name) {
          return name.numbers[i] != group.front().numbers[i];
        })) {
      changing.push_back(i);
    }
  }
  if (changing.empty() || changing.size() > 2) return std::nullopt;
  // The times of photographs, for example, are too long for Match.
  for (const SplitName& name : group) {
    for (const std::size_t i : changing) {
      if (name.numbers[i].size() - (IsSigned(name.numbers[i]) ? 1 : 0) > kMaxDigits)
        return std::nullopt;
    }
  }
  NameProposal proposal;
  proposal.changing = static_cast<int>(changing.size());
  proposal.names = group.size();
  const std::string ending = OtherEnding(groups, largest->first, group.size());
  const char* const places[] = {proposal.changing == 1 ? "{n}" : "{v}", "{u}"};
  std::string with_signs, with_other_ending;
  for (std::size_t i = 0; i < largest->first.size(); ++i) {
    const bool is_last = i >= group.front().numbers.size();
    proposal.pattern += largest->first[i];
    with_signs += largest->first[i];
    with_other_ending += is_last && !ending.empty() ? ending : largest->first[i];
    if (is_last) break;
    const auto place = std::find(changing.begin(), changing.end(), i);
    std::string number = group.front().numbers[i];
    if (place != changing.end()) {
      const Dash dash = DashAt(group, i);
      number = places[place - changing.begin()];
      with_signs +=
          dash == Dash::kText && IsSigned(group.front().numbers[i]) ? "-" + number : number;
      if (dash == Dash::kEither) proposal.is_sign_unclear = true;
      if (dash != Dash::kSign && IsSigned(group.front().numbers[i])) number = "-" + number;
    } else {
      with_signs += number;
    }
    proposal.pattern += number;
    with_other_ending += number;
  }
  if (proposal.is_sign_unclear) proposal.other_pattern = with_signs;
  if (!ending.empty()) proposal.other_ending_pattern = with_other_ending;
  return proposal;
}

void RequireClear(const std::string& path, const NameProposal& proposal) {
  if (!proposal.other_ending_pattern.empty()) {
    throw Error(fmt::format(
        "{}: names of images of two kinds differ in their ending only: the option name must state "
        "which of them are the views: '{}' or '{}'",
        path, PrintableUtf8(proposal.pattern), PrintableUtf8(proposal.other_ending_pattern)));
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
                     std::vector<std::string>* others) {
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
                                   : GridOfNumbers(path, views, reading);
}

}  // namespace thicklens::io
