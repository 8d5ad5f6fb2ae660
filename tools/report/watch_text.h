#ifndef THICKLENS_TOOLS_REPORT_WATCH_TEXT_H_
#define THICKLENS_TOOLS_REPORT_WATCH_TEXT_H_

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "thicklens/watch.h"

namespace thicklens::tools {

// The lines that are printed while the frames of a sweep arrive.
class WatchText {
 public:
  // Returns a line for each frame that was added or is rejected now, and one for each file that was
  // given up. Where it has changed, a line follows that says what is missing; a file that is waited
  // for during several looks has a line, too. Empty if nothing is new.
  std::string Lines(const WatchUpdate& update);

 private:
  std::string missing_;  // as printed last
  std::string waiting_;  // of the last look
  int looks_ = 0;        // for how many looks it has not changed
};

// The findings while the frames arrived, for --json.
nlohmann::json WatchJson(const calib::SweepProgressReport& progress,
                         const std::vector<LeftOutFile>& left_out, const std::string& ended_by);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_WATCH_TEXT_H_
