#ifndef THICKLENS_TOOLS_OPTIONS_WRONG_USAGE_H_
#define THICKLENS_TOOLS_OPTIONS_WRONG_USAGE_H_

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace thicklens::tools {

// Returns the name that `typed` was probably meant to be: one that differs by few letters, or that
// begins with it. Empty: none.
std::string NearestName(const std::string& typed, const std::vector<std::string>& names);

// Returns whether a command line that `program` could not parse by `error` ends where a command is
// expected, and has nothing that is wrong before: `thicklens`, `thicklens camera`.
bool EndsBeforeACommand(const CLI::App& program, const CLI::ParseError& error);

// Returns in one line what is wrong with a command line that `program` could not parse: the first
// unknown command or option, with the nearest known one, otherwise what the error says.
std::string WrongUsageText(const CLI::App& program, const CLI::ParseError& error);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_WRONG_USAGE_H_
