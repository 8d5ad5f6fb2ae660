#include "thicklens/calib/rejection_groups.h"

#include <algorithm>
#include <cstddef>

#include "thicklens/calib/frame_checks.h"

namespace thicklens::calib {
namespace {

std::string DetailOf(const std::string& reason, const std::string& kind) {
  const std::size_t begin = reason.find_first_not_of(" :;,", std::min(kind.size(), reason.size()));
  return begin == std::string::npos ? "" : reason.substr(begin);
}

}  // namespace

std::vector<RejectionGroup> RejectionGroups(const std::vector<FrameMeasurement>& frames) {
  std::vector<RejectionGroup> groups;
  for (int i = 0; i < static_cast<int>(frames.size()); ++i) {
    const std::string& reason = frames[static_cast<std::size_t>(i)].rejection;
    if (reason.empty()) continue;
    const std::string kind = FailedCheck(reason);
    auto group = std::find_if(groups.begin(), groups.end(),
                              [&](const RejectionGroup& g) { return g.kind == kind; });
    if (group == groups.end()) group = groups.insert(groups.end(), {kind, 0, {}});
    ++group->frames;
    const std::string detail = DetailOf(reason, kind);
    if (!group->runs.empty() && group->runs.back().last == i - 1 &&
        group->runs.back().detail == detail) {
      group->runs.back().last = i;
    } else {
      group->runs.push_back({i, i, detail});
    }
  }
  return groups;
}

}  // namespace thicklens::calib
