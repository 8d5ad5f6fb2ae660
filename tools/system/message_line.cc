#include "tools/system/message_line.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <iterator>

#include "thicklens/base/printable_text.h"

namespace thicklens::tools {
namespace {

class MessageFormatter : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& message, spdlog::memory_buf_t& to) override {
    const auto level = spdlog::level::to_string_view(message.level);
    fmt::format_to(std::back_inserter(to), "thicklens: {}: {}\n",
                   std::string(level.data(), level.size()),
                   MessageLine(std::string(message.payload.data(), message.payload.size())));
  }
  std::unique_ptr<spdlog::formatter> clone() const override {
    return std::make_unique<MessageFormatter>();
  }
};

}  // namespace

std::string MessageLine(const std::string& text) {
  // A message begins with the place of the error and ends with what would be correct.
  constexpr std::size_t kBegin = 1500, kEnd = 500;
  std::string line = text;
  if (line.size() > 2 * (kBegin + kEnd)) {
    const std::size_t left_out = line.size() - kBegin - kEnd;
    line = fmt::format("{} [... {} bytes ...] {}", line.substr(0, kBegin), left_out,
                       line.substr(line.size() - kEnd));
  }
  std::replace(line.begin(), line.end(), '\n', ' ');
  return PrintableUtf8(line);
}

std::unique_ptr<spdlog::formatter> MakeMessageFormatter() {
  return std::make_unique<MessageFormatter>();
}

}  // namespace thicklens::tools
