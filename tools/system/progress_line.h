#ifndef THICKLENS_TOOLS_SYSTEM_PROGRESS_LINE_H_
#define THICKLENS_TOOLS_SYSTEM_PROGRESS_LINE_H_

#include <mutex>
#include <string>

namespace thicklens::tools {

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
  int percent_ = -1;
  std::mutex mutex_;
};

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_SYSTEM_PROGRESS_LINE_H_
