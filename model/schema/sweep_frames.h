#ifndef THICKLENS_MODEL_SCHEMA_SWEEP_FRAMES_H_
#define THICKLENS_MODEL_SCHEMA_SWEEP_FRAMES_H_

#include <string>
#include <vector>

#include "thicklens/base/yaml_reader.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::model {

// The pictures of a sweep, each with its reading. Every row must have its picture and every picture
// its row; whatever does not match throws Error with its place.

// From the file's `frames`, or its `frames_csv` with `frames_dir` or `frames_glob`. `mm_per_unit`
// turns the table's readings into mm; those of `frames` are in mm already.
std::vector<SweepFrame> ReadSweepFrames(const YamlNode& root, double mm_per_unit);

// From a folder and a table in mm.
std::vector<SweepFrame> FramesOfFolder(const std::string& folder, const std::string& readings_csv);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SCHEMA_SWEEP_FRAMES_H_
