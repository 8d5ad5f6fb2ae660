#include "thicklens/model/video_sweep.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <string>
#include <utility>

#include "model/schema/frame_pairing.h"
#include "model/schema/sweep_frames.h"
#include "model/schema/sweep_video.h"
#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"

namespace thicklens::model {
namespace {

// Times that differ by less are equal: decimal fractions are rounded, and seconds since 1970 have
// no finer steps.
constexpr double kSameTimeS = 1e-6;

// A frame with its reading.
struct ReadFrameOfVideo {
  int number = 0;
  double reading_mm = 0;
};

// "frame 3", "frames 3, 7, 12 and 4 more"
std::string FramesText(const std::vector<int>& numbers) {
  constexpr std::size_t kShown = 5;
  std::string text = numbers.size() == 1 ? "frame " : "frames ";
  for (std::size_t i = 0; i < std::min(numbers.size(), kShown); ++i)
    text += (i == 0 ? "" : ", ") + std::to_string(numbers[i]);
  if (numbers.size() > kShown) text += fmt::format(" and {} more", numbers.size() - kShown);
  return text;
}

class VideoSweep {
 public:
  VideoSweep(const std::string& path, const std::vector<VideoFrame>& frames,
             const VideoTable& table, const VideoSelection& selection,
             const ReadingOptions& options, VideoStatements statements)
      : path_(path),
        frames_(frames),
        table_(table),
        selection_(selection),
        options_(options),
        statements_(statements) {}

  SweepFile Make(std::vector<std::string>* notices) {
    if (frames_.empty()) throw Error(path_ + ": it has no frames");
    RequireOneSource();
    RequireKnownNumbers();
    if (NeedsTimes()) RequireTimes();
    TakeUsableFrames();
    std::vector<ReadFrameOfVideo> read = table_.by_frame  ? ByFrame()
                                         : table_.by_time ? ByTime()
                                                          : ByConstantSpeed();
    if (read.empty()) {
      throw Error(fmt::format("{}: none of its {} frames can be used: {}", path_, frames_.size(),
                              LeftOut()));
    }
    const std::size_t usable = read.size();
    Thin(&read);
    SweepFile sweep;
    sweep.source = path_;
    for (const ReadFrameOfVideo& frame : read)
      sweep.frames.push_back({path_, frame.reading_mm, frame.number});
    sweep.readings = description_;
    if (notices != nullptr) Report(usable, read.size(), notices);
    return sweep;
  }

 private:
  // The name of a statement in messages.
  std::string Name(const std::string& option, const std::string& key) const {
    return statements_ == VideoStatements::kOptions ? option : fmt::format("{} ({})", key, option);
  }
  std::string TableName() const {
    return statements_ == VideoStatements::kOptions ? "--readings" : "frames_csv";
  }
  bool HasSpeed() const { return selection_.reading_start.has_value(); }
  bool NeedsTimes() const {
    return !table_.by_frame || selection_.time_start_s || selection_.time_end_s;
  }
  double TimeOf(int number) const { return *frames_[static_cast<std::size_t>(number)].time_s; }
  double LastTime() const { return *frames_.back().time_s; }

  void RequireOneSource() const {
    const bool has_table = table_.by_time || table_.by_frame;
    if (has_table && HasSpeed()) {
      throw Error(
          fmt::format("{}: a table of readings, and also a constant speed (--reading-start, "
                      "--reading-end): one "
                      "of them is expected",
                      path_));
    }
    if (!has_table && !HasSpeed()) {
      throw Error(fmt::format(
          "{}: a video needs a table of its readings by time or by frame (--readings), or a "
          "constant speed (--reading-start and --reading-end)",
          path_));
    }
    if (!table_.by_time && !selection_.time_offset.empty()) {
      throw Error(fmt::format("{}: {} is for a table by time, which is not given", path_,
                              Name("--time-offset", "video.time_offset")));
    }
  }

