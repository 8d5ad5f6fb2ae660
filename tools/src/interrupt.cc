#include "interrupt.h"

#include <atomic>
#include <csignal>

#include "thicklens/error.h"

namespace thicklens::tools {
namespace {

std::atomic<bool> interrupt_requested{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may not take a lock");

void RequestInterrupt(int /*signal*/) { interrupt_requested = true; }

}  // namespace

void CatchSignals() {
  std::signal(SIGINT, RequestInterrupt);
  std::signal(SIGTERM, RequestInterrupt);
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
}

bool InterruptRequested() { return interrupt_requested; }

void ThrowIfInterrupted() {
  if (InterruptRequested()) throw Interrupted();
}

}  // namespace thicklens::tools
