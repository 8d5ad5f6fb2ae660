#include "tools/support/stopped_program.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <stdexcept>
#include <thread>

#include "thicklens/base/output_file.h"

namespace thicklens::tools {
namespace {

constexpr int kSignals[] = {SIGINT, SIGTERM, SIGHUP};

double Seconds(const timespec& time) {
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double NowSeconds() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return Seconds(now);
}

double Seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

}  // namespace

StoppedProgram::StoppedProgram(const std::vector<std::string>& arguments, const Settings& settings)
    : settings_(settings) {
  std::vector<std::string> all = {THICKLENS_PROGRAM};
  all.insert(all.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& argument : all) argv.push_back(argument.data());
  argv.push_back(nullptr);
  const std::string out = settings.scratch_folder + "/stdout",
                    err = settings.scratch_folder + "/stderr";
  // Before it is there, so that none arrives earlier.
  using Handler = void (*)(int);
  std::vector<Handler> before;
  for (const int signal : kSignals) {
    const auto& ignored = settings.ignored;
    const bool is_ignored = std::find(ignored.begin(), ignored.end(), signal) != ignored.end();
    // A shell ignores SIGINT for programs that it starts in the background.
    before.push_back(std::signal(signal, is_ignored ? SIG_IGN : SIG_DFL));
  }
  pid_ = ::fork();
  for (std::size_t i = 0; pid_ != 0 && i < before.size(); ++i) {
    std::signal(kSignals[i], before[i]);
  }
  if (pid_ < 0) throw std::runtime_error("no child process could be started");
  if (pid_ > 0) return;
  // It has this thread alone.
  if (!settings.temporary_folder.empty()) {
    ::setenv("TMPDIR", settings.temporary_folder.c_str(), 1);  // NOLINT: no other thread is here
  }
  constexpr int kFlags = O_WRONLY | O_CREAT | O_TRUNC;
  ::dup2(settings.stdout_fd >= 0 ? settings.stdout_fd : ::open(out.c_str(), kFlags, 0666),
         STDOUT_FILENO);
  ::dup2(settings.stderr_fd >= 0 ? settings.stderr_fd : ::open(err.c_str(), kFlags, 0666),
         STDERR_FILENO);
  ::execv(argv[0], argv.data());
  ::_exit(127);
}

StoppedProgram::~StoppedProgram() {
  if (has_ended_) return;
  ::kill(pid_, SIGKILL);
  ::waitpid(pid_, &status_, 0);
}

bool StoppedProgram::HasEnded() {
  if (has_ended_) return true;
  rusage usage{};
  has_ended_ = ::wait4(pid_, &status_, WNOHANG, &usage) == pid_;
  if (has_ended_) cpu_after_ = Seconds(usage.ru_utime) + Seconds(usage.ru_stime);
  return has_ended_;
}

// One that merely gets no processor is not asleep.
void StoppedProgram::WaitUntilBlocked() {
  double before = -1;
  for (int still = 0; still < 10 && !HasEnded();) {
    const double now = CpuSeconds();
    still = IsAsleep() && now == before && now > 0 ? still + 1 : 0;
    before = now;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

bool StoppedProgram::IsAsleep() const {
  std::ifstream stat("/proc/" + std::to_string(pid_) + "/stat");
  std::string line;
  std::getline(stat, line);
  const std::size_t name_end = line.rfind(')');
  return name_end != std::string::npos && line.compare(name_end, 3, ") S") == 0;
}

double StoppedProgram::CpuSeconds() const {
  clockid_t clock{};
  timespec time{};
  if (::clock_getcpuclockid(pid_, &clock) != 0 || ::clock_gettime(clock, &time) != 0) return 0;
  return Seconds(time);
}

void StoppedProgram::Send(int signal) {
  if (HasEnded()) return;
  if (sent_at_ < 0) {
    cpu_before_ = CpuSeconds();
    sent_at_ = NowSeconds();
  }
  ::kill(pid_, signal);
}

StoppedProgram::End StoppedProgram::Wait() {
  while (!HasEnded()) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  End end;
  if (WIFEXITED(status_)) end.exit_code = WEXITSTATUS(status_);
  if (WIFSIGNALED(status_)) end.signal = WTERMSIG(status_);
  if (sent_at_ >= 0) {
    end.seconds = NowSeconds() - sent_at_;
    end.cpu_seconds = cpu_after_ - cpu_before_;
  }
  if (settings_.stderr_fd < 0) {
    end.err = ReadWholeFile(settings_.scratch_folder + "/stderr");
  }
  return end;
}

FullPipe::FullPipe() {
  if (::pipe2(ends_, O_CLOEXEC) != 0) throw std::runtime_error("no pipe could be had");
  const int flags = ::fcntl(ends_[1], F_GETFL);
  ::fcntl(ends_[1], F_SETFL, flags | O_NONBLOCK);
  const std::string text(4096, '.');
  while (::write(ends_[1], text.data(), text.size()) > 0) {
  }
  while (::write(ends_[1], text.data(), 1) > 0) {
  }
  ::fcntl(ends_[1], F_SETFL, flags);
}

FullPipe::~FullPipe() {
  ::close(ends_[0]);
  ::close(ends_[1]);
}

}  // namespace thicklens::tools
