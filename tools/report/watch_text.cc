#include "tools/report/watch_text.h"

#include <fmt/format.h>

#include <cstddef>

#include "thicklens/base/printable_text.h"
#include "tools/report/calibration_summary.h"
#include "tools/report/rounding.h"

namespace thicklens::tools {
namespace {

// Every file waits for a moment; what keeps waiting is reported.
constexpr int kLooksOfWait = 6;

const char* UnitOf(const calib::SweepProgressReport& progress) {
  return progress.readings_are_counts ? "steps" : "mm";
}

std::string FocusSoFar(const calib::SweepProgressReport& progress) {
  const calib::SharpestReading& sharpest = progress.sharpest;
  if (!sharpest.done) return "focus not determined yet";
  return "focus at reading " +
         WithError(sharpest.reading_mm.value, sharpest.reading_mm.sigma, UnitOf(progress));
}

std::string FrameLine(const calib::ProgressFrame& frame, const char* unit) {
  const std::string head =
      fmt::format("{}: reading {:.6g} {}, ", FrameName(frame.image), frame.reading_mm, unit);
  if (!frame.rejection.empty()) return head + "rejected: " + PrintableUtf8(frame.rejection);
  return head + (frame.sharpness > 0 ? fmt::format("sharpness {:.4f} per px", frame.sharpness)
                                     : std::string("no edges as steep as those of the sharpest "
                                                   "frame"));
}

// A prediction is about noise, readings and bench offset alone.
std::string NothingInWords(const calib::SweepProgressReport& progress) {
  if (!progress.blur_ratio_error) return "nothing";
  return fmt::format("nothing: kappa is expected to {}{:.2g} %, without systematic errors",
                     progress.is_error_at_most ? "at most " : "", 100 * *progress.blur_ratio_error);
}

}  // namespace

std::string WatchText::Lines(const WatchUpdate& update) {
  const calib::SweepProgressReport& progress = update.progress;
  std::string text;
  for (const std::size_t i : update.added) {
    text += FrameLine(progress.frames[i], UnitOf(progress));
    // The last of several frames has the state of all of them.
    if (i == update.added.back()) {
      text += fmt::format("; {}; {} usable, {} rejected", FocusSoFar(progress), progress.usable,
                          progress.rejected);
    }
    text += '\n';
  }
  for (const std::size_t i : update.rejected)
    text += fmt::format("{}: rejected now that there are more frames: {}\n",
                        FrameName(progress.frames[i].image),
                        PrintableUtf8(progress.frames[i].rejection));
  for (const LeftOutFile& file : update.left_out)
    text += fmt::format("{}: left out: {}\n", FrameName(file.image), PrintableUtf8(file.reason));
  if (!update.added.empty()) {
    const std::string missing = progress.is_enough
                                    ? NothingInWords(progress)
                                    : fmt::format("{}", fmt::join(progress.missing, "; "));
    if (missing != missing_) text += fmt::format("  missing: {}\n", PrintableUtf8(missing));
    missing_ = missing;
  }
  looks_ = update.waiting > 0 && update.waiting_reason == waiting_ ? looks_ + 1 : 0;
  waiting_ = update.waiting_reason;
  if (looks_ == kLooksOfWait)
    text += fmt::format("  waiting: {}\n", PrintableUtf8(update.waiting_reason));
  return text;
}

nlohmann::json WatchJson(const calib::SweepProgressReport& progress,
                         const std::vector<LeftOutFile>& left_out, const std::string& ended_by) {
  nlohmann::json frames = nlohmann::json::array(), files = nlohmann::json::array(),
                 missing = nlohmann::json::array();
  for (const calib::ProgressFrame& frame : progress.frames) {
    frames.push_back(
        {{"image", PrintableUtf8(frame.image)},
         {"reading_mm", frame.reading_mm},
         {"sharpness_per_px", frame.sharpness},
         {"rejection", frame.rejection.empty() ? nlohmann::json(nullptr)
                                               : nlohmann::json(PrintableUtf8(frame.rejection))}});
  }
  for (const LeftOutFile& file : left_out)
    files.push_back({{"image", PrintableUtf8(file.image)}, {"reason", PrintableUtf8(file.reason)}});
  for (const std::string& text : progress.missing) missing.push_back(PrintableUtf8(text));
  nlohmann::json out = {{"ended_by", ended_by},
                        {"frames", std::move(frames)},
                        {"left_out", std::move(files)},
                        {"missing", std::move(missing)}};
  out["focus_reading_mm"] = nullptr;
  if (progress.sharpest.done)
    out["focus_reading_mm"] = {{"value", progress.sharpest.reading_mm.value},
                               {"sigma", progress.sharpest.reading_mm.sigma}};
  out["expected_blur_ratio_error"] = progress.blur_ratio_error
                                         ? nlohmann::json(*progress.blur_ratio_error)
                                         : nlohmann::json(nullptr);
  return out;
}

}  // namespace thicklens::tools
