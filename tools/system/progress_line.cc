#include "tools/system/progress_line.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <utility>

namespace thicklens::tools {
namespace {

constexpr char kWipeLine[] = "\r\033[K";

void Put(const std::string& text) {
  std::fputs(text.c_str(), stderr);
  std::fflush(stderr);
}

}  // namespace

ProgressLine::ProgressLine(std::string what, bool quiet)
    : what_(std::move(what)), shown_(!quiet && ::isatty(STDERR_FILENO) == 1) {}

ProgressLine::~ProgressLine() {
  if (shown_ && percent_ >= 0) Put(kWipeLine);
}

void ProgressLine::Show(int done, int total) {
  if (!shown_ || !(total > 0)) return;
  const std::lock_guard<std::mutex> lock(mutex_);
  const int percent = static_cast<int>(100.0 * done / total);
  if (percent <= percent_) return;
  percent_ = percent;
  Put(fmt::format("{}{} {} %", kWipeLine, what_, percent));
}

}  // namespace thicklens::tools
