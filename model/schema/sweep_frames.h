#ifndef THICKLENS_MODEL_SCHEMA_SWEEP_FRAMES_H_
#define THICKLENS_MODEL_SCHEMA_SWEEP_FRAMES_H_

#include <string>
#include <vector>

#include "thicklens/base/yaml_reader.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::model {

// The images of a sweep, each with its reading. Every reading must have its image and every image
// its reading; one without a partner throws Error with its place.

// Reads the frames from the key `frames` of the file, from `video`, or from `frames_csv` or
// `readings_from` with `frames_dir` or `frames_glob`, into `sweep`. `notices` may be null.
void ReadSweepFrames(const YamlNode& root, const SweepReading& reading, SweepFile* sweep,
                     std::vector<std::string>* notices);

// Reads the frames from a folder of images and a table, or without a table (empty) from what
// `reading` states.
void ReadFramesOfFolder(const std::string& folder, const std::string& table,
                        const SweepReading& reading, SweepFile* sweep,
                        std::vector<std::string>* notices);

// Adds to `notices`, which may be null, what is unusual about the readings of the frames.
void NoteOrderAndRepeats(const SweepFile& sweep, std::vector<std::string>* notices);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SCHEMA_SWEEP_FRAMES_H_
