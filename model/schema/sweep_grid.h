#ifndef THICKLENS_MODEL_SCHEMA_SWEEP_GRID_H_
#define THICKLENS_MODEL_SCHEMA_SWEEP_GRID_H_

#include <string>

#include "model/schema/yaml_writer.h"
#include "thicklens/base/yaml_reader.h"
#include "thicklens/model/sweep_file.h"
#include "thicklens/model/target_grid.h"

namespace thicklens::model {

// A grid as a map {pattern, columns, rows, square_mm [, marker_mm, dictionary]}. Throws Error with
// its place.
TargetGrid ReadTargetGrid(const YamlNode& node);
void WriteTargetGrid(const char* key, const TargetGrid& grid, YamlWriter* out);

// The keys target_grid, grid_views and stage_alignment_deg of a sweep.
void ReadGrid(const YamlNode& root, SweepFile* sweep);
void WriteGrid(const SweepFile& sweep, YamlWriter* out);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SCHEMA_SWEEP_GRID_H_
