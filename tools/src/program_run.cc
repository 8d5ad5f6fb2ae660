#include "program_run.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <system_error>
#include <thread>
#include <utility>

#include "interrupt.h"
#include "stopwatch.h"
#include "thicklens/error.h"
#include "thicklens/model/output_file.h"

extern char** environ;  // NOLINT: POSIX has it so

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

// In the folder of the run.
constexpr char kOutFile[] = "stdout.txt", kErrFile[] = "stderr.txt";
constexpr int kNewFile = O_WRONLY | O_CREAT | O_TRUNC;

class Child {
 public:
  Child(const std::string& program, const std::vector<std::string>& arguments,
        const fs::path& folder) {
    std::vector<std::string> words = {program};
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addchdir_np(&actions, folder.c_str());
    posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, kOutFile, kNewFile, 0666);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, kErrFile, kNewFile, 0666);
    const int failure =
        posix_spawn(&pid_, program.c_str(), &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (failure != 0) {
      throw Error(fmt::format("{}: cannot be started in {}: {}", program, folder.string(),
                              std::strerror(failure)));
    }
  }
  ~Child() {
    if (ended_) return;
    End();
    ::waitpid(pid_, &status_, 0);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  bool Ended() {
    if (ended_) return true;
    const pid_t found = ::waitpid(pid_, &status_, WNOHANG);
    if (found < 0 && errno != EINTR) {
      ended_ = true;  // the number may be somebody else's by now
      throw Error(fmt::format("a child process was lost: {}", std::strerror(errno)));
    }
    ended_ = found == pid_;
    return ended_;
  }
  void End() { ::kill(pid_, SIGKILL); }
  int status() const { return status_; }

 private:
  pid_t pid_ = -1;
  int status_ = 0;
  bool ended_ = false;
};

}  // namespace

ProgramRun RunProgram(const std::string& program, const std::vector<std::string>& arguments,
                      const fs::path& folder, double limit_seconds) {
  ProgramRun run;
  const auto start = Clock::now();
  const auto seconds = [&] { return SecondsSince(start); };
  Child child(program, arguments, folder);
  while (!child.Ended()) {
    ThrowIfInterrupted();
    if (!run.timed_out && seconds() > limit_seconds) {
      run.timed_out = true;
      child.End();
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  ThrowIfInterrupted();  // a person's Ctrl-C ends the child as well, and that may be seen first
  run.seconds = seconds();
  if (WIFEXITED(child.status())) run.exit_code = WEXITSTATUS(child.status());
  if (WIFSIGNALED(child.status())) run.signal = WTERMSIG(child.status());
  run.out = model::ReadWholeFile((folder / kOutFile).string());
  run.err = model::ReadWholeFile((folder / kErrFile).string());
  return run;
}

std::string ThisProgram() {
  std::error_code failure;
  const fs::path program = fs::read_symlink("/proc/self/exe", failure);
  if (failure) {
    throw Error(
        fmt::format("/proc/self/exe: does not say which program this is ({}); /proc must be "
                    "mounted",
                    failure.message()));
  }
  return program.string();
}

std::string ShellCommand(const std::vector<std::string>& words) {
  const auto is_plain = [](unsigned char c) {
    return std::isalnum(c) != 0 || std::strchr("-_./:,=+@%", c) != nullptr;
  };
  std::string command;
  for (const std::string& word : words) {
    if (!command.empty()) command += ' ';
    if (!word.empty() && std::all_of(word.begin(), word.end(), is_plain)) {
      command += word;
      continue;
    }
    command += '\'';
    for (const char c : word) command += c == '\'' ? std::string("'\\''") : std::string(1, c);
    command += '\'';
  }
  return command;
}

}  // namespace thicklens::tools