  // "1 frame after frame 6 and 2 frames after frame 9", of those that cannot be decoded; empty:
  // none.
  std::string Lost() const {
    std::string text;
    const auto add = [&](int count, std::size_t after) {
      if (count == 0) return;
      text += (text.empty() ? "" : " and ") +
              fmt::format("{} frame{} after frame {}", count, count == 1 ? "" : "s", after);
    };
    for (std::size_t i = 1; i < frames_.size(); ++i) add(frames_[i].lost_before, i - 1);
    add(frames_.back().lost_after, frames_.size() - 1);
    return text;
  }

  // Frames are counted as they are decoded. Where one is lost, another program may count it.
  void RequireKnownNumbers() const {
    if (const int lost = frames_.front().lost_before; lost > 0) {
      throw Error(fmt::format(
          "{}: the video is damaged: {} frame{} before the first one that can be decoded {} lost, "
          "and which frame is the first, at 0 s, is not certain; copy it again, or write what can "
          "be decoded into a new file (ffmpeg -i FILE -c:v ffv1 NEW.mkv)",
          path_, lost, lost == 1 ? "" : "s", lost == 1 ? "is" : "are"));
    }
    if (!table_.by_frame) return;
    const std::string lost = Lost();
    if (lost.empty() && !frames_.back().is_count_doubtful) return;
    throw Error(fmt::format(
        "{}: the video is damaged: {}, and the numbers of the frames behind, by which {} "
        "states the readings, are not certain; copy the video again, or give a table by time or a "
        "constant speed",
        path_, lost.empty() ? "frames of it may be lost" : lost + " cannot be decoded",
        table_.by_frame->source));
  }

  // The reason why the last frame may not be the end of the recording; empty: none.
  std::string DoubtOfEnd() const {
    const VideoFrame& last = frames_.back();
    const std::size_t number = frames_.size() - 1;
    if (last.lost_after > 0)
      return fmt::format("{} behind frame {} cannot be decoded", last.lost_after, number);
    if (last.is_damaged) return fmt::format("its last frame, {}, is damaged", number);
    return last.may_be_cut ? fmt::format("its last frame, {}, may be incomplete", number) : "";
  }

  void RequireTimes() const {
    for (std::size_t i = 0; i < frames_.size(); ++i) {
      if (!frames_[i].time_s) {
        throw Error(fmt::format(
            "{}: frame {} (counted from 0) has no time stamp, and readings by time need the time "
            "of each frame; give a table by frame ({} with the columns frame and reading), or put "
            "the stream into a container with its frame rate (ffmpeg -r RATE -i FILE -c copy "
            "NEW.mp4)",
            path_, i, TableName()));
      }
      if (i > 0 && !(*frames_[i].time_s > *frames_[i - 1].time_s)) {
        throw Error(
            fmt::format("{}: the time stamps do not rise: frame {} is at {:.6g} s, frame {} at "
                        "{:.6g} s; give a table by frame ({} with the columns frame and reading)",
                        path_, i - 1, *frames_[i - 1].time_s, i, *frames_[i].time_s, TableName()));
      }
    }
  }

  void TakeUsableFrames() {
    const double from = selection_.time_start_s.value_or(-1);
    const double to = selection_.time_end_s.value_or(0);
    for (std::size_t i = 0; i < frames_.size(); ++i) {
      const int number = static_cast<int>(i);
      const bool is_early = selection_.time_start_s && TimeOf(number) < from - kSameTimeS;
      const bool is_late = selection_.time_end_s && TimeOf(number) > to + kSameTimeS;
      if (is_early || is_late) {
        ++outside_;
      } else if (frames_[i].is_damaged) {
        damaged_.push_back(number);
      } else if (frames_[i].repeats_previous) {
        repeated_.push_back(number);
      } else {
        usable_.push_back(number);
      }
    }
  }

