#ifndef THICKLENS_TOOLS_PROGRAM_RUN_H_
#define THICKLENS_TOOLS_PROGRAM_RUN_H_

#include <filesystem>
#include <string>
#include <vector>

namespace thicklens::tools {

// How a run of a program ended.
struct ProgramRun {
  int exit_code = -1;      // -1: a signal ended it
  int signal = 0;          // which; 0: none
  bool timed_out = false;  // it was ended because it took too long
  double seconds = 0;
  std::string out, err;
};

// Runs a program in a folder, where it prints to stdout.txt and stderr.txt, and waits. Killed after
// so many seconds. Where the person interrupts, it is asked to end, killed if it does not, and
// Interrupted is thrown. Throws Error if it cannot be started.
ProgramRun RunProgram(const std::string& program, const std::vector<std::string>& arguments,
                      const std::filesystem::path& folder, double limit_seconds);

// Asks every program that RunProgram waits for to end at once: for the thread that ends this
// process while nobody waits any more.
void EndChildPrograms();

// The file of the program that runs. Throws Error where the system does not say.
std::string ThisProgram();

// As a person would type it into a shell.
std::string ShellCommand(const std::vector<std::string>& words);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_PROGRAM_RUN_H_
