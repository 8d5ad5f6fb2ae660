#ifndef THICKLENS_TOOLS_OPTIONS_INTERFACE_OPTIONS_H_
#define THICKLENS_TOOLS_OPTIONS_INTERFACE_OPTIONS_H_

#include <initializer_list>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "thicklens/run.h"
#include "tools/options/command_frame.h"
#include "tools/options/option_values.h"
#include "tools/system/progress_line.h"

namespace thicklens::tools {

// The options of a command that are members of the interface's option structs: the path of the
// member ("depth.meaning.unit") and the option that the user types ("--depth-unit"). An entry also
// stands for the members of a member: that of "views" names "views.u".
class OptionNames {
 public:
  OptionNames(std::initializer_list<std::pair<const std::string, std::string>> names)
      : names_(names) {}
  // Adds the entries of other names. An entry of the same path stays as it is.
  OptionNames& Add(const OptionNames& others);
  // The path itself if no entry stands for it.
  std::string operator()(const std::string& field) const;

 private:
  std::map<std::string, std::string> names_;
};

// An OptionError as the user of the command line understands it.
UsageError UsageErrorOf(const OptionError& error, const OptionNames& names);

// Calls the interface. An option that is not valid is an error of the command line.
template <typename Call>
auto WithOptionNames(const OptionNames& names, const Call& call) {
  try {
    return call();
  } catch (const OptionError& error) {
    throw UsageErrorOf(error, names);
  }
}

// How a command runs a call of the interface: progress as a line on stderr, notices as warnings and
// remarks on stderr, options by their names on the command line. It must outlive the call.
class CommandRun {
 public:
  CommandRun(const CommonOptions& options, OptionNames names);
  CommandRun(const CommandRun&) = delete;
  CommandRun& operator=(const CommandRun&) = delete;

  const RunControl& control() const { return control_; }
  const OptionNames& names() const { return names_; }

 private:
  void Show(const thicklens::Progress& progress);
  void Report(const Notice& notice);  // below the progress line, which it erases

  OptionNames names_;
  bool quiet_;
  std::mutex mutex_;
  std::string stage_;
  std::unique_ptr<ProgressLine> line_;
  RunControl control_;
};

// Reports a notice of the interface on stderr.
void ReportNotice(const Notice& notice);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_INTERFACE_OPTIONS_H_