  std::vector<ReadFrameOfVideo> ByConstantSpeed() {
    const double start_mm = ReadingInMm(*selection_.reading_start, "", options_,
                                        Name("--reading-start", "video.reading_start") + ": ");
    const double end_mm = ReadingInMm(*selection_.reading_end, "", options_,
                                      Name("--reading-end", "video.reading_end") + ": ");
    const double from = selection_.time_start_s.value_or(0);
    const double to = selection_.time_end_s.value_or(LastTime());
    if (const std::string doubt = DoubtOfEnd(); !doubt.empty() && !selection_.time_end_s) {
      throw Error(fmt::format(
          "{}: {}: the recording may have been longer, and then {} is not the reading at {:.6g} s; "
          "state a time and its reading by {} and {}, or give a table by time ({}), or copy the "
          "video again",
          path_, doubt, Name("--reading-end", "video.reading_end"), LastTime(),
          Name("--time-end", "video.time_end_s"), Name("--reading-end", "video.reading_end"),
          TableName()));
    }
    if (!(to > from)) {
      throw Error(
          fmt::format("{}: the motion is stated from {:.6g} s to {:.6g} s, but the video "
                      "ends at {:.6g} s",
                      path_, from, to, LastTime()));
    }
    // Players show a length that includes the time for which the last frame is shown.
    const double last_shown =
        LastTime() + LastTime() / static_cast<double>(std::max<std::size_t>(frames_.size() - 1, 1));
    if (to > last_shown + kSameTimeS) {  // a mistake in the unit would stay unnoticed
      throw Error(fmt::format("{}: {} is {:.6g} s, but the last frame is at {:.6g} s", path_,
                              Name("--time-end", "video.time_end_s"), to, LastTime()));
    }
    std::vector<ReadFrameOfVideo> read;
    for (const int number : usable_) {
      const double share = (TimeOf(number) - from) / (to - from);
      read.push_back({number, start_mm + share * (end_mm - start_mm)});
    }
    description_ =
        fmt::format("constant speed, {:.6g} mm at {:.6g} s to {:.6g} mm at {:.6g} s, as stated",
                    start_mm, from, end_mm, to);
    return read;
  }

  double Offset() const {
    if (selection_.time_offset.empty()) return 0;
    const auto offset = SecondsOfTime(selection_.time_offset);
    if (!offset) {
      throw Error(fmt::format(
          "{}: a time is expected (seconds, hh:mm:ss.f, or a date and a time), found '{}'",
          Name("--time-offset", "video.time_offset"), selection_.time_offset));
    }
    return *offset;
  }

  std::vector<ReadFrameOfVideo> ByTime() {
    const std::vector<TimedReading>& rows = table_.by_time->rows;
    const double offset = Offset();
    const double first = rows.front().time_s - offset, last = rows.back().time_s - offset;
    RequireOverlap(first, last);
    std::vector<ReadFrameOfVideo> read;
    std::size_t next = 0;
    for (const int number : usable_) {
      const double time = TimeOf(number) + offset;
      if (time < rows.front().time_s - kSameTimeS || time > rows.back().time_s + kSameTimeS) {
        ++without_reading_;
        continue;
      }
      while (next + 1 < rows.size() && rows[next].time_s < time) ++next;
      if (next == 0) {
        read.push_back({number, rows[0].reading_mm});
        continue;
      }
      const TimedReading &before = rows[next - 1], &after = rows[next];
      const double share = (time - before.time_s) / (after.time_s - before.time_s);
      read.push_back({number, before.reading_mm + share * (after.reading_mm - before.reading_mm)});
    }
    description_ = table_.by_time->description + "; interpolated linearly at the times of frames";
    return read;
  }

  // The table and the video must be of one clock and one unit.
  void RequireOverlap(double first, double last) const {
    const std::string& source = table_.by_time->source;
    if (first > LastTime() || last < 0) {
      throw Error(fmt::format(
          "{}: its times run from {:.6f} s to {:.6f} s, those of the frames of {} from 0 to {:.6f} "
          "s: state by {} which time of the table is that of the first frame{}",
          source, first, last, path_, LastTime(), Name("--time-offset", "video.time_offset"),
          UnitHint()));
    }
    // If milliseconds are taken for seconds, nearly all of the table lies behind the end of the
    // video.
    constexpr double kMuchLonger = 20;
    const bool is_suspect = !table_.by_time->is_time_unit_stated &&
                            last - first > kMuchLonger * std::max(LastTime(), 1e-3);
    if (is_suspect) {
      throw Error(fmt::format(
          "{}: its times have no unit; as seconds they last {:.6g} s, and {} lasts {:.6g} s: state "
          "their unit by {} (ms, or s if it is right)",
          source, last - first, path_, LastTime(), UnitName()));
    }
  }
  std::string UnitHint() const {
    return table_.by_time->is_time_unit_stated
               ? ""
               : fmt::format(", and by {} what they count", UnitName());
  }
  std::string UnitName() const { return Name("--time-unit", "readings_time_unit"); }

