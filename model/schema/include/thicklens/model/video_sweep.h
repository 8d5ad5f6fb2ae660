#ifndef THICKLENS_MODEL_VIDEO_SWEEP_H_
#define THICKLENS_MODEL_VIDEO_SWEEP_H_

#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/readings.h"
#include "thicklens/model/sweep_file.h"
#include "thicklens/model/video_selection.h"

namespace thicklens::model {

// The table of the readings of a video: by time, or by the numbers of the frames. Both are absent
// if the speed is constant.
struct VideoTable {
  std::optional<TimedReadingSet> by_time;  // readings between two rows are interpolated linearly
  std::optional<ReadingSet> by_frame;      // rows as SweepFromPages takes them, some or all
};

// Reads the table of the readings of the video `path`: by time if it has times, otherwise by the
// numbers of its frames, which `reader` reads (empty: ReadTextReadings). Throws Error that names
// the place.
THICKLENS_EXPORT VideoTable ReadVideoTable(const std::string& table, const std::string& path,
                                           const ReadingOptions& options,
                                           const ReadingReader& reader);

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
