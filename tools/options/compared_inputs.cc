#include "tools/options/compared_inputs.h"

#include <fmt/format.h>

#include <filesystem>
#include <system_error>

#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/io/light_field_io.h"
#include "tools/options/option_values.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

std::string NameOfLayout(const std::string& text) { return text.substr(0, text.find(':')); }

// The options that an input gets of those that were given for both.
ReadingOptions SharedOptions(const ReadingOptions& options, const ComparedInput& input,
                             const ComparedInput& partner) {
  ReadingOptions mine = options;
  const auto clear = [&mine] { mine.layout = mine.name = mine.view_order = ""; };
  if (input.is_own && !partner.is_own) {
    mine.grid = 0;
    clear();
    return mine;
  }
  // Only inputs that the options may be for are asked whether they fit better.
  const bool has_other_kind = !partner.is_own && partner.is_folder != input.is_folder;
  if (!has_other_kind) return mine;
  if (!input.is_folder) mine.grid = 0;
  if (!mine.layout.empty()) {
    if (io::IsLayoutOfFolders(NameOfLayout(mine.layout)) != input.is_folder) clear();
  } else if (!input.is_folder) {
    mine.name = "";
  }
  return mine;
}

}  // namespace

void AddOtherReadingOptions(CLI::App* command, OtherReadingOptions* options) {
  command->add_option("--other-grid", options->grid, "As --grid, for OTHER only")
      ->check(CLI::Range(1, kMaxGrid))
      ->type_name("N");
  command->add_option("--other-layout", options->layout, "As --layout, for OTHER only")
      ->type_name("NAME[:UxV]");
  command->add_option("--other-name", options->name, "As --name, for OTHER only")
      ->type_name("PATTERN");
  command
      ->add_option("--other-view-order", options->view_order,
                   "As --view-order, for OTHER only; none: its views are in order")
      ->type_name("CHANGES");
}

OptionNames OtherReadingOptionNames() {
  OptionNames names = {{"hci_grid", "--other-grid"},
                       {"layout", "--other-layout"},
                       {"view_name", "--other-name"},
                       {"view_order", "--other-view-order"}};
  return names.Add(ReadingOptionNames());
}

std::vector<std::string> GivenNames(const OtherReadingOptions& options) {
  std::vector<std::string> names;
  if (options.grid > 0) names.emplace_back("--other-grid");
  if (!options.layout.empty()) names.emplace_back("--other-layout");
  if (!options.name.empty()) names.emplace_back("--other-name");
  if (!options.view_order.empty()) names.emplace_back("--other-view-order");
  return names;
}

ComparedInput ComparedInputOf(const std::string& path) {
  std::error_code failure;
  const fs::file_status status = fs::status(path, failure);
  if (!fs::exists(status))
    throw Error(fmt::format("{}: there is no such file or folder", PrintableUtf8(path)));
  ComparedInput input{path, fs::is_directory(status), false};
  input.is_own = input.is_folder && fs::exists(fs::path(path) / io::kLightFieldMarker, failure);
  return input;
}

ComparedReadings ReadingsOf(const ReadingOptions& options, const OtherReadingOptions& replaced,
                            const ComparedInput& reference, const ComparedInput& other) {
  const bool are_of_two_kinds =
      !reference.is_own && !other.is_own && reference.is_folder != other.is_folder;
  if (are_of_two_kinds && !options.view_order.empty() && options.layout.empty() &&
      replaced.view_order.empty()) {
    throw UsageError(fmt::format(
        "--view-order {}: {} and {} have different layouts, and which of them it is for is not "
        "known: --layout must state it, or --other-view-order (none: the views of {} are in order)",
        options.view_order, PrintableUtf8(reference.path), PrintableUtf8(other.path),
        PrintableUtf8(other.path)));
  }
  ComparedReadings readings{SharedOptions(options, reference, other),
                            SharedOptions(options, other, reference)};
  if (replaced.grid > 0) readings.other.grid = replaced.grid;
  if (!replaced.layout.empty()) readings.other.layout = replaced.layout;
  if (!replaced.name.empty()) readings.other.name = replaced.name;
  if (!replaced.view_order.empty()) readings.other.view_order = replaced.view_order;
  // These report wrong usage. What is wrong for both is reported about the first.
  LightFieldReadOptionsOf(readings.reference);
  LightFieldReadOptionsOf(readings.other, "--other-");
  return readings;
}

}  // namespace thicklens::tools
