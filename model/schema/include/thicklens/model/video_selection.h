#ifndef THICKLENS_MODEL_VIDEO_SELECTION_H_
#define THICKLENS_MODEL_VIDEO_SELECTION_H_

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"

namespace thicklens::model {

// The facts about one frame of a video that are known before its pixels are used.
struct VideoFrame {
  std::optional<double> time_s;   // since the first frame; absent: the video states no times
  bool repeats_previous = false;  // its values are those of the frame before
  bool is_damaged = false;        // its bits contradict the codec
  // Frames of which the file has bits but that cannot be decoded, shown before this one (since the
  // one before) and, of the last frame, after it. They have no numbers.
  int lost_before = 0, lost_after = 0;
  // Whether, of the last frame, the file may have had more frames, in places that are not known.
  bool is_count_doubtful = false;
  // Whether, of the last frame, the file may end in the middle of one, and have been longer.
  bool may_be_cut = false;
};

// Which frames of a video are used, and how the bench moved if no table says it.
struct VideoSelection {
  // A constant speed between the two readings, in the unit of ReadingOptions: the first at
  // `time_start_s`, or at the first frame, the second at `time_end_s`, or at the last frame. Both
  // or neither are given.
  std::optional<double> reading_start, reading_end;
  // The part of the video that is used, s since its first frame; absent: from its beginning, or to
  // its end.
  std::optional<double> time_start_s, time_end_s;
  // The time of the first frame on the clock of a table by time, as SecondsOfTime reads it; empty:
  // 0.
  std::string time_offset;
  std::optional<int> every;   // every n-th usable frame, from the first; >= 1
  std::optional<int> frames;  // at most so many, evenly chosen; >= 2; excludes `every`

  // Returns whether the values are possible and do not contradict each other. Otherwise `why`, if
  // not null, gets the field, the value and the constraint.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
  // Whether any value is given.
  bool IsGiven() const {
    return reading_start || reading_end || time_start_s || time_end_s || !time_offset.empty() ||
           every || frames;
  }
};

// Decodes the video `path` once and returns its frames in the order of display. What is unusual
// about the video is added to `notices`, which may be null. Throws Error that begins with the path.
using VideoFramesReader = std::function<std::vector<VideoFrame>(const std::string& path,
                                                                std::vector<std::string>* notices)>;

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_VIDEO_SELECTION_H_
