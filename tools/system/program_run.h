#ifndef THICKLENS_TOOLS_SYSTEM_PROGRAM_RUN_H_
#define THICKLENS_TOOLS_SYSTEM_PROGRAM_RUN_H_

#include <filesystem>
#include <string>
#include <vector>

namespace thicklens::tools {

// The end of a run of a program.
struct ProgramRun {
  int exit_code = -1;      // -1: a signal ended it
  int signal = 0;          // the signal; 0: none
  bool timed_out = false;  // it was ended because it took too long
  double seconds = 0;
  std::string out, err;
};

// Runs a program in a folder, where it prints to stdout.txt and stderr.txt, and waits. The program
// is killed after `limit_seconds`. If the user interrupts, the program is asked to end, killed if
// it does not, and Interrupted is thrown. Throws Error if it cannot be started.
ProgramRun RunProgram(const std::string& program, const std::vector<std::string>& arguments,
                      const std::filesystem::path& folder, double limit_seconds);

// Asks every program that RunProgram waits for to end at once. The thread that ends this process
// calls it, when nothing waits for these programs any more.
void EndChildPrograms();

// Returns the file of the running program. Throws Error if the system does not report it.
std::string ThisProgram();

// Returns the text that a user would type into a shell.
std::string ShellCommand(const std::vector<std::string>& words);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_SYSTEM_PROGRAM_RUN_H_
