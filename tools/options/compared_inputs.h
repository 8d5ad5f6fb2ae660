#ifndef THICKLENS_TOOLS_OPTIONS_COMPARED_INPUTS_H_
#define THICKLENS_TOOLS_OPTIONS_COMPARED_INPUTS_H_

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "tools/options/light_field_options.h"

namespace thicklens::tools {

// --other-grid, --other-layout, --other-name and --other-view-order: each replaces the option
// without "other" for the second of two inputs. 0 or empty: not given.
struct OtherReadingOptions {
  int grid = 0;
  std::string layout, name, view_order;
};
void AddOtherReadingOptions(CLI::App* command, OtherReadingOptions* options);
// The options that state how the second input is read.
OptionNames OtherReadingOptionNames();
// Returns those of them that were given, "--other-grid".
std::vector<std::string> GivenNames(const OtherReadingOptions& options);

// An input as far as the rules below need it.
struct ComparedInput {
  std::string path;
  bool is_folder = false;
  bool is_own = false;  // a folder with lightfield.yaml, which states everything itself
};
ComparedInput ComparedInputOf(const std::string& path);  // throws Error if there is no such input

struct ComparedReadings {
  ReadingOptions reference, other;
};
// How both inputs are read. Options about the layout and the order of the views are for the inputs
// that do not state these themselves:
//   - A folder of thicklens gets none of them, unless both inputs are such folders.
//   - --layout is for the inputs of its kind, folder or file, if there is one; --name and
//     --view-order then go with it. --name without --layout is for folders, if there is one.
//   - --grid is for folders, if there is one: of a file it would be the size of lenslets.
//   - --view-order without --layout is refused for a folder and a file of other programs: it is not
//     known which is meant.
// Throws UsageError.
ComparedReadings ReadingsOf(const ReadingOptions& options, const OtherReadingOptions& replaced,
                            const ComparedInput& reference, const ComparedInput& other);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_COMPARED_INPUTS_H_
