#include "kernels/opencl/isolated_subprocess.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstring>
#include <exception>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/forked_process.h"

namespace thicklens::kernels {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kMaxReported = std::size_t{1} << 20;
constexpr std::size_t kChatterKept = 4096;
constexpr int kPollMs = 10;

// The two ends of a pipe. No other program inherits them.
class Pipe {
 public:
  Pipe() {
    if (::pipe2(ends_, O_CLOEXEC) != 0) {
      throw Error(
          fmt::format("a pipe to a child process cannot be created: {}", std::strerror(errno)));
    }
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  ~Pipe() {
    CloseReadEnd();
    CloseWriteEnd();
  }

  int read_end() const { return ends_[0]; }
  int write_end() const { return ends_[1]; }
  void CloseReadEnd() { Close(&ends_[0]); }
  void CloseWriteEnd() { Close(&ends_[1]); }

  // Reads the available text without waiting for more.
  void TakeInto(std::string* text) {
    char buffer[4096];
    while (ends_[0] >= 0) {
      pollfd ready{ends_[0], POLLIN, 0};
      if (::poll(&ready, 1, 0) <= 0) return;
      const ssize_t size = ::read(ends_[0], buffer, sizeof buffer);
      if (size > 0) {
        text->append(buffer, static_cast<std::size_t>(size));
      } else if (size == 0 || errno != EINTR) {
        CloseReadEnd();
      }
      if (text->size() > 2 * kMaxReported) return;
    }
  }

 private:
  static void Close(int* end) {
    if (*end >= 0) ::close(*end);
    *end = -1;
  }
  int ends_[2] = {-1, -1};
};

void WriteAll(int descriptor, const std::string& text) {
  std::size_t written = 0;
  while (written < text.size()) {
    const ssize_t size = ::write(descriptor, text.data() + written, text.size() - written);
    if (size < 0 && errno != EINTR) return;
    if (size > 0) written += static_cast<std::size_t>(size);
  }
}

// Runs as the child. The parent's atexit functions must not run in it. Ctrl-C is sent to the whole
// process group of the terminal, and the stop of a service to all of its processes. These signals
// are meant for the parent, which then ends the child.
[[noreturn]] void BeChild(const std::function<void(const SubprocessReport&)>& work, pid_t parent,
                          int reported, int chatter) {
  BeginForkedProcess(parent, {SIGQUIT, SIGPIPE, SIGALRM, SIGCHLD, SIGXFSZ, SIGXCPU},
                     {SIGINT, SIGTERM, SIGHUP});
  ::setpgid(0, 0);
  // If the parent has closed its standard streams, the pipes have their numbers.
  reported = ::fcntl(reported, F_DUPFD_CLOEXEC, STDERR_FILENO + 1);
  chatter = ::fcntl(chatter, F_DUPFD_CLOEXEC, STDERR_FILENO + 1);
  const int nothing = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
  if (nothing >= 0) ::dup2(nothing, STDIN_FILENO);
  ::dup2(chatter, STDOUT_FILENO);
  ::dup2(chatter, STDERR_FILENO);
  try {
    work([reported](const std::string& text) { WriteAll(reported, text); });
  } catch (const std::exception& error) {
    WriteAll(STDERR_FILENO, std::string("\n") + error.what() + "\n");
    ::_exit(1);
  } catch (...) {
    ::_exit(1);
  }
  ::_exit(0);
}

// A child process in its own group. It is killed with its group if this object is destroyed first.
class Child {
 public:
  explicit Child(pid_t pid) : pid_(pid) {
    // The child does the same. Whichever process is first, the group exists when it is killed.
    ::setpgid(pid_, pid_);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  ~Child() {
    if (!ended_) Kill();
  }

  bool HasEnded() {
    const pid_t ended = ::waitpid(pid_, &status_, WNOHANG);
    if (ended < 0 && errno != EINTR) {
      ended_ = true;
      throw Error(
          fmt::format("the end of a child process cannot be awaited: {}", std::strerror(errno)));
    }
    ended_ = ended == pid_;
    return ended_;
  }
  void Kill() {
    ::kill(-pid_, SIGKILL);
    ::kill(pid_, SIGKILL);
    status_ = StatusAtEnd(pid_);
    ended_ = true;
  }
  int status() const { return status_; }

 private:
  pid_t pid_;
  int status_ = 0;
  bool ended_ = false;
};

std::string LastLine(const std::string& text) {
  std::size_t end = text.size();
  while (end > 0) {
    const std::size_t newline = text.rfind('\n', end - 1);
    const std::size_t begin = newline == std::string::npos ? 0 : newline + 1;
    const std::string line = OneLine(text.substr(begin, end - begin));
    if (!line.empty()) return line;
    if (newline == std::string::npos) break;
    end = newline;
  }
  return "";
}

// Returns true if the process was ended by a signal that a user or a service sends and that no
// fault causes.
bool EndedByRequest(int status) {
  if (!WIFSIGNALED(status)) return false;
  const int signal = WTERMSIG(status);
  return signal == SIGINT || signal == SIGTERM || signal == SIGHUP;
}

std::string HowItEnded(int status) {
  if (WIFSIGNALED(status)) {
    return fmt::format("crashed (signal {}, {})", WTERMSIG(status), ::strsignal(WTERMSIG(status)));
  }
  if (WEXITSTATUS(status) != 0) return fmt::format("failed (exit code {})", WEXITSTATUS(status));
  return "";
}

// Reads from the child until it ends. Returns false if the time limit or the size limit was
// exceeded and the child was killed.
bool WaitForChild(Child* child, double limit_s, const StopCheck& stop, Pipe* reported,
                  Pipe* chatter, SubprocessOutcome* outcome, std::string* printed) {
  const auto deadline = Clock::now() + std::chrono::duration<double>(limit_s);
  while (true) {
    ThrowIfCancelled();
    if (stop) stop();
    const bool ended = child->HasEnded();
    reported->TakeInto(&outcome->reported);
    chatter->TakeInto(printed);
    if (printed->size() > kChatterKept) printed->erase(0, printed->size() - kChatterKept);
    if (ended) return true;
    if (Clock::now() > deadline || outcome->reported.size() > kMaxReported) {
      child->Kill();
      return false;
    }
    // Pipes that the child has closed are -1 here; poll is then only a pause.
    pollfd ready[2] = {{reported->read_end(), POLLIN, 0}, {chatter->read_end(), POLLIN, 0}};
    ::poll(ready, 2, kPollMs);
  }
}

}  // namespace

SubprocessOutcome RunInSubprocess(const std::function<void(const SubprocessReport&)>& work,
                                  double limit_s, const StopCheck& stop) {
  Pipe reported;
  Pipe chatter;
  const pid_t parent = ::getpid();
  const pid_t pid = ::fork();
  if (pid < 0)
    throw Error(fmt::format("a child process cannot be started: {}", std::strerror(errno)));
  if (pid == 0) BeChild(work, parent, reported.write_end(), chatter.write_end());
  Child child(pid);
  reported.CloseWriteEnd();
  chatter.CloseWriteEnd();

  SubprocessOutcome outcome;
  std::string printed;
  const bool in_time = WaitForChild(&child, limit_s, stop, &reported, &chatter, &outcome, &printed);
  if (in_time && EndedByRequest(child.status())) throw Interrupted();
  outcome.failure =
      in_time ? HowItEnded(child.status()) : fmt::format("did not end within {:g} s", limit_s);
  const std::string last_line = LastLine(printed);
  if (!outcome.failure.empty() && !last_line.empty()) {
    outcome.failure += "; the last line of its output: " + last_line;
  }
  return outcome;
}

std::string OneLine(const std::string& text) {
  std::string line;
  for (const char c : text) {
    const bool printable = static_cast<unsigned char>(c) > ' ' && c != '\x7f';
    if (printable) line += c;
    if (!printable && !line.empty() && line.back() != ' ') line += ' ';
  }
  if (!line.empty() && line.back() == ' ') line.pop_back();
  return line;
}

}  // namespace thicklens::kernels
