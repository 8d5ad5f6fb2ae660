#include "tools/options/help_format.h"

#include <fmt/format.h>

#include <utility>

#include "tools/options/deprecated_names.h"

namespace thicklens::tools {

std::string HelpFormat::make_option_opts(const CLI::Option* option) const {
  if (!option->get_option_text().empty()) return " " + option->get_option_text();
  if (option->get_type_size() == 0) return "";  // a flag
  std::string text;
  if (!option->get_type_name().empty()) text += " " + get_label(option->get_type_name());
  if (!option->get_default_str().empty()) text += "=" + option->get_default_str();
  if (option->get_expected_max() == CLI::detail::expected_max_vector_size) {
    text += " ...";
  } else if (option->get_expected_min() > 1) {
    text += fmt::format(" x {}", option->get_expected());
  }
  if (option->get_required()) text += " " + get_label("REQUIRED");
  return text;
}

std::string HelpFormat::make_group(std::string group, bool is_positional,
                                   std::vector<const CLI::Option*> options) const {
  if (group == kFormerNamesGroup) return "";
  return CLI::Formatter::make_group(std::move(group), is_positional, std::move(options));
}

void MoveHelpFlagTo(const std::string& group, CLI::App* command) {
  const std::string description = command->get_help_ptr()->get_description();
  command->set_help_flag("-h,--help", description)->group(group);
}

}  // namespace thicklens::tools
