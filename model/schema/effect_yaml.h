#ifndef THICKLENS_MODEL_SCHEMA_EFFECT_YAML_H_
#define THICKLENS_MODEL_SCHEMA_EFFECT_YAML_H_

#include <yaml-cpp/yaml.h>

#include "thicklens/base/yaml_reader.h"
#include "thicklens/model/effect_choice.h"

namespace thicklens::model {

// What a file says of effects: auto, all, none or a list of names; without: a list of names;
// tolerance. What it does not say stays. Throws Error at the place.
void ReadEffectChoice(const YamlNode& root, EffectChoice* choice);

// effects: and left_out_grey_levels: of a map.
void EmitEffects(const EffectRecord& record, YAML::Emitter* out);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SCHEMA_EFFECT_YAML_H_
