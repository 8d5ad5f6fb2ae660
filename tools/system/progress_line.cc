#include "tools/system/progress_line.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
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

std::string ProgressText(const std::string& what, int percent, double elapsed_s) {
  constexpr double kFirstSecond = 1;
  std::string text = fmt::format("{} {} %", what, percent);
  if (!(elapsed_s > kFirstSecond) || percent <= 0 || percent >= 100) return text;
  const double left_s = std::ceil(elapsed_s * (100.0 / percent - 1));
  return left_s < 120 ? fmt::format("{}, {:.0f} s left", text, left_s)
                      : fmt::format("{}, {:.0f} min left", text, std::ceil(left_s / 60));
}

ProgressLine::ProgressLine(std::string what, bool quiet)
    : what_(std::move(what)),
      shown_(!quiet && ::isatty(STDERR_FILENO) == 1),
      begin_(std::chrono::steady_clock::now()) {}

ProgressLine::~ProgressLine() {
  if (shown_ && percent_ >= 0) Put(kWipeLine);
}

void ProgressLine::Show(int done, int total) {
  if (!shown_ || !(total > 0)) return;
  const std::lock_guard<std::mutex> lock(mutex_);
  percent_ = std::max(percent_, static_cast<int>(100.0 * done / total));
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin_;
  std::string text = ProgressText(what_, percent_, elapsed.count());
  if (text == text_) return;
  text_ = std::move(text);
  Put(kWipeLine + text_);
}

}  // namespace thicklens::tools
