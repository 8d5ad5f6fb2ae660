#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "calibration_sections.h"
#include "page_pictures.h"
#include "page_style.h"
#include "printable_text.h"

namespace thicklens::tools {
namespace {

using calib::Calibration;
using calib::FocusSweep;
using calib::FrameMeasurement;

constexpr std::size_t kMostThumbnails = 12;
constexpr int kThumbnailPx = 220;  // longest edge

std::string RunsTable(const Calibration& calibration, const std::vector<RejectionRun>& runs) {
  const auto name_of = [&](int index) {
    return FrameName(calibration.frames[static_cast<std::size_t>(index)].image);
  };
  std::string html =
      "<div class=\"wide\"><table>\n<thead><tr><th>frames</th><th class=\"number\">how many</th>"
      "<th>reason</th></tr></thead>\n<tbody>\n";
  for (const RejectionRun& run : runs) {
    const int count = run.last - run.first + 1;
    const std::string first = name_of(run.first);
    html +=
        "<tr>" +
        TableCell(count == 1 ? first : fmt::format("{} … {}", first, name_of(run.last)), "name") +
        TableCell(fmt::format("{}", count)) +
        TableCell(run.reason + (run.identical ? "" : " (numbers of the first of them)"), "") +
        "</tr>\n";
  }
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
            TableCell(fmt::format("{:.4f}", frame.statistics.mean_stored)) +
            TableCell(fmt::format("{:.3f}", frame.statistics.contrast)) +
            TableCell(fmt::format("{:.1f} %", 100 * frame.statistics.saturated_fraction)) +
            TableCell(frame.rejection, "") + "</tr>\n";
  }
  return html + "</tbody></table></div></details>\n";
}

// The first of every run, then the second of every run, and so on: each kind of damage is seen.
std::vector<std::size_t> ChosenForShow(const std::vector<RejectionRun>& runs) {
  std::vector<std::size_t> chosen;
  for (int turn = 0;; ++turn) {
    const std::size_t before = chosen.size();
    for (const RejectionRun& run : runs)
      if (run.first + turn <= run.last && chosen.size() < kMostThumbnails)
        chosen.push_back(static_cast<std::size_t>(run.first + turn));
    if (chosen.size() == before) break;
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

// Shrunk and encoded as a screen expects it.
cv::Mat Thumbnail(const cv::Mat& stored, const model::TransferCurve& transfer) {
  cv::Mat shown = ShownPicture(stored);
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
                       const FramePictures& pictures) {
  std::string cells;
  for (const std::size_t i : chosen) {
    const cv::Mat stored = pictures(i);
    if (stored.empty()) continue;
    const FrameMeasurement& frame = calibration.frames[i];
    const std::string name = FrameName(frame.image);
    cells += fmt::format("<div>{}<span><b>{}</b> at {:.6g} mm: {}</span></div>\n",
                         EmbeddedPicture(Thumbnail(stored, sweep.camera.sensor.transfer),
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

}  // namespace

std::string RejectedSection(const FocusSweep& sweep, const Calibration& calibration,
                            const FramePictures& pictures) {
  const std::vector<RejectionRun> runs = RejectionRuns(calibration.frames);
  std::string html = "<h2>Rejected frames</h2>\n";
  if (runs.empty()) return html + "<p>None.</p>\n";
  const auto rejected = static_cast<std::size_t>(
      std::count_if(calibration.frames.begin(), calibration.frames.end(),
                    [](const FrameMeasurement& frame) { return !frame.rejection.empty(); }));
  html += RunsTable(calibration, runs);
  if (pictures) html += Thumbnails(sweep, calibration, ChosenForShow(runs), rejected, pictures);
  return html + LevelsTable(calibration, rejected);
}

}  // namespace thicklens::tools
