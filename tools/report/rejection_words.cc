#include "tools/report/rejection_words.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>

#include "thicklens/base/printable_text.h"
#include "tools/report/calibration_summary.h"

namespace thicklens::tools {
namespace {

constexpr std::size_t kMaxRuns = 6;      // for one kind in the text
constexpr std::size_t kLongEnding = 20;  // the minimum number of characters worth leaving out
constexpr char kLeftOut[] = "...";

std::string Reason(const std::string& kind, const std::string& detail) {
  return detail.empty() ? kind : kind + ": " + detail;
}

std::string NameOf(const std::vector<calib::FrameMeasurement>& frames, int index) {
  return FrameName(frames[static_cast<std::size_t>(index)].image);
}

std::size_t CommonEnding(const std::string& a, const std::string& b) {
  const std::size_t shorter = std::min(a.size(), b.size());
  std::size_t common = 0;
  while (common < shorter && a[a.size() - 1 - common] == b[b.size() - 1 - common]) ++common;
  return common;
}

// Returns how many characters at the end of the details of a group are the same in all of them,
// counting whole words only and not the first of them, which may be a unit. Returns 0 if they are
// not worth leaving out.
std::size_t CommonEnding(const calib::RejectionGroup& group) {
  const std::string& first = group.runs.front().detail;
  std::size_t common = first.size();
  for (const calib::RejectionRun& run : group.runs) {
    if (run.detail != first) common = std::min(common, CommonEnding(first, run.detail));
  }
  const std::size_t before_unit = first.find(' ', first.size() - common);
  if (before_unit == std::string::npos) return 0;
  const std::size_t space = first.find(' ', before_unit + 1);
  if (space == std::string::npos || first.size() - space <= kLongEnding) return 0;
  return first.size() - space - 1;
}

std::string GroupLines(const std::vector<calib::FrameMeasurement>& frames,
                       const calib::RejectionGroup& group) {
  const calib::RejectionRun& first = group.runs.front();
  if (group.runs.size() == 1) {
    return fmt::format("  {}: {}\n", RunName(frames, first),
                       PrintableUtf8(frames[static_cast<std::size_t>(first.first)].rejection));
  }
  std::string text = fmt::format("  {} ({} frames):\n", PrintableUtf8(group.kind), group.frames);
  const std::vector<std::string> details = TextsOfRuns(frames, group);
  int reported = 0;
  for (std::size_t i = 0; i < std::min(group.runs.size(), kMaxRuns); ++i) {
    const calib::RejectionRun& run = group.runs[i];
    text += fmt::format("    {}\n", PrintableUtf8(Reason(RunName(frames, run), details[i])));
    reported += run.count();
  }
  if (reported < group.frames) {
    text +=
        fmt::format("    and {} more, which --report and --json list\n", group.frames - reported);
  }
  return text;
}

}  // namespace

std::vector<std::string> TextsOfRuns(const std::vector<calib::FrameMeasurement>& frames,
                                     const calib::RejectionGroup& group) {
  const calib::RejectionRun& first = group.runs.front();
  const std::size_t ending = CommonEnding(group);
  std::vector<std::string> texts = {first.detail};
  for (std::size_t i = 1; i < group.runs.size(); ++i) {
    const std::string& detail = group.runs[i].detail;
    if (detail == first.detail && !detail.empty()) {
      texts.push_back("as " + NameOf(frames, first.first));
    } else {
      texts.push_back(ending > 0 ? detail.substr(0, detail.size() - ending) + kLeftOut : detail);
    }
  }
  return texts;
}

std::string RunName(const std::vector<calib::FrameMeasurement>& frames,
                    const calib::RejectionRun& run) {
  const std::string first = NameOf(frames, run.first);
  if (run.count() == 1) return first;
  return fmt::format("{} .. {} ({} frames)", first, NameOf(frames, run.last), run.count());
}

std::string RejectionLines(const std::vector<calib::FrameMeasurement>& frames) {
  std::string text;
  for (const calib::RejectionGroup& group : calib::RejectionGroups(frames))
    text += GroupLines(frames, group);
  return text;
}

}  // namespace thicklens::tools
