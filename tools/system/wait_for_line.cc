#include "tools/system/wait_for_line.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>

namespace thicklens::tools {
namespace {

// Whether standard input is the terminal of a job that is in the background: the system stops a
// job that reads it then (SIGTTIN), and what is typed is for others.
bool IsInBackground() {
  const pid_t foreground = ::tcgetpgrp(STDIN_FILENO);
  return foreground != -1 && foreground != ::getpgrp();
}

}  // namespace

bool LineWaiter::WaitFor(double seconds) {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  const auto milliseconds = static_cast<int>(1000 * std::max(0.0, seconds));
  const bool is_read = !is_closed_ && !IsInBackground();
  if (::poll(&input, is_read ? 1 : 0, milliseconds) <= 0) return false;
  if ((input.revents & (POLLIN | POLLHUP)) == 0) {  // not open
    is_closed_ = true;
    return false;
  }
  if (IsInBackground()) return false;  // since it waits
  std::array<char, 256> bytes{};
  const ssize_t count = ::read(STDIN_FILENO, bytes.data(), bytes.size());
  // A file that cannot be read, as that of nohup, is ready at all times: without this, a caller
  // that waits again and again never rests.
  if (count == 0 || (count < 0 && errno != EINTR && errno != EAGAIN)) is_closed_ = true;
  return count > 0 && std::find(bytes.begin(), bytes.begin() + count, '\n') != bytes.end();
}

}  // namespace thicklens::tools
