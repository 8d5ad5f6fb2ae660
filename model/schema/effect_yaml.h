#ifndef THICKLENS_MODEL_SCHEMA_EFFECT_YAML_H_
#define THICKLENS_MODEL_SCHEMA_EFFECT_YAML_H_

#include "model/schema/yaml_writer.h"
#include "thicklens/base/yaml_reader.h"
#include "thicklens/model/effect_selection.h"

namespace thicklens::model {

// Reads the keys of the choice of effects from the map `root`: `effects` (auto, all, none or a list
// of names), `without` (a list of names) and `tolerance`. Fields without a key keep their values.
// Throws Error with file:line:column.
void ReadEffectSelectionOptions(const YamlNode& root, EffectSelectionOptions* choice);

// Writes the keys `effects` and `left_out_grey_levels` into the open map of `out`.
void WriteEffects(const EffectSelectionRecord& record, YamlWriter* out);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SCHEMA_EFFECT_YAML_H_
