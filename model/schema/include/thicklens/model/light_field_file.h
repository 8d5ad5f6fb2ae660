#ifndef THICKLENS_MODEL_LIGHT_FIELD_FILE_H_
#define THICKLENS_MODEL_LIGHT_FIELD_FILE_H_

#include <string>

#include "thicklens/base/export.h"
#include "thicklens/model/light_field.h"

namespace thicklens::model {

// Content of lightfield.yaml, schema thicklens/light-field/1 (docs/file-formats.md): a light field
// without its values. The camera has a file of its own in the same folder.
struct LightFieldDescription {
  LightField light_field;       // without values and without `camera`
  std::string view_format;      // "png" (16 bit, encoded values) or "tiff" (float, linear light)
  bool has_confidence = false;  // true: each ray has a confidence in confidence/view_VV_UU.png
  std::string camera_file;      // path relative to the description; empty: no camera
};

// File name "view_VV_UU" of the view (k, l) without its extension. Each number has two digits, more
// where needed.
THICKLENS_EXPORT std::string ViewFileStem(int k, int l);

// Unknown keys, wrong types and values out of range throw Error with file:line:column;
// `source_name` is the file name in these messages.
THICKLENS_EXPORT LightFieldDescription ReadLightFieldDescription(const std::string& path);
// Reads the text of a description. `source_name` is the file name in messages. Throws Error as
// ReadLightFieldDescription does.
THICKLENS_EXPORT LightFieldDescription ParseLightFieldDescription(const std::string& text,
                                                                  const std::string& source_name);
// The YAML text of a description. Throws Error if a number is not finite.
THICKLENS_EXPORT std::string LightFieldDescriptionToYaml(const LightFieldDescription& description);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_LIGHT_FIELD_FILE_H_