  std::vector<ReadFrameOfVideo> ByFrame() {
    const auto row_of =
        RowsOfFrames(*table_.by_frame, path_, static_cast<int>(frames_.size()), &notices_);
    std::vector<ReadFrameOfVideo> read;
    for (const int number : usable_) {
      const auto found = row_of.find(number);
      if (found == row_of.end()) {
        ++without_reading_;
      } else {
        read.push_back({number, found->second->reading_mm});
      }
    }
    description_ = table_.by_frame->description;
    return read;
  }

  // Neighbours in a video differ little, and each frame costs time.
  void Thin(std::vector<ReadFrameOfVideo>* read) {
    const std::size_t count = read->size();
    std::vector<ReadFrameOfVideo> kept;
    if (selection_.frames) {
      const auto wanted = static_cast<std::size_t>(*selection_.frames);
      if (wanted >= count) return;
      for (std::size_t i = 0; i < wanted; ++i)
        kept.push_back((*read)[(i * (count - 1) + (wanted - 1) / 2) / (wanted - 1)]);
    } else {
      step_ = selection_.every ? static_cast<std::size_t>(*selection_.every)
                               : (count + kMaxVideoFrames - 1) / kMaxVideoFrames;
      for (std::size_t i = 0; i < count; i += step_) kept.push_back((*read)[i]);
    }
    *read = std::move(kept);
  }

  // The counts of the frames that were left out, with the reasons.
  std::string LeftOut() const {
    std::string text;
    const auto add = [&](const std::string& reason) {
      text += (text.empty() ? "" : "; ") + reason;
    };
    if (outside_ > 0) add(fmt::format("{} lie outside of the stated times", outside_));
    if (!damaged_.empty())
      add(fmt::format("{} damaged ({})", damaged_.size(), FramesText(damaged_)));
    if (!repeated_.empty()) {
      add(fmt::format("{} repeat the frame before ({})", repeated_.size(), FramesText(repeated_)));
    }
    if (without_reading_ > 0) {
      add(fmt::format("{} {}", without_reading_,
                      table_.by_time
                          ? fmt::format("lie outside of the times of {}", table_.by_time->source)
                          : fmt::format("have no row in {}", table_.by_frame->source)));
    }
    return text;
  }

  void Report(std::size_t usable, std::size_t used, std::vector<std::string>* notices) const {
    const std::string left_out = LeftOut();
    if (!left_out.empty()) {
      notices->push_back(fmt::format("{}: {} of {} frames are left out: {}", path_,
                                     frames_.size() - usable, frames_.size(), left_out));
    }
    if (const std::string lost = Lost(); !lost.empty()) {
      notices->push_back(fmt::format(
          "{}: the video is damaged: {} cannot be decoded; the frames are numbered without them",
          path_, lost));
    }
    if (used < usable) {
      notices->push_back(
          fmt::format("{}: {} of {} usable frames are used{}; {} and {} choose", path_, used,
                      usable, step_ > 1 ? fmt::format(", one of {}", step_) : ", evenly chosen",
                      Name("--every", "video.every"), Name("--frames", "video.frames")));
    }
    const std::vector<std::string>* of_table = table_.by_time    ? &table_.by_time->notices
                                               : table_.by_frame ? &table_.by_frame->notices
                                                                 : nullptr;
    if (of_table != nullptr) notices->insert(notices->end(), of_table->begin(), of_table->end());
    notices->insert(notices->end(), notices_.begin(), notices_.end());
  }

