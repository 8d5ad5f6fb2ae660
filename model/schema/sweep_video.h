#ifndef THICKLENS_MODEL_SCHEMA_SWEEP_VIDEO_H_
#define THICKLENS_MODEL_SCHEMA_SWEEP_VIDEO_H_

#include <string>
#include <vector>

#include "thicklens/base/yaml_reader.h"
#include "thicklens/model/sweep_file.h"
#include "thicklens/model/video_sweep.h"

namespace thicklens::model {

// Reads the frames of the key `video` of a sweep file, a path or a map, into `sweep`. The selection
// of `reading` completes that of the file. Throws Error with the place if both state a value and
// the values differ. `options` says how the table is read, and `notices` may be null.
void ReadSweepVideo(const YamlNode& root, const YamlNode& video, const ReadingOptions& options,
                    const SweepReading& reading, SweepFile* sweep,
                    std::vector<std::string>* notices);

// Where the statements about a video are: messages name them as the user knows them.
enum class VideoStatements {
  kOptions,    // "--time-end"
  kSweepFile,  // "video.time_end_s (--time-end)": in the file, or completed by the option
};

// As SweepFromVideo, without what NoteOrderAndRepeats says of a whole sweep.
SweepFile FramesFromVideo(const std::string& path, const std::vector<VideoFrame>& frames,
                          const VideoTable& table, const VideoSelection& selection,
                          const ReadingOptions& options, VideoStatements statements,
                          std::vector<std::string>* notices);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SCHEMA_SWEEP_VIDEO_H_
