#ifndef THICKLENS_MODEL_LIGHT_FIELD_FILE_H_
#define THICKLENS_MODEL_LIGHT_FIELD_FILE_H_

#include <string>

#include "thicklens/model/light_field.h"

namespace thicklens::model {

// lightfield.yaml, schema thicklens/light-field/1 (docs/file-formats.md): all of a light field but
// its values. The camera is a file of its own beside it.
struct LightFieldDescription {
  LightField light_field;       // without values; `camera` is left out
  std::string view_format;      // "png" (16 bit, stored values) or "tiff" (float, linear light)
  bool has_confidence = false;  // of each ray: confidence/view_VV_UU.png
  std::string camera_file;      // relative to the description; empty: none
};

// "view_VV_UU" without the ending: two digits each, more where needed.
std::string ViewFileStem(int k, int l);

// Unknown keys, wrong types, values out of range: Error with file:line:column.
LightFieldDescription ReadLightFieldDescription(const std::string& path);
LightFieldDescription ParseLightFieldDescription(const std::string& text,
                                                 const std::string& source_name);
std::string LightFieldDescriptionToYaml(const LightFieldDescription& description);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_LIGHT_FIELD_FILE_H_
