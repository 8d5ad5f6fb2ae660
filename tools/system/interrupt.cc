#include "tools/system/interrupt.h"

#include <fmt/format.h>
#include <poll.h>
#include <pthread.h>
#include <semaphore.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <climits>
#include <csignal>
#include <ctime>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/base/temporaries.h"
#include "tools/system/message_line.h"
#include "tools/system/program_run.h"

namespace thicklens::tools {
namespace {

// SIGXCPU warns of a limit of processor time, a second or more before the system ends the process.
constexpr int kEndSignals[] = {SIGINT, SIGTERM, SIGHUP, SIGXCPU};
constexpr int kInterruptedCode = 1;
constexpr int kNobody = -1;
constexpr double kCleaningSeconds = 0.3;
// For main, which has begun to end the process, to say why.
constexpr auto kLastMessage = std::chrono::milliseconds(200);

CancelToken program_token;
std::atomic<int> signal_count{0};
std::atomic<bool> is_watched{false};
sem_t arrived;                       // a count of signals, for the thread
std::atomic<int> end_code{kNobody};  // of whoever ends the process
std::timed_mutex words_mutex;        // of what follows
std::function<std::string()> last_words;

// Nothing but what a signal handler may do.
void TakeSignal(int signal) {
  // The system repeats this warning by itself: it is no second wish.
  if (signal == SIGXCPU && program_token.IsCancelled()) return;
  const int saved = errno;
  program_token.Cancel();
  const int count = signal_count.fetch_add(1) + 1;
  if (count > (is_watched ? 2 : 1)) {
    constexpr char kText[] = "thicklens: error: interrupted at once; temporary files may be left\n";
    static_cast<void>(!::write(STDERR_FILENO, kText, sizeof(kText) - 1));
    ::_exit(kInterruptedCode);
  }
  if (is_watched) ::sem_post(&arrived);
  errno = saved;
}

void WaitForSignal() {
  while (::sem_wait(&arrived) != 0 && errno == EINTR) {
  }
}

void WaitForAnother(double seconds) {
  timespec end{};
  ::clock_gettime(CLOCK_MONOTONIC, &end);
  const auto whole = static_cast<time_t>(seconds);
  end.tv_sec += whole;
  end.tv_nsec += static_cast<long>((seconds - static_cast<double>(whole)) * 1e9);
  if (end.tv_nsec >= 1000000000L) {
    end.tv_nsec -= 1000000000L;
    ++end.tv_sec;
  }
  while (::sem_clockwait(&arrived, CLOCK_MONOTONIC, &end) != 0 && errno == EINTR) {
  }
}

// To standard error, past its buffers, which another thread may hold; not where nobody takes it.
void WriteMessage(const std::string& text) {
  pollfd ready{STDERR_FILENO, POLLOUT, 0};
  if (::poll(&ready, 1, 0) <= 0 || (ready.revents & POLLOUT) == 0) return;
  // More than this might wait for the reader of a pipe.
  const std::size_t size = std::min<std::size_t>(text.size(), PIPE_BUF);
  static_cast<void>(!::write(STDERR_FILENO, text.data(), size));
}

std::string WordsToSay() {
  const std::unique_lock<std::timed_mutex> lock(words_mutex, std::chrono::milliseconds(50));
  return lock.owns_lock() && last_words ? last_words() : "";
}

void RemoveAndTell() {
  EndChildPrograms();
  const std::vector<std::string> in_place = AbandonOutputs(kCleaningSeconds);
  std::string text = ::isatty(STDERR_FILENO) == 1 ? "\r\033[K" : "";  // a line of progress
  const std::string words = WordsToSay();
  if (!words.empty()) text += "thicklens: warning: " + MessageLine(words) + "\n";
  text += "thicklens: error: " + MessageLine(InterruptedText(in_place)) + "\n";
  WriteMessage(text);
}

[[noreturn]] void EndProcess() {
  int code = kNobody;
  if (end_code.compare_exchange_strong(code, kInterruptedCode)) {
    try {
      RemoveAndTell();
    } catch (const std::exception&) {  // no memory is left: the process ends without words
    }
    ::_exit(kInterruptedCode);
  }
  std::this_thread::sleep_for(kLastMessage);
  ::_exit(code);
}

void* Watch(void* /*unused*/) {
  WaitForSignal();
  WaitForAnother(kGraceSeconds);
  EndProcess();
}

}  // namespace

void CatchSignals() {
  struct sigaction action {};
  action.sa_handler = TakeSignal;
  action.sa_flags = SA_RESTART;
  ::sigemptyset(&action.sa_mask);
  for (const int signal : kEndSignals) ::sigaddset(&action.sa_mask, signal);
  for (const int signal : kEndSignals) {
    // Whoever starts a command with one of them ignored wants it to go on: `nohup`, a shell's `&`.
    struct sigaction before {};
    if (signal != SIGTERM && ::sigaction(signal, nullptr, &before) == 0 &&
        before.sa_handler == SIG_IGN) {
      continue;
    }
    ::sigaction(signal, &action, nullptr);
  }
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
}

void WatchSignals() {
  constexpr std::size_t kStackBytes = 1 << 18;
  if (::sem_init(&arrived, 0, 0) != 0) return;
  // The thread takes no signals: those that arrive interrupt main, as they always did.
  sigset_t all, before;
  ::sigfillset(&all);
  ::pthread_sigmask(SIG_SETMASK, &all, &before);
  pthread_attr_t attributes;
  ::pthread_attr_init(&attributes);
  ::pthread_attr_setdetachstate(&attributes, PTHREAD_CREATE_DETACHED);
  ::pthread_attr_setstacksize(&attributes, kStackBytes);
  pthread_t thread{};
  is_watched = ::pthread_create(&thread, &attributes, Watch, nullptr) == 0;
  if (is_watched && signal_count > 0) ::sem_post(&arrived);
  ::pthread_attr_destroy(&attributes);
  ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

const CancelToken* ProgramToken() { return &program_token; }

std::string InterruptedText(const std::vector<std::string>& outputs_in_place) {
  if (outputs_in_place.empty()) return Interrupted().what();
  return PrintableUtf8(fmt::format("interrupted after {} was written; nothing else was written",
                                   fmt::join(outputs_in_place, " and ")));
}

void BeginEnd(int exit_code) {
  int nobody = kNobody;
  if (end_code.compare_exchange_strong(nobody, exit_code)) return;
  for (;;) ::pause();
}

LastWords::LastWords(std::function<std::string()> words) {
  const std::lock_guard<std::timed_mutex> lock(words_mutex);
  last_words = std::move(words);
}

LastWords::~LastWords() {
  const std::lock_guard<std::timed_mutex> lock(words_mutex);
  last_words = nullptr;
}

}  // namespace thicklens::tools
