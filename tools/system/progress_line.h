#ifndef THICKLENS_TOOLS_SYSTEM_PROGRESS_LINE_H_
#define THICKLENS_TOOLS_SYSTEM_PROGRESS_LINE_H_

#include <chrono>
#include <mutex>
#include <string>

namespace thicklens::tools {

// Returns what a line of progress says after `elapsed_s` seconds, for example "measuring 40 %, 9 s
// left". The remaining time assumes that the other steps take as long as those that are done; it is
// left out during the first second, in which there is nothing to conclude it from.
std::string ProgressText(const std::string& what, int percent, double elapsed_s);

// One line on stderr that is overwritten and erased at the end. It is silent unless stderr is a
// terminal. Several threads may update it.
class ProgressLine {
 public:
  ProgressLine(std::string what, bool quiet);
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  void Show(int done, int total);

 private:
  std::string what_;
  bool shown_;
  std::chrono::steady_clock::time_point begin_;
  int percent_ = -1;
  std::string text_;
  std::mutex mutex_;
};

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_SYSTEM_PROGRESS_LINE_H_