  const std::string& path_;
  const std::vector<VideoFrame>& frames_;
  const VideoTable& table_;
  const VideoSelection& selection_;
  const ReadingOptions& options_;
  const VideoStatements statements_;
  std::vector<int> usable_, damaged_, repeated_;
  int outside_ = 0, without_reading_ = 0;
  std::size_t step_ = 1;
  std::string description_;
  std::vector<std::string> notices_;
};

bool FailWith(std::string* why, const std::string& text) {
  if (why != nullptr) *why = text;
  return false;
}

// A table of text, not JSON or XML, which name frames by their own rules.
bool IsTextTable(const std::string& text) {
  const std::size_t begin = text.find_first_not_of("\xEF\xBB\xBF \t\r\n");
  return begin == std::string::npos || std::string("{[<").find(text[begin]) == std::string::npos;
}

}  // namespace

bool VideoSelection::IsValid(std::string* why) const {
  const std::pair<const char*, const std::optional<double>*> numbers[] = {
      {"reading_start", &reading_start},
      {"reading_end", &reading_end},
      {"time_start_s", &time_start_s},
      {"time_end_s", &time_end_s}};
  for (const auto& [field, value] : numbers) {
    if (*value && !std::isfinite(**value))
      return FailWith(why,
                      fmt::format("{}: a finite number is expected, found {}", field, **value));
  }
  if (reading_start.has_value() != reading_end.has_value()) {
    return FailWith(why, fmt::format("{}: a constant speed needs reading_start and reading_end",
                                     reading_start ? "reading_end" : "reading_start"));
  }
  if (reading_start && *reading_start == *reading_end) {
    return FailWith(why, fmt::format("reading_end: another reading than reading_start is expected, "
                                     "found {} for both",
                                     *reading_end));
  }
  if (time_start_s && *time_start_s < 0) {
    return FailWith(why,
                    fmt::format("time_start_s: a value >= 0 is expected, found {}", *time_start_s));
  }
  if (time_end_s && !(*time_end_s > time_start_s.value_or(0))) {
    return FailWith(why, fmt::format("time_end_s: a value above {} is expected, found {}",
                                     time_start_s.value_or(0), *time_end_s));
  }
  if (!time_offset.empty() && !SecondsOfTime(time_offset)) {
    return FailWith(why, fmt::format("time_offset: a time is expected (seconds, hh:mm:ss.f, or a "
                                     "date and a time), found '{}'",
                                     time_offset));
  }
  if (every && *every < 1)
    return FailWith(why, fmt::format("every: a value >= 1 is expected, found {}", *every));
  if (frames && *frames < 2)
    return FailWith(why, fmt::format("frames: a value >= 2 is expected, found {}", *frames));
  if (every && frames) return FailWith(why, "frames: excludes every");
  return true;
}

VideoTable ReadVideoTable(const std::string& table, const std::string& path,
                          const ReadingOptions& options, const ReadingReader& reader) {
  VideoTable readings;
  const std::string text = ReadTextFile(table);
  if (IsTextTable(text) && HasTimes(text, table, options)) {
    readings.by_time = TimedReadingsOfTable(text, table, options);
  } else {
    readings.by_frame =
        reader ? reader(table, {path}, options) : ReadTextReadings(table, {path}, options);
  }
  return readings;
}

SweepFile FramesFromVideo(const std::string& path, const std::vector<VideoFrame>& frames,
                          const VideoTable& table, const VideoSelection& selection,
                          const ReadingOptions& options, VideoStatements statements,
                          std::vector<std::string>* notices) {
  std::string why;
  if (!selection.IsValid(&why)) throw Error(why);
  return VideoSweep(path, frames, table, selection, options, statements).Make(notices);
}

SweepFile SweepFromVideo(const std::string& path, const std::vector<VideoFrame>& frames,
                         const VideoTable& table, const VideoSelection& selection,
                         const ReadingOptions& options, const std::string& camera_path,
                         std::vector<std::string>* notices) {
  SweepFile sweep =
      FramesFromVideo(path, frames, table, selection, options, VideoStatements::kOptions, notices);
  sweep.camera_path = camera_path;
  NoteOrderAndRepeats(sweep, notices);
  return sweep;
}

}  // namespace thicklens::model
