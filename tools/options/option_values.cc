#include "tools/options/option_values.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <optional>
#include <sstream>

#include "thicklens/model/transfer_curve.h"

namespace thicklens::tools {
namespace {

constexpr int kMaxPixels = 100000;

std::optional<double> FiniteNumber(const std::string& text) {
  const char* begin = text.data() + (text.rfind('+', 0) == 0 ? 1 : 0);
  const char* end = text.data() + text.size();
  double value = 0;
  const auto [rest, status] = std::from_chars(begin, end, value);
  if (status != std::errc() || rest != end || begin == end || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

// CLI11 puts the option's name in front of the returned text; an empty text means valid.
template <typename Condition>
CLI::Validator NumberThat(const std::string& must, Condition condition) {
  return CLI::Validator(
      [must, condition](std::string& text) {
        const std::optional<double> value = FiniteNumber(text);
        if (!value) return fmt::format("a finite number is expected, found '{}'", text);
        return condition(*value) ? std::string() : fmt::format("must be {}, found {}", must, text);
      },
      "");
}

UsageError WrongForm(const std::string& option, const std::string& text, const std::string& form) {
  return UsageError(fmt::format("{}: {} is expected, found '{}'", option, form, text));
}

// Parses a number of at least 0 with its unit, which may be left out.
std::optional<double> NumberWithUnit(const std::string& text, const std::string& unit) {
  double value = 0;
  const char* end = text.data() + text.size();
  const auto [read, failure] = std::from_chars(text.data(), end, value);
  if (failure != std::errc() || !std::isfinite(value) || value < 0) return std::nullopt;
  const std::string rest(read, end);
  return rest.empty() || rest == unit ? std::optional(value) : std::nullopt;
}

}  // namespace

CLI::Validator Finite() {
  return NumberThat("finite", [](double) { return true; });
}

CLI::Validator NonNegative() {
  return NumberThat(">= 0", [](double value) { return value >= 0; });
}

CLI::Validator Between(double lo, double hi, const std::string& hint) {
  const std::string must = lo == 0 ? fmt::format("above 0 and at most {} ({})", hi, hint)
                                   : fmt::format("from {} to {} ({})", lo, hi, hint);
  return NumberThat(
      must, [lo, hi](double value) { return (lo == 0 ? value > 0 : value >= lo) && value <= hi; });
}

CLI::Validator TransferCurveName() {
  return CLI::Validator(
      [](std::string& name) {
        try {
          model::TransferCurve::FromName(name);
          return std::string();
        } catch (const Error& error) {
          return std::string(error.what());
        }
      },
      "");
}

CLI::Validator Inside(double lo, double hi, const std::string& hint) {
  return NumberThat(fmt::format("above {} and below {} ({})", lo, hi, hint),
                    [lo, hi](double value) { return value > lo && value < hi; });
}

std::vector<double> SplitNumbers(const std::string& option, const std::string& text, char separator,
                                 const std::string& form) {
  std::vector<double> numbers;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, separator);) {
    const std::optional<double> number = FiniteNumber(part);
    if (!number) throw WrongForm(option, text, form);
    numbers.push_back(*number);
  }
  if (numbers.empty() || text.back() == separator) throw WrongForm(option, text, form);
  return numbers;
}

std::vector<int> SplitWhole(const std::string& option, const std::string& text, char separator,
                            const std::string& form, int least, int most) {
  std::vector<int> whole;
  for (const double number : SplitNumbers(option, text, separator, form)) {
    if (!(number >= least) || !(number <= most) || number != std::floor(number)) {
      throw UsageError(
          fmt::format("{}: {}, each a whole number from {} to {}, is expected, found "
                      "'{}'",
                      option, form, least, most, text));
    }
    whole.push_back(static_cast<int>(number));
  }
  return whole;
}

std::vector<int> SplitPixels(const std::string& option, const std::string& text, char separator,
                             const std::string& form) {
  return SplitWhole(option, text, separator, form + " in px", 0, kMaxPixels);
}

CLI::Option* AddNumberWithUnit(CLI::App* command, const std::string& name, const std::string& unit,
                               const std::string& example, const std::string& help,
                               std::optional<double>* value) {
  return command
      ->add_option_function<std::string>(
          name,
          [=](const std::string& text) {
            *value = NumberWithUnit(text, unit);
            if (!*value) {
              throw CLI::ValidationError(
                  name, fmt::format("a number such as {} is expected, found '{}'", example, text));
            }
          },
          help)
      ->type_name(example);
}

}  // namespace thicklens::tools
