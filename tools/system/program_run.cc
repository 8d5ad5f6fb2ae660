#include "tools/system/program_run.h"

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
#include <mutex>
#include <set>
#include <system_error>
#include <thread>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/stopwatch.h"

extern char** environ;  // NOLINT: POSIX has it so

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

// The names of the files in the folder of the run.
constexpr char kOutFile[] = "stdout.txt", kErrFile[] = "stderr.txt";
constexpr int kNewFile = O_WRONLY | O_CREAT | O_TRUNC;

// The time between asking a program to end and killing it.
constexpr double kLastSeconds = 0.2;
constexpr auto kPoll = std::chrono::milliseconds(2);

// The child programs that are running, for EndChildPrograms.
class RunningPrograms {
 public:
  void Add(pid_t pid) {
    const std::lock_guard<std::mutex> lock(mutex_);
    pids_.insert(pid);
  }
  // Called before the system may give the process number to another process.
  template <typename Wait>
  auto RemoveAfter(pid_t pid, const Wait& wait) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto result = wait();
    if (result != 0) pids_.erase(pid);
    return result;
  }
  void AskToEnd() {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const pid_t pid : pids_) AskToEnd(pid);
  }
  // The second signal requests an immediate end, without waiting for a library that computes. Two
  // signals of one kind may arrive as one, so the second is of another kind, which neither this
  // process nor the child ignores.
  static void AskToEnd(pid_t pid) {
    ::kill(pid, SIGTERM);
    for (const int second : {SIGINT, SIGHUP, SIGTERM}) {
      struct sigaction now {};
      if (::sigaction(second, nullptr, &now) == 0 && now.sa_handler == SIG_IGN) continue;
      ::kill(pid, second);
      return;
    }
  }

 private:
  std::mutex mutex_;
  std::set<pid_t> pids_;
};

RunningPrograms& Running() {
  static RunningPrograms& running =
      *new RunningPrograms;  // never destroyed: the process may be ending
  return running;
}

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
    Running().Add(pid_);
  }
  ~Child() {
    if (HasEnded()) return;
    RunningPrograms::AskToEnd(pid_);
    const auto start = Clock::now();
    while (!HasEnded()) {
      if (SecondsSince(start) > kLastSeconds) Kill();
      std::this_thread::sleep_for(kPoll);
    }
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  bool HasEnded() {
    if (ended_) return true;
    const pid_t found = Running().RemoveAfter(pid_, [this] {
      const pid_t done = ::waitpid(pid_, &status_, WNOHANG);
      return done < 0 && errno == EINTR ? 0 : done;
    });
    is_lost_ = found < 0;  // the number may belong to another process by now
    ended_ = found != 0;
    return ended_;
  }
  bool is_lost() const { return is_lost_; }
  void Kill() { ::kill(pid_, SIGKILL); }
  int status() const { return status_; }

 private:
  pid_t pid_ = -1;
  int status_ = 0;
  bool ended_ = false, is_lost_ = false;
};

}  // namespace

void EndChildPrograms() { Running().AskToEnd(); }

ProgramRun RunProgram(const std::string& program, const std::vector<std::string>& arguments,
                      const fs::path& folder, double limit_seconds) {
  ProgramRun run;
  const auto start = Clock::now();
  const auto seconds = [&] { return SecondsSince(start); };
  Child child(program, arguments, folder);
  while (!child.HasEnded()) {
    ThrowIfCancelled();
    if (!run.timed_out && seconds() > limit_seconds) {
      run.timed_out = true;
      child.Kill();
    }
    std::this_thread::sleep_for(kPoll);
  }
  if (child.is_lost()) throw Error(fmt::format("{}: its process was lost", program));
  ThrowIfCancelled();  // Ctrl-C ends the child as well, and its end may be seen first
  run.seconds = seconds();
  if (WIFEXITED(child.status())) run.exit_code = WEXITSTATUS(child.status());
  if (WIFSIGNALED(child.status())) run.signal = WTERMSIG(child.status());
  run.out = ReadWholeFile((folder / kOutFile).string());
  run.err = ReadWholeFile((folder / kErrFile).string());
  return run;
}

std::string ThisProgram() {
  std::error_code failure;
  const fs::path program = fs::read_symlink("/proc/self/exe", failure);
  if (failure) {
    throw Error(
        fmt::format("/proc/self/exe: does not state which program this is ({}); /proc must be "
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
