#ifndef THICKLENS_TOOLS_OPTIONS_DEPRECATED_NAMES_H_
#define THICKLENS_TOOLS_OPTIONS_DEPRECATED_NAMES_H_

#include <CLI/CLI.hpp>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tools/options/command_frame.h"

namespace thicklens::tools {

enum class NameKind { kCommand, kOption, kValue, kHardCase, kYaml, kJson, kColumn };

// The group of former options, which the help does not show. An option of no group would have no
// name in the errors of CLI11.
inline constexpr char kFormerNamesGroup[] = "Former names";

// A name of the program's interface that was renamed. Its former name is accepted, or written
// beside the present one, until version 1.0.
struct DeprecatedName {
  NameKind kind;
  std::string former, now;
  std::string where;  // commands or files, for the documentation
  // A JSON key that may mean something else in other objects is renamed in those alone that have
  // this key (by its present name); empty: in all.
  std::string beside = "";
};

// All of them. docs/file-formats.md and CHANGELOG.md list them as well, which a test compares.
const std::vector<DeprecatedName>& DeprecatedNames();

// The former names of a command or an option.
std::vector<std::string> FormerNames(NameKind kind, const std::string& now);
// Returns the present name, and `name` itself if it was never renamed.
std::string PresentName(NameKind kind, const std::string& name);

// Adds the former names of a flag to a command. --help does not show them, and each use is noted
// in `common`.
void AddDeprecatedFlags(CLI::App* command, const std::string& now, bool* flag,
                        CommonOptions* common);

// Adds the former names of an option with one value, which `take` gets. --help does not show them,
// and each use is noted in `common`. Throws UsageError while the command line is read if the option
// is given by its present name too.
void AddDeprecatedOptions(CLI::App* command, const std::string& now,
                          const std::function<void(const std::string&)>& take,
                          CommonOptions* common);

// Lets an option accept the former names of its values. Each use is noted in `common`.
void AcceptDeprecatedValues(CLI::Option* option, CommonOptions* common);

// Adds the former names of all keys, with the same values, to what a command writes.
void AddDeprecatedKeys(nlohmann::json* written);

// Gives the former names of keys their present names in what was read from a file. Throws Error if
// an object has both names with different values; `source` is the name of the file.
void AcceptDeprecatedKeys(const std::string& source, nlohmann::json* read);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_DEPRECATED_NAMES_H_
