#ifndef THICKLENS_MODEL_SCHEMA_SWEEP_FRAMES_H_
#define THICKLENS_MODEL_SCHEMA_SWEEP_FRAMES_H_

#include <string>
#include <vector>

#include "thicklens/base/yaml_reader.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::model {

// The images of a sweep, each with its reading. Every row must have its image and every image its
// row; a row or an image without a partner throws Error with its place.

// Reads the frames from the key `frames` of the file, or from `frames_csv` with `frames_dir` or
// `frames_glob`. `mm_per_unit` converts the readings of the table to mm; the readings of `frames`
// are always in mm.
std::vector<SweepFrame> ReadSweepFrames(const YamlNode& root, double mm_per_unit);

// Reads the frames from a folder of images and a table in mm.
std::vector<SweepFrame> FramesOfFolder(const std::string& folder, const std::string& readings_csv);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SCHEMA_SWEEP_FRAMES_H_
