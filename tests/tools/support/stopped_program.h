#ifndef THICKLENS_TESTS_TOOLS_SUPPORT_STOPPED_PROGRAM_H_
#define THICKLENS_TESTS_TOOLS_SUPPORT_STOPPED_PROGRAM_H_

#include <sys/types.h>

#include <string>
#include <vector>

namespace thicklens::tools {

// The program thicklens as a child process that gets signals, and how long it goes on after them.
class StoppedProgram {
 public:
  struct Settings {
    std::string scratch_folder;    // stdout and stderr go to files there
    std::string temporary_folder;  // TMPDIR of the program; empty: that of this process
    std::vector<int> ignored;      // signals that are ignored at its start
    int stdout_fd = -1;            // instead of the file
    int stderr_fd = -1;
  };
  struct End {
    int exit_code = -1;      // -1: ended by a signal
    int signal = 0;          // which; 0: none
    double seconds = 0;      // from the first signal
    double cpu_seconds = 0;  // that it computed from then on, in all its threads
    std::string err;
  };

  StoppedProgram(const std::vector<std::string>& arguments, const Settings& settings);
  StoppedProgram(const StoppedProgram&) = delete;
  StoppedProgram& operator=(const StoppedProgram&) = delete;
  ~StoppedProgram();

  bool HasEnded();
  // Returns once it waits in the system, for example for the reader of a full pipe.
  void WaitUntilBlocked();
  void Send(int signal);
  End Wait();

 private:
  double CpuSeconds() const;
  bool IsAsleep() const;  // its first thread

  Settings settings_;
  pid_t pid_ = -1;
  bool has_ended_ = false;
  int status_ = 0;
  double sent_at_ = -1, cpu_before_ = 0, cpu_after_ = 0;
};

// A pipe that nobody reads, with no room left in it.
class FullPipe {
 public:
  FullPipe();
  ~FullPipe();
  FullPipe(const FullPipe&) = delete;
  FullPipe& operator=(const FullPipe&) = delete;
  int write_end() const { return ends_[1]; }

 private:
  int ends_[2] = {-1, -1};
};

}  // namespace thicklens::tools

#endif  // THICKLENS_TESTS_TOOLS_SUPPORT_STOPPED_PROGRAM_H_
