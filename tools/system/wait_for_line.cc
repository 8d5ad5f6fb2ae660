#include "tools/system/wait_for_line.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>

namespace thicklens::tools {

bool LineWaiter::WaitFor(double seconds) {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  const auto milliseconds = static_cast<int>(1000 * std::max(0.0, seconds));
  if (::poll(&input, is_closed_ ? 0 : 1, milliseconds) <= 0) return false;
  if ((input.revents & (POLLIN | POLLHUP)) == 0) {  // not open
    is_closed_ = true;
    return false;
  }
  std::array<char, 256> bytes{};
  const ssize_t count = ::read(STDIN_FILENO, bytes.data(), bytes.size());
  if (count == 0) is_closed_ = true;
  return count > 0 && std::find(bytes.begin(), bytes.begin() + count, '\n') != bytes.end();
}

}  // namespace thicklens::tools
