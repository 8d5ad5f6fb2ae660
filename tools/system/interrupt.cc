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

// SIGXCPU warns that a limit on processor time is near, a second or more before the system ends the
// process.
constexpr int kEndSignals[] = {SIGINT, SIGTERM, SIGHUP, SIGXCPU};
constexpr int kInterruptedCode = 1;
constexpr int kNobody = -1;
constexpr double kCleaningSeconds = 0.3;
// The time that main has to report the reason, once it has begun to end the process.
constexpr auto kLastMessage = std::chrono::milliseconds(200);

CancelToken program_token;
std::atomic<int> signal_count{0};
std::atomic<bool> is_watched{false};
sem_t arrived;  // counts the signals for the thread
// Whether the first SIGINT asks a command to finish with what it has.
enum class FinishState { kOff, kArmed, kAsked };
std::atomic<FinishState> finish_state{FinishState::kOff};
std::atomic<int> end_code{kNobody};  // set by the thread that ends the process
std::timed_mutex words_mutex;        // protects the following variables
std::function<std::string()> last_words;

// Does only what a signal handler is allowed to do.
void TakeSignal(int signal) {
  // The system repeats this warning by itself: a repetition is not a second request.
  if (signal == SIGXCPU && program_token.IsCancelled()) return;
  FinishState armed = FinishState::kArmed;
  if (signal == SIGINT && finish_state.compare_exchange_strong(armed, FinishState::kAsked)) return;
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

// Writes to standard error without its buffers, which another thread may hold; the text is dropped
// if nobody reads it.
void WriteMessage(const std::string& text) {
  pollfd ready{STDERR_FILENO, POLLOUT, 0};
  if (::poll(&ready, 1, 0) <= 0 || (ready.revents & POLLOUT) == 0) return;
  // A longer message might block until the reader of a pipe has read it.
  const std::size_t size = std::min<std::size_t>(text.size(), PIPE_BUF);
  static_cast<void>(!::write(STDERR_FILENO, text.data(), size));
}

std::string WordsToSay() {
  const std::unique_lock<std::timed_mutex> lock(words_mutex, std::chrono::milliseconds(50));
  return lock.owns_lock() && last_words ? last_words() : "";
}

void RemoveAndReport() {
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
      RemoveAndReport();
    } catch (const std::exception&) {  // out of memory: the process ends without a message
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
    // A signal that is ignored at the start stays ignored: the caller (`nohup`, a shell's `&`)
    // wants the command to continue.
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
  // The thread itself blocks all signals: they interrupt main, as before.
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
  if (outputs_in_place.empty()) return "interrupted; nothing was written";
  return PrintableUtf8(fmt::format("interrupted after {} was written; nothing else was written",
                                   fmt::join(outputs_in_place, " and ")));
}

void BeginEnd(int exit_code) {
  int nobody = kNobody;
  if (end_code.compare_exchange_strong(nobody, exit_code)) return;
  for (;;) ::pause();
}

FinishOnInterrupt::FinishOnInterrupt() { finish_state = FinishState::kArmed; }
FinishOnInterrupt::~FinishOnInterrupt() { finish_state = FinishState::kOff; }
bool FinishOnInterrupt::IsAsked() const { return finish_state == FinishState::kAsked; }

LastWords::LastWords(std::function<std::string()> words) {
  const std::lock_guard<std::timed_mutex> lock(words_mutex);
  last_words = std::move(words);
}

LastWords::~LastWords() {
  const std::lock_guard<std::timed_mutex> lock(words_mutex);
  last_words = nullptr;
}

}  // namespace thicklens::tools
