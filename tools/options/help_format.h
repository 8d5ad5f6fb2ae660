#ifndef THICKLENS_TOOLS_OPTIONS_HELP_FORMAT_H_
#define THICKLENS_TOOLS_OPTIONS_HELP_FORMAT_H_

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace thicklens::tools {

// The form of --help. It leaves out which options each option needs or excludes: the descriptions
// say so where it matters, and the lists would be longer than these.
class HelpFormat final : public CLI::Formatter {
 public:
  std::string make_option_opts(const CLI::Option* option) const override;
  // Former names of options are not shown.
  std::string make_group(std::string group, bool is_positional,
                         std::vector<const CLI::Option*> options) const override;
};

// Makes -h the last option of the command, in this group of the help.
void MoveHelpFlagTo(const std::string& group, CLI::App* command);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_HELP_FORMAT_H_
