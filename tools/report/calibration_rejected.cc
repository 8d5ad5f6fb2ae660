#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "thicklens/base/printable_text.h"
#include "thicklens/calib/rejection_groups.h"
#include "tools/report/calibration_sections.h"
#include "tools/report/page_images.h"
#include "tools/report/page_style.h"
#include "tools/report/rejection_words.h"

namespace thicklens::tools {
namespace {

using calib::Calibration;
using calib::FocusSweep;
using calib::FrameMeasurement;

constexpr std::size_t kMaxThumbnails = 12;
constexpr std::size_t kMaxRuns = 12;  // for one kind in the table
constexpr int kThumbnailPx = 220;     // the longest edge

std::string GroupRows(const Calibration& calibration, const calib::RejectionGroup& group) {
  const std::vector<std::string> details = TextsOfRuns(calibration.frames, group);
  std::string html;
  int reported = 0;
  for (std::size_t i = 0; i < std::min(group.runs.size(), kMaxRuns); ++i) {
    const calib::RejectionRun& run = group.runs[i];
    html += "<tr>" + TableCell(i == 0 ? group.kind : "", "name") +
            TableCell(i == 0 ? fmt::format("{}", group.frames) : "") +
            TableCell(Typeset(RunName(calibration.frames, run)), "name") +
            TableCell(Typeset(details[i]), "words") + "</tr>\n";
    reported += run.count();
  }
  if (reported < group.frames) {
    html += "<tr>" + TableCell("", "name") + TableCell("") +
            TableCell(fmt::format("and {} more", group.frames - reported), "name") +
            TableCell("in the table below", "words") + "</tr>\n";
  }
  return html;
}

std::string GroupsTable(const Calibration& calibration,
                        const std::vector<calib::RejectionGroup>& groups) {
  std::string html =
      "<div class=\"wide\"><table>\n<thead><tr><th>reason</th><th class=\"number\">how many</th>"
      "<th>frames</th><th>details</th></tr></thead>\n<tbody>\n";
  for (const calib::RejectionGroup& group : groups) html += GroupRows(calibration, group);
  return html + "</tbody></table></div>\n";
}

std::string LevelsTable(const Calibration& calibration, std::size_t rejected) {
  std::string html = fmt::format(
      "<details><summary>Each of the {} with its levels</summary>\n<div class=\"wide\"><table>\n"
      "<thead><tr><th>frame</th><th class=\"number\">reading [mm]</th><th class=\"number\">mean "
      "stored</th><th class=\"number\">contrast</th><th class=\"number\">saturated</th>"
      "<th>reason</th></tr></thead>\n<tbody>\n",
      rejected);
  for (const FrameMeasurement& frame : calibration.frames) {
    if (frame.rejection.empty()) continue;
    html += "<tr>" + TableCell(FrameName(frame.image), "name") +
            TableCell(fmt::format("{:.6g}", frame.reading_mm)) +
            TableCell(fmt::format("{:.4f}", frame.statistics.mean_encoded)) +
            TableCell(fmt::format("{:.3f}", frame.statistics.contrast)) +
            TableCell(fmt::format("{:.1f} %", 100 * frame.statistics.saturated_fraction)) +
            TableCell(frame.rejection, "words") + "</tr>\n";
  }
  return html + "</tbody></table></div></details>\n";
}

std::vector<int> FramesOf(const calib::RejectionGroup& group) {
  std::vector<int> frames;
  for (const calib::RejectionRun& run : group.runs)
    for (int i = run.first; i <= run.last; ++i) frames.push_back(i);
  return frames;
}

// Takes the first frame of every kind, then the second of every kind, and so on, so that each kind
// of damage is shown.
std::vector<std::size_t> ChosenForShow(const std::vector<calib::RejectionGroup>& groups) {
  std::vector<std::size_t> chosen;
  for (std::size_t turn = 0;; ++turn) {
    const std::size_t before = chosen.size();
    for (const calib::RejectionGroup& group : groups) {
      const std::vector<int> frames = FramesOf(group);
      if (turn < frames.size() && chosen.size() < kMaxThumbnails)
        chosen.push_back(static_cast<std::size_t>(frames[turn]));
    }
    if (chosen.size() == before) break;
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

// Shrinks the frame and encodes it for a screen.
cv::Mat Thumbnail(const cv::Mat& stored, const model::TransferCurve& transfer) {
  cv::Mat shown = ShownImage(stored);
  const int longest = std::max(shown.cols, shown.rows);
  if (longest > kThumbnailPx) {
    const double scale = static_cast<double>(kThumbnailPx) / longest;
    cv::Mat shrunk;
    cv::resize(shown, shrunk,
               {std::max(1, static_cast<int>(shown.cols * scale)),
                std::max(1, static_cast<int>(shown.rows * scale))},
               0, 0, cv::INTER_AREA);
    shown = shrunk;
  }
  const model::TransferCurve srgb = model::TransferCurve::Srgb();
  if (transfer == srgb) return shown;
  cv::Mat levels(1, 256, CV_8U), encoded;
  for (int i = 0; i < 256; ++i)
    levels.at<unsigned char>(i) =
        cv::saturate_cast<unsigned char>(255 * srgb.Encode(transfer.Decode(i / 255.0)));
  cv::LUT(shown, levels, encoded);
  return encoded;
}

std::string Thumbnails(const FocusSweep& sweep, const Calibration& calibration,
                       const std::vector<std::size_t>& chosen, std::size_t rejected,
                       const FrameImages& images) {
  std::string cells;
  for (const std::size_t i : chosen) {
    const cv::Mat stored = images(i);
    if (stored.empty()) continue;
    const FrameMeasurement& frame = calibration.frames[i];
    const std::string name = FrameName(frame.image);
    cells += fmt::format("<div>{}<span><b>{}</b> at {:.6g} mm: {}</span></div>\n",
                         EmbeddedImage(Thumbnail(stored, sweep.camera.sensor.transfer),
                                       fmt::format("{}, rejected: {}", name, frame.rejection),
                                       Packing::kSmall, kThumbnailPx),
                         EscapeXml(name), frame.reading_mm, EscapeXml(frame.rejection));
  }
  if (cells.empty()) return "";
  std::string html = "<div class=\"thumbnails\">\n" + cells + "</div>\n";
  if (rejected > chosen.size())
    html += fmt::format("<p class=\"soft\">… and {} more.</p>\n", rejected - chosen.size());
  return html;
}

// Lists the frames that passed the quality checks but give no information about the blur, by
// reason.
std::string NotInFit(const Calibration& calibration) {
  std::map<std::string, calib::RejectionGroup> groups;
  int count = 0;
  for (int i = 0; i < static_cast<int>(calibration.frames.size()); ++i) {
    const FrameMeasurement& frame = calibration.frames[static_cast<std::size_t>(i)];
    if (frame.not_in_fit.empty() || !frame.rejection.empty()) continue;
    calib::RejectionGroup& group = groups[frame.not_in_fit];
    if (!group.runs.empty() && group.runs.back().last == i - 1)
      group.runs.back().last = i;
    else
      group.runs.push_back({i, i, ""});
    ++group.frames;
    ++count;
  }
  if (count == 0) return "";
  std::string html = fmt::format(
      "<p>{} more {} the quality checks but {} no information about the blur:</p>\n<ul>\n", count,
      count == 1 ? "frame passed" : "frames passed", count == 1 ? "gives" : "give");
  for (const auto& [reason, group] : groups) {
    std::vector<std::string> names;
    for (const calib::RejectionRun& run : group.runs)
      names.push_back(Typeset(RunName(calibration.frames, run)));
    html += fmt::format("<li class=\"words\">{} ({}): {}</li>\n", EscapeXml(Typeset(reason)),
                        group.frames, EscapeXml(fmt::format("{}", fmt::join(names, ", "))));
  }
  return html + "</ul>\n";
}

}  // namespace

std::string RejectedSection(const FocusSweep& sweep, const Calibration& calibration,
                            const FrameImages& images) {
  const std::vector<calib::RejectionGroup> groups = calib::RejectionGroups(calibration.frames);
  std::string html = "<h2>Rejected frames</h2>\n";
  if (groups.empty()) return html + "<p>None.</p>\n" + NotInFit(calibration);
  const auto rejected = static_cast<std::size_t>(
      std::count_if(calibration.frames.begin(), calibration.frames.end(),
                    [](const FrameMeasurement& frame) { return !frame.rejection.empty(); }));
  html += GroupsTable(calibration, groups) + NotInFit(calibration);
  if (images) html += Thumbnails(sweep, calibration, ChosenForShow(groups), rejected, images);
  return html + LevelsTable(calibration, rejected);
}

}  // namespace thicklens::tools
