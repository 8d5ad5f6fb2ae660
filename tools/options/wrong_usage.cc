#include "tools/options/wrong_usage.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>

#include "tools/options/deprecated_names.h"

namespace thicklens::tools {
namespace {

// Returns the number of letters that are inserted, left out, replaced, or exchanged with their
// neighbour.
std::size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<std::vector<std::size_t>> steps(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) {
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        steps[i][j] = i + j;
        continue;
      }
      const std::size_t replaced = steps[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      steps[i][j] = std::min({steps[i - 1][j] + 1, steps[i][j - 1] + 1, replaced});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        steps[i][j] = std::min(steps[i][j], steps[i - 2][j - 2] + 1);
      }
    }
  }
  return steps[a.size()][b.size()];
}

// The innermost command that was recognised.
const CLI::App& InnermostCommand(const CLI::App& program) {
  const CLI::App* command = &program;
  while (!command->get_subcommands().empty()) command = command->get_subcommands().back();
  return *command;
}

// Former names have no group, and are not proposed.
std::vector<std::string> CommandsOf(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command :
       app.get_subcommands([](const CLI::App* inner) { return !inner->get_group().empty(); })) {
    names.push_back(command->get_name());
  }
  return names;
}

std::vector<std::string> OptionsOf(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options()) {
    const std::string& group = option->get_group();
    if (group.empty() || group == kFormerNamesGroup) continue;
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

bool LooksLikeAnOption(const std::string& word) {
  return word.size() > 1 && word.front() == '-' && word != "--";
}

// "simulate image".
std::string NameOf(const CLI::App& command) {
  const CLI::App* parent = command.get_parent();
  if (parent == nullptr) return command.get_name();
  return parent->get_parent() == nullptr ? command.get_name()
                                         : NameOf(*parent) + " " + command.get_name();
}

std::string UnknownCommand(const std::string& word, const CLI::App& app) {
  const std::vector<std::string> names = CommandsOf(app);
  const std::string near = NearestName(word, names);
  const std::string of = app.get_parent() == nullptr ? "" : " of " + NameOf(app);
  return fmt::format("unknown command '{}'{}{}", word, of,
                     near.empty() ? fmt::format("; the commands are: {}", fmt::join(names, ", "))
                                  : fmt::format("; did you mean {}?", near));
}

// `innermost` is the command that comes last.
std::string UnknownOption(const std::string& word, const CLI::App& command,
                          const CLI::App& innermost) {
  const std::string option = word.substr(0, word.find('='));
  if (&innermost != &command && innermost.get_option_no_throw(option) != nullptr) {
    const std::string of = NameOf(innermost);
    return fmt::format("{}: this option of {} belongs behind '{}'", option, of, of);
  }
  const std::string near = NearestName(option, OptionsOf(command));
  return fmt::format("{}: unknown option of {}{}", option, NameOf(command),
                     near.empty() ? "" : fmt::format("; did you mean {}?", near));
}

// Returns what the command did not take, without the mark "--" behind which no word is an option.
std::vector<std::string> NotTaken(const CLI::App& command, bool with_inner) {
  std::vector<std::string> words = command.remaining(with_inner);
  words.erase(std::remove(words.begin(), words.end(), "--"), words.end());
  return words;
}

// Returns what is unknown behind the name of this command, or an empty text.
std::string UnknownIn(const CLI::App& command, const CLI::App& innermost) {
  const std::vector<std::string> unknown = NotTaken(command, false);
  const auto option = std::find_if(unknown.begin(), unknown.end(), LooksLikeAnOption);
  const auto word = std::find_if(unknown.begin(), unknown.end(),
                                 [](const std::string& one) { return !LooksLikeAnOption(one); });
  // A word in the place of a command decides what the options behind it mean.
  if (command.get_require_subcommand_min() > 0 && word != unknown.end() && word <= option) {
    return UnknownCommand(*word, command);
  }
  if (option != unknown.end()) return UnknownOption(*option, command, innermost);
  if (unknown.empty()) return "";
  return fmt::format("{} does not take: {}", NameOf(command), fmt::join(unknown, " "));
}

}  // namespace

std::string NearestName(const std::string& typed, const std::vector<std::string>& names) {
  constexpr std::size_t kLongest = 64;  // of a word that may be meant as a name
  if (typed.size() > kLongest) return "";
  const std::size_t letters = typed.size() - std::min(typed.find_first_not_of('-'), typed.size());
  const std::size_t allowed = letters < 3 ? 0 : std::max<std::size_t>(1, letters / 3);
  std::string nearest;
  std::size_t least = allowed + 1;
  for (const std::string& name : names) {
    const bool begins = letters >= 3 && name.rfind(typed, 0) == 0;
    const std::size_t distance = begins ? 1 : EditDistance(typed, name);
    if (distance >= least) continue;
    least = distance;
    nearest = name;
  }
  return nearest;
}

bool EndsBeforeACommand(const CLI::App& program, const CLI::ParseError& error) {
  return dynamic_cast<const CLI::RequiredError*>(&error) != nullptr &&
         NotTaken(program, true).empty() &&
         InnermostCommand(program).get_require_subcommand_min() > 0;
}

std::string WrongUsageText(const CLI::App& program, const CLI::ParseError& error) {
  const CLI::App& innermost = InnermostCommand(program);
  for (const CLI::App* command = &program;; command = command->get_subcommands().back()) {
    const std::string unknown = UnknownIn(*command, innermost);
    if (!unknown.empty()) return unknown;
    if (command == &innermost) return error.what();
  }
}

}  // namespace thicklens::tools
