#ifndef THICKLENS_MODEL_VIDEO_SWEEP_H_
#define THICKLENS_MODEL_VIDEO_SWEEP_H_

#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/readings.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::model {

// The facts about one frame of a video that are known before its pixels are used.
struct VideoFrame {
  std::optional<double> time_s;   // since the first frame; absent: the video states no times
  bool repeats_previous = false;  // its values are those of the frame before
  bool is_damaged = false;        // its bits contradict the codec
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

// The table of the readings of a video: by time, or by the numbers of the frames. Both are absent
// if the speed is constant.
struct VideoTable {
  std::optional<TimedReadingSet> by_time;  // readings between two rows are interpolated linearly
  std::optional<ReadingSet> by_frame;      // rows as SweepFromPages takes them, some or all
};

// More frames are thinned out, unless VideoSelection says how many are used.
constexpr int kMaxVideoFrames = 300;

// A sweep of frames of a video; SweepFrame::page is the number of a frame, from 0. Frames that
// repeat the one before, damaged frames, and frames without a reading are left out and counted in
// `notices`, which may be null. Throws Error if no frame is left, or if times are needed and absent
// or do not rise.
THICKLENS_EXPORT SweepFile SweepFromVideo(const std::string& path,
                                          const std::vector<VideoFrame>& frames,
                                          const VideoTable& table, const VideoSelection& selection,
                                          const ReadingOptions& options,
                                          const std::string& camera_path,
                                          std::vector<std::string>* notices);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_VIDEO_SWEEP_H_
