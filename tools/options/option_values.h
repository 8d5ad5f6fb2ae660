#ifndef THICKLENS_TOOLS_OPTIONS_OPTION_VALUES_H_
#define THICKLENS_TOOLS_OPTIONS_OPTION_VALUES_H_

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/error.h"

namespace thicklens::tools {

// A command line that makes no sense: exit code 2.
class UsageError : public Error {
 public:
  using Error::Error;
};

// Checks of CLI11 for numbers; unlike CLI11's own checks they reject NaN and infinities.
CLI::Validator Finite();
CLI::Validator NonNegative();
// Checks lo <= value <= hi, or lo < value <= hi for lo = 0; `hint` says what is meant.
CLI::Validator Between(double lo, double hi, const std::string& hint);
// Checks lo < value < hi.
CLI::Validator Inside(double lo, double hi, const std::string& hint);

// Checks the name of a transfer curve: linear, srgb, gamma-2.2.
CLI::Validator TransferCurveName();

// Returns the finite numbers of a text such as "3,4,640,480". Throws UsageError that names the
// option, the invalid text and `form`, e.g. "x,y,width,height".
std::vector<double> SplitNumbers(const std::string& option, const std::string& text, char separator,
                                 const std::string& form);
// Returns whole numbers from `least` to `most`, likewise.
std::vector<int> SplitWhole(const std::string& option, const std::string& text, char separator,
                            const std::string& form, int least, int most);
// Returns whole numbers from 0 to 100000 px, likewise.
std::vector<int> SplitPixels(const std::string& option, const std::string& text, char separator,
                             const std::string& form);

// Adds an option whose value is a number of at least 0, with its unit or without: "2s", "2".
// `example` is its type in the help.
CLI::Option* AddNumberWithUnit(CLI::App* command, const std::string& name, const std::string& unit,
                               const std::string& example, const std::string& help,
                               std::optional<double>* value);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_OPTION_VALUES_H_
